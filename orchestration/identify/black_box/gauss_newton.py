"""Least squares of prediction errors among stable models, by the search that all fits have."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify import fitting

_TRIALS = 100
_ENOUGH = 1e-9


class ResidualProblem(Protocol):
    """Prediction errors as functions of parameters."""

    def errors(self, theta: Array, /) -> Array:
        """Return the prediction errors (n,); raise UserError if the predictor is not stable."""

    def jacobian(self, theta: Array, /) -> Array:
        """Return the derivatives (n, p) of the prediction errors by the parameters."""


class GaussNewtonMinimum(NamedTuple):
    """The point where a search ended.

    Attributes
    ----------
    theta : ndarray, shape (p,)
    cost : float
        Sum of squared prediction errors.
    converged : bool
        Whether a step would gain no more; else the trial points were used up.
    """

    theta: Array
    cost: float
    converged: bool


def minimise(
    problem: ResidualProblem, theta: Array, trials: int = _TRIALS, enough: float = _ENOUGH
) -> GaussNewtonMinimum:
    """Minimise the sum of squared prediction errors among stable models.

    Parameters
    ----------
    problem : ResidualProblem
    theta : ndarray, shape (p,)
        Where to start; the predictor is stable there.
    trials : int
        Points that are tried, at most.
    enough : float
        Fall of the cost, relative to it, that ends the search.

    Returns
    -------
    GaussNewtonMinimum
    """
    size = (
        float(np.linalg.norm(problem.errors(theta))) or 1.0
    )  # so that no unit decides when a search ends
    ends = np.full_like(theta, np.inf)
    end = fitting.minimise(
        lambda at: problem.errors(at) / size,
        lambda at: problem.jacobian(at) / size,
        theta,
        -ends,
        ends,
        enough,
        trials=trials,
    )
    e = problem.errors(end.q)
    return GaussNewtonMinimum(end.q, float(e @ e), end.converged)
