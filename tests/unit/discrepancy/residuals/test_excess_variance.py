"""How much worse a residual is where an input steps."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.excess_variance import excess_variance_at_input_steps
from orchestration.discrepancy.residuals.innovations import score_innovations
from orchestration.identify.noise.model import Noise
from orchestration.records.sampling import input_steps
from tests.support.residuals import EVERY, N, noise

WHITE = Noise(np.empty(0), 1.0)


def compared(innovation, inputs):
    return excess_variance_at_input_steps([score_innovations(innovation, EVERY, WHITE)], inputs)


def test_larger_innovations_where_an_input_steps_are_told_by_their_ranks():
    drive = {"drive": np.repeat(np.arange(N // 30) % 3, 30).astype(float)}
    where = input_steps(drive, N)
    assert where.sum() == N // 30 - 1
    quiet = noise(0.0, 3)
    loud = quiet * np.where(where, 2.0, 1.0)
    usual, excess = compared(quiet, drive), compared(loud, drive)
    assert usual.p_value > 0.001
    assert excess.ratio == pytest.approx(4.0 * usual.ratio)
    assert excess.p_value < 1e-9
    assert excess.significant
    assert compared(loud, {}).p_value == 1.0


def test_a_few_larger_innovations_are_chance():
    """Half as large again at a dozen of steps is 1 in 100 in noise of one level, whatever their
    variances' ratio.
    """
    drive = {"drive": np.repeat(np.arange(12), N // 12).astype(float)}
    where = input_steps(drive, N // 12 * 12)
    quiet = noise(0.0, 3)[: where.size]
    excess = compared(
        quiet * np.where(where, 2.0 / np.std(quiet[where]) * np.std(quiet), 1.0), drive
    )
    assert excess.ratio > 3.0
    assert 1e-6 < excess.p_value < 0.05
    assert not excess.significant
