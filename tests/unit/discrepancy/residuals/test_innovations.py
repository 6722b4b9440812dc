"""Claims: innovations are the driving noise, their local level follows it, and scores are
normal.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from orchestration.discrepancy.residuals.innovations import (
    local_level,
    normal_scores,
    robust_power,
    score_innovations,
)
from orchestration.identify.noise.model import Noise
from tests.support.residuals import EVERY, N, noise

AR1 = Noise(np.array([0.9]), 1.0)


def test_innovations_are_what_drives_the_noise():
    white = np.random.default_rng(4).standard_normal(N + 300)
    innovations = score_innovations(noise(0.9, 4), EVERY, AR1)
    assert innovations.raw[1:] == pytest.approx(white[301:])


def test_scores_are_quantiles_at_the_ranks():
    values = np.array([30.0, -1.0, 2.0])
    assert normal_scores(values) == pytest.approx(norm.ppf([0.75, 0.25, 0.5]))
    assert normal_scores(values) == pytest.approx(normal_scores(np.sign(values) * values**2))


def test_the_level_follows_noise_that_grows_and_is_one_on_average():
    growing = np.linspace(1.0, 3.0, N)
    level = local_level(growing * noise(0.0, 2))
    assert level.mean() == pytest.approx(1.0, abs=0.01)
    assert level == pytest.approx(growing / growing.mean(), rel=0.4)


def test_a_residual_is_bounded_where_one_innovation_is_far_out():
    residual = noise(0.9, 1)
    shocked = residual + np.where(np.arange(N) >= 1000, 50.0 * 0.9 ** (np.arange(N) - 1000.0), 0.0)
    bounded = score_innovations(shocked, EVERY, AR1).bounded(shocked, EVERY, AR1)
    assert np.abs(bounded[1000] - residual[1000]) < 10.0
    assert bounded[:1000] == pytest.approx(shocked[:1000], abs=0.5)


def test_power_is_the_mean_square_but_for_what_is_far_out():
    white = noise(0.0, 3)
    assert robust_power(white) == pytest.approx(np.mean(white**2), rel=0.01)
    assert robust_power(np.append(white, 1e6)) == pytest.approx(np.mean(white**2), rel=0.02)
    assert robust_power(np.empty(0)) == 0.0
