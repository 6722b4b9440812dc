"""The noise model against densities of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from orchestration.identify.noise.model import Noise, estimate_noise, noise_std
from orchestration.identify.noise.tails import heavy_tails


def test_a_likelihood_with_heavy_tails_is_student_s():
    values = np.random.default_rng(1).standard_t(3.0, 500)
    expected = -2.0 * student.logpdf(values, 3.0, scale=2.0).sum() - 500 * np.log(2.0 * np.pi)
    assert Noise(2.0, 3.0).deviance(values / 2.0) == pytest.approx(expected)


def test_a_likelihood_without_heavy_tails_is_gaussian():
    values = np.random.default_rng(1).standard_normal(500)
    expected = -2.0 * norm.logpdf(values, scale=0.7).sum() - 500 * np.log(2.0 * np.pi)
    assert Noise(0.7).deviance(values / 0.7) == pytest.approx(expected)


@pytest.mark.parametrize("freedom", [3.0, 5.0])
def test_heavy_tails_are_found_with_their_scale(freedom):
    shocks = 0.2 * np.random.default_rng(5).standard_t(freedom, 6000)
    noise = estimate_noise(shocks, np.ones(6000, dtype=bool))
    scale = student.fit(shocks, noise.freedom, f0=noise.freedom, floc=0.0)[2]
    assert noise.freedom == pytest.approx(freedom, rel=0.35)
    assert noise.deviation == pytest.approx(scale, rel=2e-3)


@pytest.mark.parametrize("differences", [2, 3])
def test_noise_is_told_from_steps_and_gaps(differences):
    time = 0.1 * np.arange(1000)
    noise = 0.3 * np.random.default_rng(1).standard_normal(time.size)
    signal = np.where(time > 50.0, 5.0, 0.0) + noise
    signal[200:230] = np.nan
    assert noise_std(signal, differences) == pytest.approx(0.3, rel=0.1)
    assert noise_std(np.ones(2), differences) == 0.0


def test_noise_that_is_gaussian_as_a_whole_is_gaussian_whatever_a_part_of_it_looks_like():
    """Require heavy tails of all samples as well as of a part.

    Of Gaussian quantiles in any order a part can be chosen that is heavy-tailed.
    """
    n = 4000
    residual = np.random.default_rng(3).permutation(norm.ppf((np.arange(n) + 0.5) / n))
    level = np.abs(residual)
    calm = (level < 0.3) | ((level > 1.5) & (np.random.default_rng(4).random(n) < 0.3))
    assert heavy_tails(residual[calm])[0] < 10.0
    assert estimate_noise(residual, calm).freedom == np.inf
    heavy = np.random.default_rng(5).standard_t(3.0, n)
    assert estimate_noise(heavy, np.arange(n) % 2 == 0).freedom < 5.0
