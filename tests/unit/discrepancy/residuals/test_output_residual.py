"""Claim: rounding leaves no larger mean error than is allowed for."""

from __future__ import annotations

import numpy as np

from orchestration.discrepancy.residuals.output_residual import rounding_error


def test_the_error_of_rounding_is_within_its_bound():
    """The mean error of a converter over all places of a signal within a step, seen directly."""
    place = np.linspace(0.0, 1.0, 41)
    for deviation in (0.1, 0.2, 0.3):
        drawn = deviation * np.random.default_rng(1).standard_normal((200_000, 1))
        errors = np.round(place + drawn) - place
        largest = np.abs(errors.mean(axis=0)).max()
        after = float(np.sqrt(deviation**2 + 1.0 / 12.0))
        assert largest < 1.05 * rounding_error(1.0, after)
    assert rounding_error(1.0, 0.0) == 0.5
    assert rounding_error(0.0, 1.0) == 0.0
    assert rounding_error(np.float64(1e-200), np.float64(1e200)) < 1e-270
