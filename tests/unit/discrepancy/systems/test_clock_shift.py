"""The shift of a sampled controller's clock, held against a record that is a closed form."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Discrete, Input, Output, Parameter, State
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.systems.clock_shift import estimate_shift, shifts_of

PERIOD = 0.5
TIME = 0.1 * np.arange(300)


class Sampled(Component):
    """A lag of an input that is sampled and held."""

    name = "sampled"
    period = Parameter(PERIOD, "s", min=1e-3)
    shift = Parameter(0.0, "s", min=0)
    gain = Parameter(1.0, "1", min=0)
    tau = Parameter(0.3, "s", min=1e-3)
    u = Input("1")
    held = Discrete("1", update="sample", period="period", shift=("shift",))
    x = State("1", rate="rate")

    def sample(self):
        return self.u

    def rate(self):
        return (self.gain * self.held - self.x) / self.tau

    @Output("1")
    def y(self):
        """Its state."""
        return self.x


def measured(shift, gain, u):
    """The lag of 0.3 s, exact from one sample of either clock to the next."""
    due, held, x, y = shift, 0.0, 0.0, []
    for k, now in enumerate(TIME):
        y.append(x)
        while now < TIME[k] + 0.1:
            if now >= due - 1e-12:
                held, due = u[k], due + PERIOD
            until = min(due, TIME[k] + 0.1)
            x = gain * held + (x - gain * held) * np.exp((now - until) / 0.3)
            now = until
    return np.array(y)


def test_shifts_are_those_of_clocks_with_a_period():
    assert shifts_of(Sampled) == {"shift": "period"}


@pytest.mark.parametrize("shift", [0.013, 0.222, 0.471])
def test_a_shift_is_estimated_beside_parameters_that_are_off(shift):
    random = np.random.default_rng(1)
    u = np.repeat(random.uniform(-1.0, 1.0, 30), 10)
    y = measured(shift, 1.4, u) + 1e-3 * random.standard_normal(TIME.size)
    data = Dataset(TIME, {"u": u}, {"y": y})
    estimate = estimate_shift(Sampled, data, {}, ["gain", "tau"], "shift")
    assert estimate == pytest.approx(shift, abs=0.005)
