"""Claims: a sine sweep of a co-simulation measures the frequency response of closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, State, UserError
from orchestration.linear.measured_response import SineSweep, sine_sweep
from orchestration.system.model import Member, Port, System


class Lag(Component):
    """``x' = u - x`` beside a square, which a difference of two signs does not see."""

    name = "lag"
    u = Input("1", doc="input")
    x = State("1", rate="slope", output=True, doc="state")

    def slope(self):
        return self.u - self.x

    @Output("1")
    def bent(self):
        """State and its square."""
        return self.x + 0.5 * self.x * self.x


@pytest.fixture(scope="module")
def system():
    return System("s", (Member.of("lag", Lag),), (), {"u": (Port("lag", "u"),)}, {})


def exact(frequencies, period):
    decay = np.exp(-period)
    return (1.0 - decay) / (np.exp(2j * np.pi * frequencies * period) - decay)


def test_the_response_of_a_lag_whose_input_is_held(system):
    frequencies = np.array([0.02, 0.2, 2.0])
    sweep = SineSweep(frequencies, 0.1, 0.1, 0.05, settling=20.0)
    found = sine_sweep(system, "u", ["lag.x", "lag.bent"], sweep)
    np.testing.assert_allclose(found["lag.x"], exact(frequencies, 0.1), rtol=1e-5)
    np.testing.assert_allclose(found["lag.bent"], exact(frequencies, 0.1), rtol=1e-3)


def test_it_is_about_the_operating_point(system):
    # around x = 2 the square adds 2 to the slope
    frequencies = np.array([0.5])
    sweep = SineSweep(frequencies, 1e-3, 0.1, 0.1, at=20.0, settling=10.0)
    found = sine_sweep(system, "u", ["lag.bent"], sweep, {"u": 2.0})
    np.testing.assert_allclose(found["lag.bent"], 3.0 * exact(frequencies, 0.1), rtol=1e-4)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("frequencies", np.array([0.5, 0.0])),
        ("frequencies", np.array([np.nan])),
        ("frequencies", np.array([])),
        ("amplitude", 0.0),
        ("period", -1.0),
        ("step", np.inf),
    ],
)
def test_a_sweep_of_nothing_is_refused(name, value):
    given = {"frequencies": np.array([1.0]), "amplitude": 0.1, "period": 0.1, "step": 0.1}
    with pytest.raises(UserError, match=rf"{name} = .*: finite, and above 0"):
        SineSweep(**given | {name: value})


def test_a_frequency_that_is_too_high_for_the_hold_is_refused(system):
    with pytest.raises(UserError, match=r"3 Hz: a period of 0\.1 s .* up to 2\.5 Hz"):
        sine_sweep(system, "u", ["lag.x"], SineSweep(np.array([3.0]), 0.1, 0.1, 0.1))
