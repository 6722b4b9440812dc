"""Feedforward: composed with the actuator it is the reference, and no limit is passed."""

import numpy as np
import pytest
from scipy.linalg import expm

from fmus.controllers.feedforward import Feedforward
from tests.support.sampled import run

R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6
PERIOD = 0.25
COUNT = 400
TIME = PERIOD * np.arange(COUNT + 1)
LOADS = 0.6 + 0.4 * np.sin(0.63 * TIME) + 0.05 * np.cos(2.1 * TIME)


def plant(currents, loads):
    """Displacement and voltage at the samples of a held current under loads that change evenly.

    Charge, Kelvin and Maxwell elongation of eq. 3.5, then current, load and slope of the load.
    """
    rates = np.zeros((6, 6))
    rates[0, [0, 3]] = -1.0 / ((R1 + R2) * C), R2 / (R1 + R2)
    rates[1, [1, 4]] = -K2 / B2, 1.0 / B2
    rates[2, 4] = 1.0 / B1
    rates[4, 5] = 1.0
    transition = expm(PERIOD * rates)
    state = np.zeros(3)
    displacements, voltages = [loads[0] / K1], []
    for k, current in enumerate(currents):
        for later in (False, True):
            at_once = R1 * R2 / (R1 + R2) * current
            voltages.append(at_once + R2 / (R1 + R2) * state[0] / C)
            if not later:
                held = [current, loads[k], (loads[k + 1] - loads[k]) / PERIOD]
                state = (transition @ np.append(state, held))[:3]
        displacements.append(ALPHA * state[0] + state[1] + state[2] + loads[k + 1] / K1)
    return np.array(displacements), np.array(voltages)


def commands(references, loads=LOADS, **parameters):
    """Outputs of the feedforward, each held from its sample on."""
    inputs = {"next_reference": references[1:], "force": loads[:-1], "next_force": loads[1:]}
    return run(Feedforward(**parameters), inputs, len(loads) - 1)


def within_reach():
    """Displacement that the load and some charge make, in closed form by the actuator."""
    currents = 0.4 * np.sin(0.63 * TIME[:-1] + 1.0)
    return plant(currents, LOADS)[0], currents


def test_the_actuator_behind_it_follows_the_reference():
    references = plant(0.0 * TIME[:-1], LOADS)[0] + 3e-5 * np.sin(0.63 * TIME)
    found = commands(references)
    assert not found["limited"].any()
    reached, _ = plant(found["command"], LOADS)
    np.testing.assert_allclose(reached[1:], references[1:], rtol=0, atol=1e-12)


def test_it_finds_the_current_of_an_actuator():
    references, currents = within_reach()
    np.testing.assert_allclose(commands(references)["command"], currents, rtol=0, atol=1e-9)


def test_in_closed_form_a_step_takes_its_charge_at_once_and_its_leakage_thereafter():
    """(1 - a) R2 C i = x / alpha, then i = x / (alpha R2 C)."""
    size = 1e-6
    found = commands(np.full(9, size), np.zeros(9))["command"]
    leakage = size / (ALPHA * R2 * C)
    assert found[0] == pytest.approx(leakage / (1.0 - np.exp(-PERIOD / ((R1 + R2) * C))))
    assert found[1:] == pytest.approx(leakage)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("limit", [0.2, 1.0])
def test_no_limit_is_passed(seed, limit):
    """References far out of reach, with jumps."""
    levels = 4e-4 * np.random.default_rng(seed).standard_normal(COUNT // 20 + 1)
    found = commands(np.repeat(levels, 20)[: COUNT + 1], voltage_limit=limit, rate_limit=1.2)
    _, voltages = plant(found["command"], LOADS)
    assert found["limited"].any()
    assert np.abs(found["command"]).max() <= 1.3
    assert np.abs(voltages).max() == pytest.approx(limit, rel=1e-12)


@pytest.mark.parametrize("charge", [-1.0, 3.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_voltage_is_at_its_limit_where_it_is_larger(charge, side):
    """Films charged beyond the limit's own 2.7 C let charge go: the voltage is largest at once."""
    start = side * charge
    model = Feedforward(charge_start=start, voltage_limit=1.0, current_limit=1e3, rate_limit=1e6)
    current = run(model, {"next_reference": side * 1.0}, 1)["command"][0]
    decay = np.exp(-PERIOD / ((R1 + R2) * C))
    charges = np.array([start, decay * start + R2 * C * (1.0 - decay) * current])
    voltages = R1 * R2 / (R1 + R2) * current + R2 / (R1 + R2) * charges / C
    assert np.max(side * voltages) == pytest.approx(1.0, rel=1e-12)
    assert np.argmax(side * voltages) == (0 if charge > C else 1)


def test_the_rate_is_limited_alone():
    found = commands(np.full(COUNT + 1, 1e-4), np.zeros(COUNT + 1), rate_limit=0.4)
    changes = np.diff(found["command"], prepend=0.0)
    assert changes.max() == pytest.approx(0.4 * PERIOD, rel=1e-12)
    assert changes.min() >= -0.4 * PERIOD - 1e-12


def test_what_a_limit_took_is_made_up_for():
    """The model knows the charge that it has, so nothing winds up."""
    references = np.where(np.arange(COUNT + 1) < 100, 3e-4, 2e-5)
    found = commands(references, np.zeros(COUNT + 1))
    reached, _ = plant(found["command"], np.zeros(COUNT + 1))
    assert found["limited"][:5].all()
    np.testing.assert_allclose(reached[120:], 2e-5, rtol=0, atol=1e-12)


def test_inactive_it_commands_nothing():
    model = Feedforward()
    run(model, {"next_reference": 1e-4}, 3)
    assert model.command() > 0.0
    model.active = False
    assert model.command() == 0.0
