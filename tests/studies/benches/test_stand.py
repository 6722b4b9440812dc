"""The simulated stand against closed forms: what is hidden acts as its law says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studies.benches import NOMINAL, Stand

TIME = 0.1 * np.arange(100)
WEIGHT = 0.2 * 9.80665  # N
STIFF = NOMINAL | {"b1": 1e15, "b2": 1e15, "alpha": 0.0}
PLAIN = Stand(STIFF)


def position(stand: Stand, current: float = 0.0) -> np.ndarray:
    """Return what LabVIEW reads of 200 g that are put on at the start."""
    run = stand.run(TIME, np.full(TIME.size, 0.2), np.full(TIME.size, current))
    return run["displacement_measured"]


def test_a_weight_lengthens_the_spring_as_it_is_placed():
    placed = WEIGHT * (1.0 - np.exp(-TIME / 0.05))
    np.testing.assert_allclose(position(PLAIN), placed / 6300.0, atol=1e-9)


def test_the_frame_adds_its_compliance_and_an_lvdt_that_leans_shows_less():
    yielding, leaning = replace(PLAIN, compliance=1e-4), replace(PLAIN, lean=0.3)
    ratio = 1.0 + 1e-4 * 6300.0
    np.testing.assert_allclose(position(yielding), ratio * position(PLAIN), atol=1e-9)
    np.testing.assert_allclose(position(leaning), np.cos(0.3) * position(PLAIN), atol=1e-9)


@pytest.mark.parametrize("current", [-1.0, 1.0])
def test_friction_acts_against_the_films_that_move(current):
    """Far faster than it creeps: by 0.1 mm/s."""
    moving = Stand(STIFF | {"alpha": 1e-4, "R2": 1e9})
    rubbing = replace(moving, friction=0.1, creep=1e-5)
    less = position(moving, current) - position(rubbing, current)
    np.testing.assert_allclose(less[-50:], np.sign(current) * 0.1 / 6300.0, rtol=1e-3)


def test_weights_that_swing_pull_as_a_pendulum_of_small_angle_does():
    swinging = replace(PLAIN, angle=0.02, length=0.2, decay=1e9)
    more = (position(swinging) - position(PLAIN))[20:] * 6300.0 / WEIGHT
    # the pull is m g (1 + a^2 (p^2 - q^2 / 2)), with q = cos(w t), p = -sin(w t), behind the hand
    w = np.sqrt(9.80665 / 0.2)
    behind = 1.0 / (1.0 + 2j * w * 0.05)
    expected = 0.02**2 * (0.25 - 0.75 * np.real(behind * np.exp(2j * w * TIME[20:])))
    np.testing.assert_allclose(more, expected, atol=3e-2 * 0.02**2)


def test_charge_lengthens_late_and_a_load_adds_voltage():
    slow = Stand(STIFF | {"alpha": 1e-4, "R2": 1e9, "C": 1e9}, lag=2.0)
    late = position(slow, 1.0) - position(PLAIN)
    expected = 1e-4 * (TIME - 2.0 * (1.0 - np.exp(-TIME / 2.0)))  # of a charge that rises by 1 C/s
    np.testing.assert_allclose(late, expected, atol=1e-8)
    loaded = Stand(STIFF | {"R2": 1e9}, sensitivity=0.05)
    voltage = loaded.run(TIME, np.full(TIME.size, 0.2), np.zeros(TIME.size))["actuator.voltage"]
    np.testing.assert_allclose(voltage[50:], 0.05 * WEIGHT, rtol=1e-6)
