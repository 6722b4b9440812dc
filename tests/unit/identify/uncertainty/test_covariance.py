"""Claims: the inverse is the inverse in any units, and coloured noise widens it.

Parameters that cannot be told apart are named.

Oracles: `numpy.linalg.inv`, statsmodels' ordinary least squares, the covariance of an AR(1) process
on paper.
"""

import numpy as np
import pytest
import statsmodels.api as sm
from scipy.linalg import toeplitz

from orchestration.identify.noise import Autoregression
from orchestration.identify.uncertainty.covariance import (
    excess_variance,
    parameter_covariance,
    sandwich_covariance,
    weighted_square,
)

RANDOM = np.random.default_rng(3)
REGRESSORS = RANDOM.standard_normal((500, 4)) @ RANDOM.standard_normal((4, 4))


@pytest.mark.parametrize(
    "units", [np.ones(4), np.array([1e-9, 1.0, 1e7, 3.0])], ids=["alike", "of many sizes"]
)
def test_standard_errors_are_those_of_least_squares(units):
    columns = REGRESSORS * units
    oracle = sm.OLS(
        RANDOM.standard_normal(500), REGRESSORS
    ).fit()  # statsmodels refuses the other units
    found = parameter_covariance(columns.T @ columns)
    assert not found.unidentifiable.any()
    assert found.standard_errors * units == pytest.approx(
        oracle.bse / np.sqrt(oracle.scale), rel=1e-8
    )


def test_what_the_data_do_not_determine_is_named_and_the_others_are_none_the_worse():
    a, b, c, _ = REGRESSORS.T
    columns = np.column_stack([a, 1e6 * a, b, np.zeros(500), c])
    found = parameter_covariance(columns.T @ columns)
    assert found.unidentifiable.tolist() == [True, True, False, True, False]
    assert np.isinf(found.standard_errors).tolist() == found.unidentifiable.tolist()
    alone = np.linalg.inv(np.array([a, b, c]) @ np.array([a, b, c]).T)
    assert found.standard_errors[[2, 4]] == pytest.approx(np.sqrt(np.diag(alone))[1:], rel=1e-9)
    # their sum is known, and half of it goes to either
    assert found.matrix[0, 0] == pytest.approx(alone[0, 0] / 4.0, rel=1e-9)
    assert not found.matrix[3].any()


@pytest.mark.parametrize("size", [0, 1])
def test_nothing_known_of_nothing(size):
    found = parameter_covariance(np.zeros((size, size)))
    assert found.matrix.shape == (size, size)
    assert found.unidentifiable.all()


@pytest.mark.parametrize("colour", [0.0, 0.9, -0.5])
def test_a_sandwich_is_the_covariance_under_coloured_noise(colour):
    n = 2000
    columns = np.column_stack([np.sin(np.arange(n) / 40.0), np.ones(n), RANDOM.standard_normal(n)])
    noise = Autoregression(np.array([colour]) if colour else np.empty(0), 0.3)
    process = 0.09 / (1.0 - colour**2) * toeplitz(colour ** np.arange(n))
    half = np.linalg.inv(columns.T @ columns) @ columns.T
    found = sandwich_covariance(
        parameter_covariance(columns.T @ columns), [columns[:800], columns[800:]], [noise, noise]
    )
    assert found.standard_errors == pytest.approx(
        np.sqrt(np.diag(half @ process @ half.T)), rel=0.03
    )


def test_sums_over_blocks_of_many_rows_are_those_over_all():
    random = np.random.default_rng(4)
    columns = random.standard_normal((150_001, 3))  # three blocks, the last of them short
    weights = random.uniform(0.5, 2.0, 150_001)
    assert weighted_square(columns, weights) == pytest.approx(
        np.einsum("ki,k,kj->ij", columns, weights, columns), rel=1e-9, abs=1e-6
    )
    errors = random.standard_normal(150_001) * (1.0 + 2.0 * np.abs(columns[:, 0]))
    robust = sm.OLS(errors, columns).fit(cov_type="HC3").bse ** 2
    bread = parameter_covariance(columns.T @ columns)
    ratio = robust / np.diag(bread.matrix)
    residual = errors - columns @ np.linalg.lstsq(columns, errors)[0]
    assert excess_variance(bread, columns, residual) == pytest.approx(ratio, rel=1e-6)


@pytest.mark.parametrize("other", [-1e-18, 0.0, 1e-320, np.inf])
def test_what_is_not_seen_or_runs_away_is_not_determined_and_nothing_warns(other):
    found = parameter_covariance(np.diag([4.0, other]))
    assert found.unidentifiable.tolist() == [False, True]
    assert found.matrix[0, 0] == pytest.approx(0.25)


def test_a_square_that_is_no_number_warns_of_nothing():
    assert weighted_square(np.full((3, 1), 1e200), np.ones(3)) == np.inf
