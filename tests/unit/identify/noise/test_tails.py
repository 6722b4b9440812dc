"""Heavy tails against SciPy's t distribution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from orchestration.identify.noise import tails
from orchestration.identify.noise.tails import heavy_tails


def test_gaussian_noise_has_no_heavy_tails():
    random = np.random.default_rng(7)
    found = [heavy_tails(random.standard_normal(800))[0] for _ in range(400)]
    assert np.mean(np.isfinite(found)) < 0.01
    assert np.isinf(
        heavy_tails(np.round(3.0 * random.standard_normal(800)))[0]
    )  # the grid of a converter is no tail


def test_weights_are_those_of_the_score():
    """The slope of the logarithm of the density, by differences, is the weighted sample."""
    r = np.linspace(-9.0, 9.0, 41)
    slope = (student.logpdf(r + 1e-6, 4.0) - student.logpdf(r - 1e-6, 4.0)) / 2e-6
    np.testing.assert_allclose(tails.weights(r, 4.0) * r, -slope, atol=1e-7)
    root, steepness = tails.deviance_roots(r, 4.0)
    np.testing.assert_allclose(
        root**2, -2.0 * (student.logpdf(r, 4.0) - student.logpdf(0.0, 4.0)), atol=1e-12
    )
    differences = (
        tails.deviance_roots(r + 1e-6, 4.0)[0] - tails.deviance_roots(r - 1e-6, 4.0)[0]
    ) / 2e-6
    np.testing.assert_allclose(steepness, differences, atol=1e-7)
    bend = (
        student.logpdf(r + 1e-4, 4.0) - 2.0 * student.logpdf(r, 4.0) + student.logpdf(r - 1e-4, 4.0)
    ) / 1e-8
    np.testing.assert_allclose(tails.curvature(r, 4.0), -bend, atol=1e-6)


def test_likelihoods_and_scales_are_those_of_scipy():
    """The scale that is found has the highest likelihood of all near it, and SciPy's value."""
    sample = student.rvs(4.0, scale=0.3, size=3000, random_state=11)
    freedoms = np.array([3.0, 7.0])
    likelihoods, scales = tails._fit_scales(sample, freedoms)
    for freedom, likelihood, scale in zip(freedoms, likelihoods, scales, strict=True):
        expected = student.logpdf(sample, freedom, scale=scale).sum()
        np.testing.assert_allclose(likelihood, expected, rtol=1e-10)
        around = [student.logpdf(sample, freedom, scale=scale * r).sum() for r in (0.95, 1.05)]
        assert likelihood > max(around)
    free = student.fit(sample, floc=0.0)
    assert heavy_tails(sample)[0] in (4.0, 5.0, 3.0)
    np.testing.assert_allclose(heavy_tails(sample, 4.0)[1], free[2], rtol=0.05)


@pytest.mark.parametrize("freedom", [2.2, 4.0, 25.0, 1000.0])
def test_student_density_is_that_of_scipy(freedom):
    values = 3.0 * np.random.default_rng(1).standard_normal(1000)
    expected = student.logpdf(values, freedom)
    np.testing.assert_allclose(tails.student_log_density(values, freedom), expected, rtol=1e-13)
