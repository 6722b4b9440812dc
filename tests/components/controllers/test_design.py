"""The design of state feedback: the defaults that ship, other plants, what is refused."""

import re

import numpy as np
import pytest

from fmus.controllers.design import gains, state_feedback
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
