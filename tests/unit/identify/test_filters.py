import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.identify.filters import autoregression

COLUMNS = np.random.default_rng(1).standard_normal((300, 3))
VALUES = [COLUMNS, COLUMNS[::-1], COLUMNS[:, 0], COLUMNS[:2], COLUMNS[:1, 0]]
POLYNOMIALS = [[1.0], [1.0, -0.9], [1.0, -1.2, 0.5, -0.1]]


@pytest.mark.parametrize("values", VALUES)
@pytest.mark.parametrize("polynomial", POLYNOMIALS)
def test_the_filter_is_that_of_scipy(values, polynomial):
    filtered = autoregression(polynomial, values)
    expected = lfilter([1.0], polynomial, values, axis=0)
    np.testing.assert_allclose(filtered, expected, rtol=1e-12, atol=1e-14)


def test_a_pole_may_be_complex():
    pole = 0.7 + 0.3j
    expected = lfilter([1.0], [1.0, -pole], COLUMNS, axis=0)
    np.testing.assert_allclose(autoregression([1.0, -pole], COLUMNS), expected, rtol=1e-12)


@pytest.mark.parametrize("shape", [(0,), (0, 3), (5, 0)])
def test_nothing_stays_nothing(shape):
    assert autoregression([1.0, -0.5], np.empty(shape)).shape == shape
