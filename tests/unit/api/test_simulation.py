"""Claims: a simulation is what the equations say, over the points asked for, and is handed on as it
is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import Component, Output, Parameter, State, UserError
from orchestration.api.simulation import (
    as_declared,
    as_measured,
    as_model,
    as_runnable,
    points_of,
    values_of,
)
from orchestration.system import library, ssp
from tests.support.fmi3_fmus import changed, foreign


def test_a_component_is_simulated_as_its_equations_say():
    """Charge of the circuit under a constant current: closed form of thesis eq. 3.6."""
    r1, r2, c, amps = 0.5, 2.35, 2.7, 0.9
    run = ppy.simulate("ppy_actuator", {"current": amps}, stop=30.0, settings={"R1": r1})
    expected = amps * r2 * c * (1.0 - np.exp(-run.time / ((r1 + r2) * c)))
    assert run["charge"] == pytest.approx(expected, rel=1e-5, abs=1e-9)
    assert str(run).startswith("ppy_actuator: ")
    assert len(repr(run)) < 80


@pytest.fixture(scope="module")
def run(lag):
    """A lag of 2 s after a step of its input, held between points."""
    return ppy.simulate(
        lag, {"u": lambda t: np.where(t < 0.95, 0.0, 3.0)}, stop=2, step=0.1, settings={"tau": 2}
    )


def test_an_input_may_be_a_function_of_time(run):
    exact = np.where(run.time < 1.0, 0.0, 3.0 * (1.0 - np.exp(-(run.time - 1.0) / 2.0)))
    assert run["x"] == pytest.approx(exact, abs=1e-12)
    assert run["u"].tolist() == run.inputs["u"].tolist()


def test_it_is_handed_on_as_table_record_and_lists(run, tmp_path):
    assert run.to_frame()["x"].tolist() == run["x"].tolist()
    assert run.to_dict() == {
        "time": run.time.tolist(),
        "u": run["u"].tolist(),
        "x": run["x"].tolist(),
    }
    record = ppy.read_record(run.to_csv(tmp_path / "r.csv"), run.model)
    assert record.signals["x"].tobytes() == run["x"].tobytes()
    assert [axis.get_ylabel() for axis in run.plot(tmp_path / "r.svg").axes] == ["u", "x"]
    assert (tmp_path / "r.svg").read_text(encoding="utf-8").startswith("<?xml")
    words = [line.split() for line in str(run).splitlines()]
    assert words[0] == ["one_state.fmu:", "21", "points", "from", "0", "s", "to", "2", "s"]
    assert [line[0] for line in words[1:]] == ["output", "x"]


@pytest.mark.parametrize("found", [as_declared, as_measured, as_model, as_runnable])
def test_a_file_is_a_path_or_its_name(found, lag):
    assert found(Path(lag)).path == found(str(lag)).path == Path(lag)


@pytest.mark.parametrize("found", [as_measured, as_runnable])
def test_so_is_the_file_of_a_system(found, tmp_path):
    path = tmp_path / "bench.ssp"
    ssp.write(library.system("dma_bench"), path)
    assert list(found(path).outputs) == list(found(str(path)).outputs)


def test_it_begins_where_the_default_experiment_does(tmp_path):
    path = changed("lag", tmp_path, 'startTime="0" stopTime="2"', 'startTime="5" stopTime="7"')
    run = ppy.simulate(path, {"u": 1.0}, settings={"tau": 0.5, "k": 3.0})
    assert run.time == pytest.approx(np.linspace(5.0, 7.0, 41))
    exact = 3.0 + (0.25 - 3.0) * np.exp(-(run.time - 5.0) / 0.5)
    assert run["y"] == pytest.approx(exact, abs=1e-12)
    assert points_of(run.model, None, 6.0, 0.5).tolist() == [5.0, 5.5, 6.0]
    with pytest.raises(UserError, match=r"cannot step from 5 s to 4 s by 0\.05 s"):
        points_of(run.model, None, 4.0, None)


def test_points_are_those_given_or_those_of_the_models_own_experiment():
    model = ppy.find_model("ppy_actuator")  # 0.1 s over 60 s
    assert points_of(model, None, 1.0, 0.25).tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert points_of(model, None, "1s", "250 ms").tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert np.diff(points_of(model, None, 2.0, None)) == pytest.approx(0.1)
    assert points_of(model, [0, 1, 7], 2.0, 0.1).tolist() == [0.0, 1.0, 7.0]


def test_values_have_units_and_go_over_a_preset():
    model = ppy.find_model("ppy_actuator")
    given = values_of(model, {"R1": "800 mohm", "C": 2}, "five_layer")
    assert given["R1"] == pytest.approx(0.8)
    assert given["C"] == 2.0
    assert given["R2"] == 2.72  # of the preset


@pytest.mark.parametrize(
    ("inputs", "said"),
    [
        ({"v": 1.0}, "no input named 'v'"),
        ({"u": [1.0, 2.0]}, r"u: shape \(2,\) for 11 points in time"),
        ({"u": lambda t: t[:-1]}, r"u: shape \(10,\) for 11 points in time"),
    ],
)
def test_inputs_that_do_not_fit_are_refused(lag, inputs, said):
    with pytest.raises(UserError, match=said):
        ppy.simulate(lag, inputs, stop=1.0, step=0.1)


def test_a_class_of_a_notebook_is_checked_before_it_is_built():
    class Cell(Component):
        """A cell that counts its charge."""

        name = "cell"
        capacity = Parameter(2.3, "A*h", min=0.1)
        charge = State("1", rate="charge_rate")

        def charge_rate(self):
            return -1.0 / self.capacity

        @Output("1")
        def state_of_charge(self):
            return self.charge

    Cell.__module__ = "__main__"
    with pytest.raises(UserError, match=r"charge_rate gives 1/A/h, but it is the rate of charge"):
        ppy.simulate(Cell)


@pytest.mark.parametrize("isolate", [False, True])
def test_it_ends_when_its_fmu_asks_for_it(isolate):
    options = {"settings": {"manner": 3}, "stop": 2, "step": 0.1, "isolate": isolate}
    run = ppy.simulate(str(foreign("sawtooth")), **options)
    np.testing.assert_allclose(run.time, [0.0, 0.1, 0.2, 0.3], rtol=1e-15)
    np.testing.assert_allclose(run["x"], [0.0, 0.1, 0.2, 0.0], rtol=1e-12)
