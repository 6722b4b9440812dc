"""Single samples far out, and what a converter does that is none of them."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.innovations import innovations_of
from orchestration.discrepancy.residuals.outliers import outlying
from orchestration.identify.noise.model import Noise

STEP = 1.0
COUNT = 3000
EVERY = np.ones(COUNT, dtype=bool)


def rounded(seed):
    """Residuals of a converter whose input moves for a third of the record, and then comes to rest."""
    random, k = np.random.default_rng(seed), np.arange(COUNT)
    moving = np.where(k < COUNT // 3, 30.0 * np.sin(0.1 * k), 0.2 * np.exp(-k / COUNT))
    noisy = moving + 0.2 * STEP * random.standard_normal(COUNT)
    return STEP * np.round(noisy / STEP) - moving


@pytest.mark.parametrize("seed", range(5))
def test_a_step_of_the_converter_is_no_outlier(seed):
    residual = rounded(seed)
    assert (
        np.abs(np.diff(residual)) < 1e-3
    ).mean() > 0.5  # at rest nothing is seen but a step now and then
    assert outlying(residual, {}, STEP).sum() == 0
    assert outlying(residual, {}).sum() > 0
    noise = Noise(np.empty(0), float(np.std(residual)))
    assert (
        innovations_of(residual, EVERY, noise, step=STEP).outliers
        < 3
        < innovations_of(residual, EVERY, noise).outliers
    )


def test_a_sample_beyond_the_steps_is_one():
    residual = rounded(1)
    residual[2500] = 12.0 * STEP
    assert np.flatnonzero(outlying(residual, {}, STEP)).tolist() == [2500]
