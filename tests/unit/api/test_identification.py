"""Claims: a fit finds the parameters that made a record; a comparison says how far a model is off.

The oracle is a lag in closed form, with white noise.
"""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import Component, Input, Parameter, State, UserError
from orchestration.records import write_record


class Lag(Component):
    """The same with its equations."""

    name = "lag"
    tau = Parameter(1.0, "s", min=1e-3, doc="time constant")
    u = Input("1", start=0.0, doc="what it follows")
    x = State("1", rate="falling_short", output=True, doc="what follows")

    def falling_short(self):
        return (self.u - self.x) / self.tau


TAU = 0.8
NOISE = 0.02
TIME = 0.1 * np.arange(400)


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("identification") / "lag.csv"
    u = np.repeat([1.0, -2.0, 0.5, 3.0], 100)
    x = np.zeros(400)
    for k in range(399):
        x[k + 1] = u[k] + (x[k] - u[k]) * np.exp(-0.1 / TAU)
    noise = np.random.default_rng(1).normal(0.0, NOISE, 400)
    write_record(path, TIME, {"u": u, "x": x + noise}, {"u": "1", "x": "1"})
    return path


@pytest.mark.parametrize("equations", [False, True], ids=["FMU", "equations"])
def test_a_fit_finds_what_made_the_record(record, lag, equations):
    fitted = ppy.fit(record, Lag if equations else lag, ["tau"], settings={"tau": 1.5})
    low, high = fitted.intervals["tau"]
    assert fitted.to_frame().loc["tau"].tolist() == [fitted.values["tau"], low, high, 1.5, "s"]
    (axis,) = fitted.plot().axes
    assert [line.get_xdata()[0] for line in axis.lines] == [1.5, fitted.values["tau"], low]
    assert axis.get_xlabel() == "[s]"
    assert low < TAU < high
    assert fitted.values["tau"] == pytest.approx(TAU, rel=0.02)


def test_a_comparison_tells_the_noise_of_a_right_model_and_more_of_a_wrong_one(record, lag):
    right = ppy.compare(record, lag, settings={"tau": TAU}).before["x"]
    assert right.rms == pytest.approx(NOISE, rel=0.15)
    assert right.fit_percent > 98.0
    compared = ppy.compare(ppy.read_record(record, lag), lag, settings={"tau": 1.5}, fit="tau")
    assert compared.before["x"].fit_percent < 90.0
    frame = compared.to_frame()
    assert frame.index.tolist() == [("x", "before"), ("x", "fitted")]
    assert frame.loc[("x", "before"), "fit_percent"] == compared.before["x"].fit_percent
    assert compared.after["x"].fit_percent == pytest.approx(right.fit_percent, abs=0.1)


def test_a_parameter_that_is_not_there_is_refused(record, lag):
    for model in (lag, Lag):
        with pytest.raises(UserError, match="no parameter named 'tua'"):
            ppy.fit(record, model, ["tua"])
