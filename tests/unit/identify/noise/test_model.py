"""The noise model against noise of known colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import multivariate_normal, norm
from scipy.stats import t as student

from orchestration.identify.noise.autoregression import segments
from orchestration.identify.noise.model import Noise, estimate_noise, noise_std
from orchestration.identify.noise.tails import heavy_tails
from tests.support.diagnosis import coloured

EVERY = np.ones(4000, dtype=bool)


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9])
def test_noise_of_a_known_colour_is_found_and_whitened(colour):
    noise = estimate_noise(coloured(colour, 1), EVERY)
    assert noise.deviation == pytest.approx(1.0, rel=0.05)
    assert sum(noise.coefficients) == pytest.approx(colour, abs=0.08)
    white = noise.whiten(coloured(colour, 2), EVERY)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.06


def test_a_filter_does_not_reach_over_a_gap():
    present = EVERY.copy()
    present[1000:1003] = False
    assert segments(present) == [(0, 1000), (1000, 3997)]
    jump = np.where(np.arange(3997) < 1000, 0.0, 5.0)
    white = Noise(np.array([0.5]), 1.0).whiten(jump, present)
    assert white.size == 3997
    assert np.all(white[:1000] == 0.0)
    np.testing.assert_allclose(white[1000], 5.0 * np.sqrt(1.0 - 0.5**2))
    np.testing.assert_allclose(white[1001:], 2.5)


@pytest.mark.parametrize(
    "coefficients", [[], [0.9], [-0.6], [1.2, -0.5], [0.4, 0.2, -0.3]], ids=str
)
@pytest.mark.parametrize("gaps", [[], [17], [0, 1, 2, 20, 22, 39]], ids=str)
def test_the_likelihood_is_exact_from_the_first_sample_on(coefficients, gaps):
    """Compare with the density of a Gaussian vector with the covariance of the process.

    Every stretch is one by itself.
    """
    present, random = np.ones(40, dtype=bool), np.random.default_rng(3)
    present[gaps] = False
    values = random.standard_normal(int(present.sum()))
    noise = Noise(np.array(coefficients), 0.7)
    response = lfilter([0.7], [1.0, *(-c for c in coefficients)], np.eye(1, 5000)[0])
    autocovariance = np.array([response[: 5000 - k] @ response[k:] for k in range(40)])
    expected = 0.0
    for a, b in segments(present):
        covariance = toeplitz(autocovariance[: b - a])
        expected -= 2.0 * multivariate_normal(np.zeros(b - a), covariance).logpdf(values[a:b])
    expected -= len(values) * np.log(2.0 * np.pi)
    assert noise.deviance(noise.whiten(values, present), present) == pytest.approx(
        expected, rel=1e-9
    )


def test_a_likelihood_with_heavy_tails_is_student_s():
    values, everywhere = np.random.default_rng(1).standard_t(3.0, 500), np.ones(500, dtype=bool)
    noise = Noise(np.empty(0), 2.0, 3.0)
    expected = -2.0 * student.logpdf(values, 3.0, scale=2.0).sum() - 500 * np.log(2.0 * np.pi)
    assert noise.deviance(noise.whiten(values, everywhere), everywhere) == pytest.approx(expected)


@pytest.mark.parametrize(("freedom", "colour"), [(3.0, 0.0), (3.0, 0.8), (5.0, 0.0)])
def test_heavy_tails_are_found_beneath_a_colour(freedom, colour):
    shocks = np.random.default_rng(5).standard_t(freedom, 6000)
    noise = estimate_noise(
        lfilter([1.0], [1.0, -colour], shocks),
        np.ones(6000, dtype=bool),
        undisturbed=np.ones(6000, dtype=bool),
    )
    assert noise.freedom == pytest.approx(freedom, rel=0.35)
    assert noise.deviation == pytest.approx(1.0, rel=0.06)
    assert sum(noise.coefficients) == pytest.approx(colour, abs=0.05)


@pytest.mark.parametrize("known", [3.0, 10.0, np.inf])
def test_a_freedom_that_is_known_is_kept_and_the_scale_is_the_likeliest(known):
    shocks, everywhere = np.random.default_rng(5).standard_t(4.0, 3000), np.ones(3000, dtype=bool)
    noise = estimate_noise(shocks, everywhere, 0, everywhere, known)
    scale = np.std(shocks) if known == np.inf else student.fit(shocks, known, f0=known, floc=0.0)[2]
    assert noise.freedom == known
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
    everywhere = np.ones(n, dtype=bool)
    assert estimate_noise(residual, everywhere, 0, calm).freedom == np.inf
    heavy = np.random.default_rng(5).standard_t(3.0, n)
    assert estimate_noise(heavy, everywhere, 0, np.arange(n) % 2 == 0).freedom < 5.0


def test_a_colour_that_is_known_is_kept_and_the_deviation_is_the_likeliest():
    values = np.random.default_rng(8).standard_normal(500)
    found = estimate_noise(values, np.ones(500, dtype=bool), colour=np.array([0.8]))
    expected = np.append(values[0] * np.sqrt(1.0 - 0.8**2), values[1:] - 0.8 * values[:-1])
    assert found.coefficients == pytest.approx([0.8])
    assert found.deviation == pytest.approx(np.sqrt(np.mean(expected**2)))
