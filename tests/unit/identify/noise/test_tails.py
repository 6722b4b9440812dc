"""Heavy tails against SciPy's t distribution."""

from __future__ import annotations

import numpy as np
from scipy.stats import t as student

from orchestration.identify.noise import tails
from orchestration.identify.noise.model import Noise
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
    noise, r = Noise(np.empty(0), 1.0, 4.0), np.linspace(-9.0, 9.0, 41)
    slope = (student.logpdf(r + 1e-6, 4.0) - student.logpdf(r - 1e-6, 4.0)) / 2e-6
    np.testing.assert_allclose(noise.weights(r) * r, -slope, atol=1e-7)
    root, steepness = tails.rooted(r, 4.0)
    np.testing.assert_allclose(
        root**2, -2.0 * (student.logpdf(r, 4.0) - student.logpdf(0.0, 4.0)), atol=1e-12
    )
    differences = (tails.rooted(r + 1e-6, 4.0)[0] - tails.rooted(r - 1e-6, 4.0)[0]) / 2e-6
    np.testing.assert_allclose(steepness, differences, atol=1e-7)
    bend = (
        student.logpdf(r + 1e-4, 4.0) - 2.0 * student.logpdf(r, 4.0) + student.logpdf(r - 1e-4, 4.0)
    ) / 1e-8
    np.testing.assert_allclose(tails.curvature(r, 4.0), -bend, atol=1e-6)
