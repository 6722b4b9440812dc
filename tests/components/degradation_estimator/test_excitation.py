"""Claims: reversals are turning points beyond the swing, their period is that of the current, and
nothing is estimated without them.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.degradation_estimator.model import DegradationEstimator
from fmus.kit.integrate import Integrator
from tests.support.estimator import OMEGA, PERIOD, R1, R2, C, impedance, measured, square


def test_nothing_moves_while_the_current_rests(estimate):
    current = np.concatenate([square(300.0), np.zeros(36000), square(300.0)])
    voltage = measured(current, 20e-3, seed=3)
    found = estimate(current, voltage)
    kept = (
        "b0",
        "b1",
        "a",
        "p[1,1]",
        "p[2,3]",
        "p[3,3]",
        "auxiliary_a",
        "R1",
        "R2",
        "C",
        "excited_time",
    )
    resting = slice(3000 + 200, 3000 + 36000)  # the timeout is 20 s
    for name in kept:
        assert np.ptp(found[name][resting]) == 0.0, name
    assert np.all(found["estimate_valid"][resting] == 1.0)
    z = found["impedance"]
    assert z[2999:] == pytest.approx(impedance(R1, R2, C), rel=0.015)


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_constant_current_gives_no_estimate(estimate, level):
    current = np.full(20000, level)
    found = estimate(current, measured(current, 20e-3))
    assert not found["estimate_valid"].any()
    assert np.all(found["voltage_limit"] == 1.5)
    assert all(np.all(np.isfinite(values)) for values in found.values())


@settings(max_examples=30)
@given(st.lists(st.floats(-1.3, 1.3), min_size=2, max_size=60))
def test_reversals_are_turning_points_beyond_the_swing(values):
    model = DegradationEstimator(minimum_swing=0.3)
    run, count, direction, extreme = Integrator(model), 0, 0, 0.0
    for k, value in enumerate(values):
        model.current = value
        run.advance(k * PERIOD, PERIOD)
        if direction == 0:
            if abs(value) > 0.3:
                direction, extreme, count = (1 if value > 0 else -1), value, 1
        elif (value - extreme) * direction > 0:
            extreme = value
        elif abs(value - extreme) > 0.3:
            direction, extreme, count = -direction, value, count + 1
        assert model.reversals == count


def alternating(durations, amplitude=0.9):
    """Levels of alternating sign, each held for a number of samples."""
    return np.concatenate([amplitude * (-1) ** k * np.ones(n) for k, n in enumerate(durations)])


@settings(max_examples=20)
@given(durations=st.lists(st.integers(1, 150), min_size=5, max_size=40))
def test_tracked_frequency_is_that_of_reversals_of_equal_sign(estimate, durations):
    """Against the switching times themselves; the first half period starts with the first movement
    and is left out.
    """
    tracked = estimate(alternating(durations), np.zeros(sum(durations)))[
        "tracked_angular_frequency"
    ]
    switched = PERIOD * np.cumsum(durations)[:-1]
    period, expected = None, OMEGA
    for before, last, now in zip(switched, switched[1:], switched[2:], strict=False):
        share = 1.0 if period is None else -math.expm1(-(now - last) / 30.0)
        period = (period or 0.0) + share * (now - before - (period or 0.0))
        expected = 2 * math.pi / period
    assert tracked[-1] == pytest.approx(expected, rel=1e-9)
    assert np.all(tracked[: round(switched[2] / PERIOD)] == OMEGA)


@pytest.mark.parametrize("frequency", [0.03, 0.1, 0.17, 0.2, 0.5, 1.3])
@pytest.mark.parametrize("shape", ["square", "sine", "a quarter of the time", "offset sine"])
def test_tracked_frequency_is_the_fundamental_whatever_the_shape(estimate, frequency, shape):
    """A sample period is the resolution of a reversal; smoothed over 30 s it is 1 % at worst."""
    phase = frequency * PERIOD * np.arange(4000)
    current = {
        "square": np.where(phase % 1 < 0.5, 0.9, -0.9),
        "sine": 0.9 * np.sin(2 * np.pi * phase),
        "a quarter of the time": np.where(phase % 1 < 0.25, 1.2, 0.0),
        "offset sine": 1 + np.sin(2 * np.pi * phase),
    }[shape]
    found = estimate(current, measured(current), excitation_timeout=40.0)[
        "tracked_angular_frequency"
    ]
    assert found[2000:] == pytest.approx(2 * np.pi * frequency, rel=0.01)


def test_tracked_frequency_follows_a_change_and_is_held_while_the_current_rests(estimate):
    """From 0.2 Hz to 0.1 Hz: the period is a low-pass of 30 s; a rest in between does not count as
    a period.
    """
    slow = square(300.0, frequency=0.1)
    current = np.concatenate([square(200.0), slow, np.zeros(2000), slow])
    period = 2 * np.pi / estimate(current, measured(current))["tracked_angular_frequency"]
    assert period[1999] == pytest.approx(5.0, rel=1e-9)
    left = math.exp(-5.0 / 30.0)
    n = np.arange(1, 60)  # half periods of 5 s since the change; the first follows one of 2.5 s
    assert period[2000 + 50 * n] == pytest.approx(
        10.0 - (2.5 + 2.5 * left) * left ** (n - 1), rel=1e-9
    )
    assert np.ptp(period[5060:7000]) == 0.0
    assert period[4999:] == pytest.approx(10.0, rel=1e-3)


def test_dips_of_the_protection_are_no_reversals_if_the_swing_says_so(estimate):
    current = square(600.0, amplitude=1.3, frequency=0.1)
    current[np.arange(6000) % 50 // 5 == 6] = 0.0
    voltage = measured(current)
    swings = {"minimum_swing": 2.0, "turning_current_start": -1.3}
    aware, naive = (
        estimate(current, voltage, **o)["tracked_angular_frequency"][-1] for o in (swings, {})
    )
    assert aware == pytest.approx(0.2 * math.pi, rel=1e-9)
    assert naive > 1.5 * aware
