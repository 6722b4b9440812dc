"""Claims: the sine sweep that linear models are held against measures closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, State
from orchestration.system.model import Member, Port, System
from tests.support.sine_sweep import SineSweep, sine_sweep


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
