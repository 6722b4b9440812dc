"""Sudden changes of a residual: their sign and size, and how much worse it is where an input steps."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.jumps import (
    SETTLING_SAMPLES,
    level_shifts,
)
from tests.support.diagnosis import coloured
from tests.support.residuals import TIME, N, noise


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
    time, noise = 0.1 * np.arange(4000), coloured(0.0, 1)
    stepped = noise + 20.0 * (time >= 100.0) - 15.0 * (time >= 250.0)
    current = np.where(time >= 250.0, 1.0, -1.0)
    (shift,) = level_shifts(stepped, time, {"current": current})
    assert shift.time == pytest.approx(100.0)
    assert shift.size == pytest.approx(20.0, abs=6.0)
    assert level_shifts(noise, time, {"current": current}) == []


def test_a_gap_is_no_jump():
    """Red noise moves far while nobody looks; held against the samples on either side it has jumped."""
    time, noise = 0.1 * np.arange(3000), coloured(0.95, 3, 3000)
    there = np.ones(3000, dtype=bool)
    for start in range(200, 2900, 140):
        there[start : start + 60] = False
    drive = {"drive": np.repeat(np.arange(100) % 3, 30)[there].astype(float)}
    assert level_shifts(noise[there], time[there], drive) == []
    slipped = noise + np.where(time > 101.0, 30.0 * noise.std(), 0.0)
    (shift,) = level_shifts(slipped[there], time[there], drive)
    assert shift.time == pytest.approx(101.1)
