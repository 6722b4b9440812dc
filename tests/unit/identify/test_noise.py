"""The noise model against noise of known colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.identify.noise import ORDER, Noise, autoregression, estimate, noise_std, segments
from tests.support.diagnosis import coloured

EVERY = np.ones(4000, dtype=bool)


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9])
def test_noise_of_a_known_colour_is_found_and_whitened(colour):
    noise = estimate(coloured(colour, 1), EVERY)
    assert noise.deviation == pytest.approx(1.0, rel=0.05)
    assert sum(noise.coefficients) == pytest.approx(colour, abs=0.08)
    white = noise.whiten(coloured(colour, 2), EVERY)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.06


def test_a_filter_does_not_reach_over_a_gap():
    present = EVERY.copy()
    present[1000:1003] = False
    assert segments(present) == [(0, 1000), (1000, 3997)]
    jump = np.where(np.arange(3997) < 1000, 0.0, 5.0)
    white = Noise(np.array([1.0]), 1.0).whiten(jump, present)
    assert white.size == 3997 - 2 * ORDER
    assert np.all(white == 0.0)


@pytest.mark.parametrize(
    ("coefficients", "order"), [([0.9], 1), ([1.2, -0.5], 2), ([], 0), ([0.4, 0.2, -0.3], 3)], ids=str
)
def test_noise_models_are_recognised(coefficients, order):
    noise = lfilter([0.3], [1.0, *(-c for c in coefficients)], np.random.default_rng(4).standard_normal(20000))
    found, variance = autoregression(noise)
    assert len(found) == order
    assert found == pytest.approx(coefficients, abs=0.03)
    assert variance == pytest.approx(0.09, rel=0.03)


@pytest.mark.parametrize("differences", [2, 3])
def test_noise_is_told_from_steps_and_gaps(differences):
    time = 0.1 * np.arange(1000)
    noise = 0.3 * np.random.default_rng(1).standard_normal(time.size)
    signal = np.where(time > 50.0, 5.0, 0.0) + noise
    signal[200:230] = np.nan
    assert noise_std(signal, differences) == pytest.approx(0.3, rel=0.1)
    assert noise_std(np.ones(2), differences) == 0.0
