"""Claims: the order and the coefficients of noise are recognised."""

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.identify.noise import autoregression


@pytest.mark.parametrize(
    ("coefficients", "order"), [([0.9], 1), ([1.2, -0.5], 2), ([], 0), ([0.4, 0.2, -0.3], 3)], ids=str
)
def test_noise_models_are_recognised(coefficients, order):
    noise = lfilter([0.3], [1.0, *(-c for c in coefficients)], np.random.default_rng(4).standard_normal(20000))
    found, variance = autoregression(noise)
    assert len(found) == order
    assert found == pytest.approx(coefficients, abs=0.03)
    assert variance == pytest.approx(0.09, rel=0.03)
