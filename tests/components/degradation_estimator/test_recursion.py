"""Claims: recursive least squares is the weighted batch solution, and with a preset the M-file of
appendix A3.
"""

import numpy as np
import pytest

from fmus.degradation_estimator.model import DegradationEstimator
from tests.support.estimator import LEAST_SQUARES, PERIOD, measured, square

THESIS = dict(DegradationEstimator.presets["thesis_10_hz"].values)


def test_least_squares_is_the_weighted_batch_solution(estimate):
    current = square(60.0)
    voltage = measured(current, noise=20e-3, seed=5)
    found = estimate(current, voltage, forgetting_time=30.0, **LEAST_SQUARES)
    forgetting = 0.1 ** (PERIOD / 30.0)
    for last in (100, 300, 599):
        t = np.arange(1, last + 1)
        weight = np.sqrt(forgetting ** (last - t))
        rows = np.column_stack([current[t], current[t - 1], -voltage[t - 1]]) * weight[:, None]
        start = np.eye(3) * np.sqrt(
            forgetting**last / 1e4
        )  # the initial covariance is forgotten too
        theta = np.linalg.lstsq(
            np.vstack([rows, start]), np.append(voltage[t] * weight, np.zeros(3))
        )[0]
        assert [found[name][last] for name in ("b0", "b1", "a")] == pytest.approx(theta, rel=1e-8)


def test_preset_is_the_m_file_of_appendix_a3(estimate):
    current = square(40.0, amplitude=1.3, frequency=0.25)
    voltage = measured(current, noise=2e-3, seed=6)
    # the M-file in matrices; its reset falls on multiples of 100 samples, the component's on its
    # own clock
    theta, covariance, alpha, expected = np.zeros(3), np.eye(3), 0.91, []
    for t in range(1, len(current)):
        phi = np.array([-voltage[t - 1], current[t], current[t - 1]])
        gain = covariance @ phi / (alpha + phi @ covariance @ phi)
        theta = theta + gain * (voltage[t] - phi @ theta)
        covariance = (covariance - np.outer(gain, phi @ covariance)) / alpha
        if t % 100 == 0:
            covariance = np.eye(3)
        expected.append(theta)
    found = estimate(current, voltage, **THESIS)
    table = np.column_stack([found[name][1:] for name in ("a", "b0", "b1")])
    assert np.abs(table - np.array(expected)).max() < 1e-9
