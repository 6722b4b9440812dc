import numpy as np
import pytest
from scipy import stats

from orchestration.identify.probability import (
    chi_squared_quantile,
    ranks,
    student_log_density,
)

VALUES = np.random.default_rng(1).standard_normal(1000) * 3.0


@pytest.mark.parametrize("freedom", [2.2, 4.0, 25.0, 1000.0])
def test_student_density_is_that_of_scipy(freedom):
    expected = stats.t.logpdf(VALUES, freedom)
    np.testing.assert_allclose(student_log_density(VALUES, freedom), expected, rtol=1e-13)


@pytest.mark.parametrize("freedom", [1, 2.5, 40])
@pytest.mark.parametrize("probability", [0.001, 0.5, 0.95])
def test_quantile_is_that_of_scipy(probability, freedom):
    expected = stats.chi2.ppf(probability, freedom)
    assert chi_squared_quantile(probability, freedom) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("values", [VALUES, np.round(VALUES), np.empty(0), np.ones(3)])
def test_ranks_are_those_of_scipy(values):
    np.testing.assert_array_equal(ranks(values), stats.rankdata(values))
