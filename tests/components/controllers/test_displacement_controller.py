"""Displacement control: a step, its limits over many plants, windup, and the law without limits."""

import itertools

import control
import numpy as np
import pytest

from fmus.controllers.displacement_controller import DisplacementController
from fmus.kit import stack
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support.displacement_loop import drive, worst
from tests.support.effect_samples import ACTIVE
from tests.support.pace import slow_but
from tests.support.sampled import run

PERIOD = 0.02
STEP = 1e-4  # m
# Of the nominal plant, typed in: thesis tables 2-2, 3-1, fig. 3-10.
R1, R2, C, ALPHA, CURRENT = 0.43, 2.35, 2.70, 6.8e-5, 1.3
VOLTAGE_LIMIT, CHARGE_LIMIT = 1.0, 2.5
PAIRS = list(itertools.combinations(EFFECTS, 2))


def stairs(seed):
    """Half a minute of steps within reach and far beyond, in both directions."""
    levels = 1e-4 * np.array([-5.0, -2.0, -1.0, 0.0, 1.0, 2.0, 5.0])
    return np.repeat(np.random.default_rng(seed).choice(levels, 6), 250)


def within_limits(found):
    assert worst(found, "voltage") <= VOLTAGE_LIMIT
    assert worst(found, "charge") <= CHARGE_LIMIT
    assert worst(found, "current") <= CURRENT


def test_a_step_settles_as_fast_as_the_actuator_can_and_does_not_overshoot():
    found = drive(DisplacementController(), PpyActuator(), np.full(1000, STEP))
    displacement = found["displacement"]
    assert displacement.max() <= 1.05 * STEP
    within_limits(found)
    # with all of the current the charge q tau grows towards R2 C i: the step takes so long at least
    final = R2 * C * CURRENT
    shortest = -(R1 + R2) * C * np.log(1.0 - STEP / ALPHA / final)
    outside = np.flatnonzero(np.abs(displacement - STEP) > 0.02 * STEP)
    assert 1.3 < shortest < 1.5
    assert outside[-1] * PERIOD < shortest + 2.0 * 0.5, "two time constants of the loop more"
    assert displacement[-1] == pytest.approx(STEP, rel=1e-4)


@pytest.mark.slow
def test_limits_hold_on_random_plants():
    rng = np.random.default_rng(35)
    names = ("R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2")
    nominal = PpyActuator()
    reached = []
    for seed in range(200):
        shares = rng.uniform(0.7, 1.3, len(names))
        changed = {n: getattr(nominal, n) * share for n, share in zip(names, shares, strict=True)}
        found = drive(DisplacementController(), PpyActuator(**changed), stairs(seed))
        within_limits(found)
        reached.append(worst(found, "voltage"))
    assert max(reached) > 0.9, "the limit of the voltage was near"


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), slow_but(PAIRS, *PAIRS[::23]))
def test_limits_hold_with_any_two_effects_hidden(first, second):
    pair = first, second
    values = {name: value for effect in pair for name, value in ACTIVE[effect].items()}
    plant = stack(PpyActuator, *(EFFECTS[name] for name in pair))(**values)
    plant.force = 1.0
    within_limits(drive(DisplacementController(), plant, stairs(1)))


def test_without_its_limits_the_voltage_goes_beyond():
    """The same steps with limits out of reach show the use of the limits."""
    free = DisplacementController(voltage_limit=100.0, charge_limit=100.0, current_limit=10.0)
    found = drive(free, PpyActuator(), stairs(0))
    assert worst(found, "voltage") > 2.0
    assert worst(found, "charge") > CHARGE_LIMIT


def test_windup_of_a_minute_is_gone_within_a_time_constant_of_the_circuit():
    """A minute at 0.5 mm, which the limits do not allow, then half of what is reached."""
    minute, wanted = 3000, 5e-5
    found = drive(
        DisplacementController(),
        PpyActuator(),
        np.r_[np.full(minute, 5e-4), np.full(1000, wanted)],
    )
    reached = found["displacement"][minute]
    after = minute + round((R1 + R2) * C / PERIOD)
    assert reached > 1e-4
    assert np.abs(found["displacement"][after:] - wanted).max() < 0.02 * (reached - wanted)
    assert found["displacement"][minute:].min() > wanted - 0.05 * (reached - wanted)


def test_creep_leaves_the_error_of_a_ramp():
    """The loop is 1 / (T s): a creep of v m/s leaves v T, with the elements of fig. 3-9."""
    plant = PpyActuator()
    plant.force, end = 0.2, 30.0
    found = drive(DisplacementController(), plant, np.full(round(end / PERIOD), STEP))
    creep = plant.force * (np.exp(-end * 1e4 / 2e6) / 2e6 + 1.0 / 1.7e6)
    loop_time = (R1 + R2) * C / (3.5e4 * ALPHA * R2 * C)
    assert found["displacement"][-1] - STEP == pytest.approx(creep * loop_time, rel=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_without_limits_it_is_the_discrete_transfer_function_of_a_pi_controller(seed):
    rng = np.random.default_rng(seed)
    gain, integral = rng.uniform([1e3, 0.5], [5e4, 20.0])
    errors = 1e-6 * rng.standard_normal(500)
    found = run(
        DisplacementController(proportional_gain=gain, integral_time=integral),
        {"reference": errors},
        500,
    )["command"]
    continuous = control.tf([gain * integral, gain], [integral, 0.0])
    discrete = control.sample_system(continuous, PERIOD, method="backward_diff")
    expected = control.forced_response(discrete, PERIOD * np.arange(500), errors).outputs
    assert np.abs(expected).max() < 1.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_the_estimate_of_the_charge_is_that_of_the_circuit():
    """From any state: v = R1 j + Q/C with j = (R2 i - Q/C) / (R1 + R2), solved for Q."""
    charge, current = 1.1, -0.4
    through = (R2 * current - charge / C) / (R1 + R2)
    given = {"voltage": R1 * through + charge / C, "current": current}
    model = DisplacementController()
    run(model, given, 1)
    assert model.charge == pytest.approx(charge, rel=1e-12)


def test_on_hold_the_command_stays():
    model = DisplacementController()
    run(model, {"reference": 1e-6}, 3)
    before = model.command()
    assert run(model, {"reference": 5e-6, "hold": True}, 5)["command"].tolist() == [before] * 5


def test_the_limits_count_the_command_beside():
    """With a feedforward far too large the sum is what the feedback alone may command."""
    given = {"reference": 1e-3, "voltage": 0.3, "current": 0.2}
    alone = run(DisplacementController(), given, 5)["command"]
    for beside in (5.0, -0.4):
        found = run(DisplacementController(), given | {"command_beside": beside}, 5)
        assert found["command"] == pytest.approx(alone, rel=1e-12)
    held = run(DisplacementController(), {"hold": True, "command_beside": 0.4}, 5)
    assert np.all(held["command"] == 0.4)
