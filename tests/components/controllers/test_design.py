"""The designs of state feedback and PID: the defaults that ship, other plants, what is refused."""

import re

import control
import numpy as np
import pytest

from fmus.controllers.design import gains, pid_gains, state_feedback
from fmus.controllers.state_feedback import GAINS
from fmus.kit import UserError, stack
from fmus.kit.declare import summary
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator, PpyActuatorLengthDriven
from tests.support.displacement_loop import drive


def test_the_defaults_are_the_design_of_the_actuator():
    assert gains(PpyActuator) == pytest.approx(GAINS, rel=1e-7, abs=1e-15)


def test_the_sampled_model_is_that_of_the_circuit():
    found = gains(PpyActuator, R1=1.32, R2=2.72, C=0.46, sample_period=0.05)
    tau = (1.32 + 2.72) * 0.46
    assert found["charge_pole"] == pytest.approx(np.exp(-0.05 / tau), rel=1e-12)
    final = 2.72 * 0.46  # charge per current that is held
    assert found["charge_per_current"] == pytest.approx(final * -np.expm1(-0.05 / tau), rel=1e-12)
    assert found["sample_period"] == 0.05


def test_another_actuator_follows_its_own_design_by_the_pole_that_was_asked_for():
    values = {"R1": 1.32, "R2": 2.72, "C": 0.46, "alpha": 1e-4}
    made = state_feedback(PpyActuator, name="small_one", time_constants=(0.4, 1.0), **values)
    found = drive(made(current_limit=100.0), PpyActuator(**values), np.full(200, 1e-5))
    expected = 1e-5 * (1.0 - np.exp(-0.02 * np.arange(200) / 0.4))
    assert found["displacement"] == pytest.approx(expected, rel=1e-6, abs=1e-11)
    assert made.name == "small_one"
    assert f"charge_gain {made().charge_gain:.6g}" in made.remark
    assert summary(made)


@pytest.mark.parametrize(
    "plant", [PpyActuatorLengthDriven, stack(PpyActuator, EFFECTS["diffusion"])]
)
def test_an_actuator_with_other_signals_or_states_is_refused_in_a_line(plant):
    with pytest.raises(UserError, match="state feedback is for a force-driven actuator") as caught:
        gains(plant)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"R1": -1.0}, "ppy_actuator: R1 = -1 ohm is out of range, 0 … 1e+06 ohm"),
        ({"R1": np.nan}, "ppy_actuator: R1 = nan ohm is out of range"),
        ({"C": 0.0}, "ppy_actuator: C = 0 F is out of range"),
        ({"nope": 1.0}, "no parameter, input or state named 'nope'"),
        ({"sample_period": 0.0}, "sample period 0 s: a time above 0 s"),
        ({"sample_period": np.nan}, "sample period nan s: a time above 0 s"),
        ({"time_constants": (1.0, 1.0)}, "time constants 1, 1 s: two unequal times above 0 s"),
        ({"time_constants": (-1.0, 1.0)}, "time constants -1, 1 s: two unequal"),
        ({"time_constants": (1.0,)}, "time constants 1 s: two unequal"),
    ],
    ids=str,
)
def test_values_that_no_actuator_has_are_refused_in_a_line(given, told):
    with pytest.raises(UserError, match=f"{re.escape(told)}") as caught:
        state_feedback(PpyActuator, **given)
    assert "\n" not in str(caught.value)


# --- PID -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("margin", [45.0, 60.0, 75.0])
@pytest.mark.parametrize("lag", [0.5, 1.0, 1.5])
def test_the_loop_has_the_margin_and_the_crossover_that_were_asked_for(margin, lag):
    """By python-control, of the controller as a transfer function."""
    s = control.tf("s")
    plant = 2.0 / ((7.0 * s + 1.0) * (lag * s + 1.0) ** 2)
    found = pid_gains(complex(plant(2j * np.pi * 0.05)), 0.05, margin)
    integral, derivative = found["integral_time"], found["derivative_time"]
    loop = plant * found["proportional_gain"] * (1.0 + 1.0 / (integral * s) + derivative * s)
    _, phase, _, crossover = control.margin(loop)
    assert phase == pytest.approx(margin, rel=1e-9)
    assert crossover / (2.0 * np.pi) == pytest.approx(0.05, rel=1e-9)
    assert derivative == pytest.approx(integral / 4.0, rel=1e-12)


def test_a_phase_that_no_pid_turns_is_refused_in_a_line():
    """Of a plant at -170 degrees, a margin of 101 needs a lead of 91."""
    behind = np.exp(-1j * np.radians(170.0))
    assert pid_gains(behind, 1.0, 99.0)["proportional_gain"] > 0.0
    with pytest.raises(UserError, match=r"turn the phase by 91 degrees; a PID can") as caught:
        pid_gains(behind, 1.0, 101.0)
    assert "\n" not in str(caught.value)
    with pytest.raises(UserError, match="above 0 Hz"):
        pid_gains(behind, 0.0, 60.0)
    for margin in (0.0, 200.0, np.nan):
        with pytest.raises(UserError, match=f"phase margin {margin:g} degrees: above 0 and below"):
            pid_gains(behind, 1.0, margin)
    for nothing in (0j, complex(np.nan)):
        with pytest.raises(UserError, match="a finite one that is not zero"):
            pid_gains(nothing, 1.0, 60.0)
