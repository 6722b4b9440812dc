"""Claims: a delayed output is the undelayed one of earlier instants, exactly, with its derivatives.

Oracles: a held step, a sine, and a relaxation in closed form.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, stack
from fmus.kit.inputs import input_delay
from fmus.kit.sensors import transport_delay
from orchestration.identify.fitting.delay import DelayedModel
from orchestration.identify.fitting.simulation_input import SimulationInput
from tests.support.relaxation import Relaxation

TIME = 7.0 + 0.05 * np.arange(60)
DELAY = 0.163  # s: between samples


class Amplifier(Component):
    """An input times a gain, and the input as it is."""

    name = "amplifier"

    gain = Parameter(2.0, "1")
    u = Input("1")

    @Output("1")
    def y(self):
        """Return what is amplified."""
        return self.gain * self.u

    @Output("1")
    def plain(self):
        """Return the input."""
        return self.u


def run(cls, sensitivities, u, *, linear=False, **values):
    delayed = stack(cls, transport_delay(cls, "y"))
    known = {p.name: p.start for p in delayed.layout.parameters} | {"y_delay": DELAY} | values
    model = DelayedModel(delayed, sensitivities)
    assert model.delays == {"y": "y_delay"}
    return model.run(SimulationInput(TIME, {"u": u}, known, linear=linear))


@pytest.mark.parametrize("delay", [DELAY, 0.15002], ids=["between", "close to a sample"])
def test_of_an_input_that_is_held(delay):
    """A step arrives between two samples and is seen at the later one; more delay moves nothing."""
    u = np.where(TIME < 8.0, 0.0, 1.0)
    ran = run(Amplifier, ["y_delay"], u, y_delay=delay)
    assert ran.signals["y"].tolist() == np.where(8.0 + delay > TIME, 0.0, 2.0).tolist()
    assert not ran.sensitivities["y"].any()


def test_of_an_input_that_is_linear():
    """A ramp is late by the delay, also between samples."""
    ran = run(Amplifier, ["y_delay"], TIME - TIME[0], linear=True)
    since = np.maximum(TIME - TIME[0] - DELAY, 0.0)
    assert ran.signals["y"] == pytest.approx(2.0 * since, abs=1e-12)


def test_of_a_model_with_a_state():
    ran = run(Relaxation, ["y_delay", "tau"], np.ones(60), tau=0.5)
    since = np.maximum(TIME - TIME[0] - DELAY, 0.0)
    by_delay, by_tau = ran.sensitivities["y"].T
    assert ran.signals["y"] == pytest.approx(-np.expm1(-since / 0.5), abs=1e-6)
    assert by_delay == pytest.approx(
        np.where(since > 0.0, -np.exp(-since / 0.5) / 0.5, 0.0), abs=1e-3
    )
    assert by_tau == pytest.approx(-since / 0.25 * np.exp(-since / 0.5), abs=1e-6)


def test_no_delay_is_the_model_as_it_is():
    u = np.sin(3.0 * TIME)
    ran = run(Amplifier, ["gain"], u, y_delay=0.0)
    assert ran.signals["y"] == pytest.approx(2.0 * u, abs=1e-12)
    assert ran.sensitivities["y"][:, 0] == pytest.approx(u, abs=1e-12)


@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
@pytest.mark.parametrize("delay", [DELAY, 0.2], ids=["between samples", "at samples"])
def test_an_input_that_arrives_late(delay, linear):
    """A relaxation follows a step, or a ramp, from the delay on; both in closed form."""
    cls = stack(Relaxation, input_delay(Relaxation, "u"))
    known = {p.name: p.start for p in cls.layout.parameters} | {"u_delay": delay, "tau": 0.5}
    model = DelayedModel(cls, ["u_delay", "tau"])
    elapsed = TIME - TIME[0]
    u = elapsed if linear else np.where(elapsed < 0.5 - 1e-9, 0.0, 1.0)
    ran = model.run(SimulationInput(TIME, {"u": u}, known, linear=linear))
    since = np.maximum(elapsed - delay - (0.0 if linear else 0.5), 0.0)
    rising = -np.expm1(-since / 0.5)
    if linear:
        expected, rate = since - 0.5 * rising, rising
    else:
        expected, rate = rising, np.where(since > 1e-9, np.exp(-since / 0.5) / 0.5, 0.0)
    assert ran.signals["y"] == pytest.approx(expected, abs=1e-6)
    near_step = np.abs(since) < 2e-9
    by_delay = ran.sensitivities["y"][:, 0]
    assert by_delay[~near_step] == pytest.approx(-rate[~near_step], abs=3e-3)
    moved = model.run(SimulationInput(TIME, {"u": u}, known | {"tau": 0.501}, linear=linear))
    assert ran.sensitivities["y"][:, 1] == pytest.approx(
        (moved.signals["y"] - ran.signals["y"]) / 1e-3, abs=3e-3
    )
