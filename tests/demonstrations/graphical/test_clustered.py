"""Claims: each stretch of a record counts once, whatever its noise.

Oracles: the definition of Bell and McCaffrey, and the spread of estimates over many draws.
"""

import numpy as np
import pytest
from scipy.linalg import fractional_matrix_power

from demonstrations.graphical.clustered import clustered_covariance
from orchestration.identify.uncertainty import parameter_covariance

RANDOM = np.random.default_rng(3)
REGRESSORS = RANDOM.standard_normal((500, 4)) @ RANDOM.standard_normal((4, 4))
STRETCHES = np.arange(500) // 50


def test_stretches_without_a_common_error_are_those_of_least_squares_on_average():
    """Compare with the definition (Bell and McCaffrey).

    It is every stretch's residual times the root of what the fit took of it.
    """
    bread = parameter_covariance(REGRESSORS.T @ REGRESSORS)
    residual = np.random.default_rng(4).standard_normal(500)
    middle = np.zeros((4, 4))
    for k in range(10):
        x = REGRESSORS[k * 50 : (k + 1) * 50]
        more = fractional_matrix_power(
            np.eye(50) - x @ np.linalg.inv(REGRESSORS.T @ REGRESSORS) @ x.T, -0.5
        ).real
        score = x.T @ more @ residual[k * 50 : (k + 1) * 50]
        middle += np.outer(score, score)
    found = clustered_covariance(bread, REGRESSORS, residual, STRETCHES).matrix
    assert found == pytest.approx(bread.matrix @ middle @ bread.matrix, rel=1e-8)


def test_an_error_that_lasts_over_a_stretch_counts_once():
    """Compare with the spread of estimates over 400 draws.

    Regressors and errors are the same over a stretch.
    """
    random = np.random.default_rng(5)
    x = np.repeat(random.standard_normal((10, 2)), 50, axis=0)
    bread = parameter_covariance(x.T @ x)
    estimates, told = [], []
    for _ in range(400):
        y = np.repeat(random.standard_normal(10), 50)
        estimates.append(bread.matrix @ x.T @ y)
        told.append(
            np.diag(clustered_covariance(bread, x, y - x @ estimates[-1], STRETCHES).matrix)
        )
    assert np.mean(told, axis=0) == pytest.approx(np.var(estimates, axis=0), rel=0.15)
    assert np.all(np.var(estimates, axis=0) > 20.0 * np.diag(bread.matrix)), (
        "50 samples of one error are not 50 errors"
    )
