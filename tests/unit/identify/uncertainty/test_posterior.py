"""Claims: samples are of the posterior, and say how sure they are.

Oracle: the Gaussian of a linear model with a Gaussian prior; R-hat of chains on paper.
"""

import pickle

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.identify.uncertainty.posterior import split_r_hat
from tests.support.linear_fits import SIGMA, columns, fitted, noisy, plane_data


@pytest.mark.slow
def test_a_posterior_is_the_gaussian_of_a_linear_model():
    x = columns()
    y = noisy(x, [2.0, -1.0, 0.5])
    fit = fitted([plane_data(x, y)], priors={"a": (2.5, 0.05)}, noise={"y": SIGMA})
    covariance = np.linalg.inv(x.T @ x / SIGMA**2 + np.diag([1 / 0.05**2, 0, 0]))
    mean = covariance @ (x.T @ y / SIGMA**2 + [2.5 / 0.05**2, 0, 0])
    posterior = fit.posterior(1000, seed=1)
    drawn = np.array([*posterior.samples.values()])
    error = np.sqrt(np.diag(covariance) / posterior.effective)
    assert np.all(np.abs(drawn.mean(axis=1) - mean) < 4 * error)
    assert np.cov(drawn) == pytest.approx(covariance, abs=0.12 * np.diag(covariance).max())
    assert max(posterior.r_hat.values()) < 1.05
    assert posterior.warnings == ()


def test_r_hat_tells_chains_that_stay_apart():
    random = np.random.default_rng(0)
    together = random.normal(size=(500, 4, 1))
    assert split_r_hat(together) == pytest.approx([1.0], abs=0.02)
    apart = together + 3.0 * np.arange(4)[:, np.newaxis]
    assert split_r_hat(apart)[0] > 2.0


def test_a_posterior_of_a_copy_or_of_nothing_determined_is_refused():
    x = np.column_stack([columns()[:, 0], np.zeros(60), np.ones(60)])
    fit = fitted([plane_data(x, noisy(x, [2.0, -1.0, 0.5]))])
    with pytest.raises(UserError, match="the record does not determine b"):
        fit.posterior(10)
    x = columns()
    fit = fitted([plane_data(x, noisy(x, [2.0, -1.0, 0.5]))])
    with pytest.raises(UserError, match="0 samples with seed 0"):
        fit.posterior(0)
    with pytest.raises(UserError, match="this is a copy of a fit"):
        pickle.loads(pickle.dumps(fit)).posterior(10)
