"""Claims: single samples far out and lasting jumps of a residual are found, with sign and size.

What a converter does, what a gap hides, and what happens at a step of an input is neither.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.innovations import score_innovations
from orchestration.discrepancy.residuals.outliers import (
    SETTLING_SAMPLES,
    find_outliers,
    interpolate_over,
    level_shifts,
)
from orchestration.identify.noise.model import Noise
from tests.support.diagnosis import coloured
from tests.support.residuals import TIME, N, noise

STEP = 1.0
COUNT = 3000
EVERY = np.ones(COUNT, dtype=bool)


def rounded(seed):
    """Residuals of a converter whose input moves for a third of the record, and then comes to
    rest.
    """
    random = np.random.default_rng(seed)
    k = np.arange(COUNT)
    moving = np.where(k < COUNT // 3, 30.0 * np.sin(0.1 * k), 0.2 * np.exp(-k / COUNT))
    noisy = moving + 0.2 * STEP * random.standard_normal(COUNT)
    return STEP * np.round(noisy / STEP) - moving


@pytest.mark.parametrize("seed", range(5))
def test_a_step_of_the_converter_is_no_outlier(seed):
    residual = rounded(seed)
    assert (
        np.abs(np.diff(residual)) < 1e-3
    ).mean() > 0.5  # at rest nothing is seen but a step now and then
    assert find_outliers(residual, {}, STEP).sum() == 0
    assert find_outliers(residual, {}).sum() > 0
    white = Noise(np.empty(0), float(np.std(residual)))
    assert (
        score_innovations(residual, EVERY, white, step=STEP).outliers
        < 3
        < score_innovations(residual, EVERY, white).outliers
    )


def test_a_sample_beyond_the_steps_is_one():
    residual = rounded(1)
    residual[2500] = 12.0 * STEP
    assert np.flatnonzero(find_outliers(residual, {}, STEP)).tolist() == [2500]


def test_outliers_are_interpolated_over():
    residual = np.array([1.0, 2.0, 90.0, 4.0, 5.0])
    straight = interpolate_over(residual, residual > 50.0)
    assert straight == pytest.approx([1.0, 2.0, 3.0, 4.0, 5.0])


@pytest.mark.parametrize("size", [20.0, -20.0])
def test_a_jump_has_the_sign_of_the_step_of_the_residual(size):
    (shift,) = level_shifts(noise(0.0, 1) + np.where(TIME >= 100.0, size, 0.0), TIME, {})
    assert shift.time == pytest.approx(100.0)
    assert shift.size == pytest.approx(size, abs=6.0)


@pytest.mark.parametrize("late", [-1, 0, SETTLING_SAMPLES - 1])
def test_a_jump_at_a_step_of_an_input_is_the_models(late):
    residual = noise(0.0, 1) + np.where(np.arange(N) >= 1000 + late, 20.0, 0.0)
    assert (
        level_shifts(residual, TIME, {"current": np.where(np.arange(N) >= 1000, 1.0, -1.0)}) == []
    )


def test_a_residual_that_never_moves_has_no_jump():
    assert level_shifts(np.zeros(N), TIME, {}) == []


def test_jumps_are_found_where_no_input_jumps():
    time = 0.1 * np.arange(4000)
    white = coloured(0.0, 1)
    stepped = white + 20.0 * (time >= 100.0) - 15.0 * (time >= 250.0)
    current = np.where(time >= 250.0, 1.0, -1.0)
    (shift,) = level_shifts(stepped, time, {"current": current})
    assert shift.time == pytest.approx(100.0)
    assert shift.size == pytest.approx(20.0, abs=6.0)
    assert level_shifts(white, time, {"current": current}) == []


def test_a_gap_is_no_jump():
    """Red noise moves far while nothing is measured, which is a jump between the samples on either
    side.
    """
    time = 0.1 * np.arange(3000)
    red = coloured(0.95, 3, 3000)
    there = np.ones(3000, dtype=bool)
    for start in range(200, 2900, 140):
        there[start : start + 60] = False
    drive = {"drive": np.repeat(np.arange(100) % 3, 30)[there].astype(float)}
    assert level_shifts(red[there], time[there], drive) == []
    slipped = red + np.where(time > 101.0, 30.0 * red.std(), 0.0)
    (shift,) = level_shifts(slipped[there], time[there], drive)
    assert shift.time == pytest.approx(101.1)
