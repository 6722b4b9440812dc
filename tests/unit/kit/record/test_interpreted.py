"""Claims: without a compiler a record follows exact solutions to the tolerance; faults are told."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State, UserError
from fmus.kit.record.interpreted import Interpreted
from fmus.kit.symbolic import trace


class Driven(Component):
    """A lag and the area under it, in closed form for an input that is held."""

    name = "driven"
    tau = Parameter(0.7, "s", min=1e-6)
    u = Input("1")
    x = State("1", rate="x_rate", start=0.2)
    area = State("s", rate="area_rate")

    def x_rate(self):
        return (self.u - self.x) / self.tau

    def area_rate(self):
        return self.x

    @Output("1")
    def square(self):
        return self.x * self.x


TIME = 0.25 * np.arange(21)
INTERPRETED = Interpreted(trace(Driven))
INDEX = {p.name: k for k, p in enumerate(Driven.layout.parameters)}


def simulated(u, linear=0.0, tolerance=1e-9, effort=1000.0, time=TIME, **values):
    parameters = np.array([float(p.start) for p in Driven.layout.parameters])
    for name, value in values.items():
        parameters[INDEX[name]] = value
    table = np.asarray(u, dtype=float)[:, np.newaxis]
    return INTERPRETED.simulate(
        time, table, np.array([linear]), parameters, tolerance=tolerance, effort=effort
    )


def held(tau=0.7, start=0.2, u=1.5):
    """x and its area in closed form."""
    decay = np.exp(-TIME / tau)
    return u + (start - u) * decay, u * TIME + (start - u) * tau * (1.0 - decay)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-9])
def test_a_held_input_is_followed_to_the_tolerance(tolerance):
    outputs, states, _ = simulated(np.full(21, 1.5), tolerance=tolerance, x_start=0.4)
    x, area = held(start=0.4)
    assert np.abs(states - np.column_stack([x, area])).max() < 10.0 * tolerance
    assert outputs[:, 0] == pytest.approx(states[:, 0] ** 2, rel=1e-15)


def test_an_interpolated_input_is_a_ramp_and_a_held_one_a_staircase():
    """From rest a lag follows the ramp u = t as t - tau (1 - exp(-t / tau))."""
    _, ramp, _ = simulated(TIME, linear=1.0, x_start=0.0)
    _, staircase, _ = simulated(TIME, linear=0.0, x_start=0.0)
    assert ramp[:, 0] == pytest.approx(TIME - 0.7 * -np.expm1(-TIME / 0.7), abs=1e-8)
    assert (staircase[2:, 0] < ramp[2:, 0]).all()


def test_one_interpreter_forgets_the_record_before():
    first = simulated(np.full(21, 1.5))
    simulated(np.linspace(0.0, 9.0, 21), linear=1.0, tau=0.1)
    np.testing.assert_array_equal(simulated(np.full(21, 1.5))[1], first[1])


@pytest.mark.parametrize(
    ("about", "said"),
    [
        ({"u": np.full(21, np.nan)}, "^'u' is not a finite number at t = 0 s$"),
        ({"u": np.zeros(21), "x_start": np.inf}, "^'x' is not a finite number at t = 0 s$"),
        (
            {"u": np.zeros(21), "time": np.append(TIME[:-1], TIME[-2])},
            "^times must increase, but 4.75 s follows 4.75 s$",
        ),
        (
            {"u": np.ones(21), "tau": 1e-4, "effort": 20.0},
            "^more than 20 internal steps per sample up to 0.25 s",
        ),
    ],
)
def test_a_record_that_cannot_be_simulated_is_told(about, said):
    with pytest.raises(UserError, match=said):
        simulated(**about)


def test_as_many_steps_are_made_as_are_allowed():
    """An average of so many a sample, of which a single sample may take all."""
    still = np.zeros(21)
    _, _, steps = simulated(still)
    assert simulated(still, effort=steps / len(TIME))[2] == steps
    with pytest.raises(UserError, match=r"^more than [0-9.]+ internal steps per sample up to 5 s"):
        simulated(still, effort=(steps - 1.0) / len(TIME))
    with pytest.raises(UserError, match=r"^more than 1 internal steps per sample up to 1000000 s"):
        simulated(np.zeros(2), time=np.array([0.0, 1e6]), tau=1e-3, effort=1.0)
