"""Least squares of prediction errors among stable models, by damped Gauss-Newton steps.

The damping is that of Levenberg and Marquardt. Sources: Ljung, System Identification, section 10.2;
Nocedal and Wright, Numerical Optimization, section 10.3.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.polynomials import solved, triangle

_ITERATIONS = 100
_ENOUGH = 1e-9
# singular value, relative to the largest, that is zero: free responses of equal paths are collinear
_UNDETERMINED = 1e-12
_FIRST_DAMPING = 1e-3  # as Marquardt's
_LEAST_DAMPING = 1e-12  # below it there is none
_MOST_DAMPING = 1e12  # beyond it no step downhill is to be expected
# Shares of the promised fall of the cost above which damping is lowered, and below which it is
# raised (Nocedal and Wright, algorithm 4.1), and by which factors; more after a step that failed.
_GOOD = 0.75
_POOR = 0.25
_LOWERED = 0.1
_RAISED = 4.0
_FAILED = 8.0


class ResidualProblem(Protocol):
    """Prediction errors as functions of parameters, some of which are not admissible."""

    def errors(self, theta: Array, /) -> Array:
        """Return the prediction errors (n,)."""

    def jacobian(self, theta: Array, /) -> Array:
        """Return their derivatives (n, p)."""

    def admissible(self, theta: Array, /) -> bool:
        """Tell whether the predictor is stable."""


class GaussNewtonMinimum(NamedTuple):
    """The point where a search ended.

    Attributes
    ----------
    theta : ndarray, shape (p,)
    cost : float
        Sum of squared prediction errors.
    converged : bool
        Whether a step would gain no more; else the iterations were used up.
    """

    theta: Array
    cost: float
    converged: bool


class _Point(NamedTuple):
    """Parameters with their prediction errors and the sum of squares."""

    theta: Array
    errors: Array
    cost: float


class _Linearised(NamedTuple):
    """Prediction errors linearised about a point, their many rows reduced by QR to a triangle.

    Attributes
    ----------
    slopes : ndarray, shape (p, p)
        Derivatives, every column scaled to length one.
    errors : ndarray, shape (p,)
    scale : ndarray, shape (p,)
        Length of every column before.
    """

    slopes: Array
    errors: Array
    scale: Array

    def step(self, damping: float) -> Array:
        """Return the damped Gauss-Newton step (p,) in scaled parameters."""
        count = self.slopes.shape[1]
        rows = np.vstack([self.slopes, np.sqrt(damping) * np.eye(count)])
        return solved(rows, -np.concatenate([self.errors, np.zeros(count)]))

    def promised(self, step: Array) -> float:
        """Return the fall of the cost with a step in scaled parameters, if errors were linear."""
        after = self.errors + self.slopes @ step
        return float(self.errors @ self.errors) - float(after @ after)

    @property
    def most(self) -> float:
        """The fall of the cost with a whole step, if errors were linear."""
        whole = np.linalg.lstsq(self.slopes, -self.errors, rcond=_UNDETERMINED)[0]
        return self.promised(np.asarray(whole, dtype=float))


def minimise(
    problem: ResidualProblem,
    theta: Array,
    iterations: int = _ITERATIONS,
    longest: float = np.inf,
    enough: float = _ENOUGH,
) -> GaussNewtonMinimum:
    """Minimise the sum of squared prediction errors among stable models.

    Parameters
    ----------
    problem : ResidualProblem
    theta : ndarray, shape (p,)
        Where to start; admissible.
    iterations : int
        At most.
    longest : float
        Largest change of any parameter in one step.
    enough : float
        Share of the cost that a whole step promises, below which the search has converged.

    Returns
    -------
    GaussNewtonMinimum
    """
    best = _point(problem, theta)
    if not theta.size:
        return GaussNewtonMinimum(best.theta, best.cost, True)
    damping = _FIRST_DAMPING
    for _ in range(iterations):
        linearised = _linearised(problem, best)
        if linearised.most <= enough * best.cost:
            return GaussNewtonMinimum(best.theta, best.cost, True)
        better = None
        while better is None:
            if damping > _MOST_DAMPING:
                # rounding, or the edge of stability, forbids any step downhill
                return GaussNewtonMinimum(best.theta, best.cost, True)
            step = linearised.step(damping)
            step *= min(1.0, longest / np.abs(step / linearised.scale).max())
            better = _lower_point(problem, best, step / linearised.scale)
            damping *= _factor(best, better, linearised.promised(step))
        damping = max(damping, _LEAST_DAMPING)
        best = better
    return GaussNewtonMinimum(best.theta, best.cost, False)


def _factor(begin: _Point, end: _Point | None, promised: float) -> float:
    """Return by how much damping changes after a step; it failed where there is no end."""
    if end is None:
        return _FAILED
    fallen = begin.cost - end.cost
    if fallen < _POOR * promised:
        return _RAISED
    return _LOWERED if fallen > _GOOD * promised else 1.0


def _point(problem: ResidualProblem, theta: Array) -> _Point:
    """Evaluate the prediction errors at a point."""
    e = problem.errors(theta)
    return _Point(theta, e, float(e @ e))


def _linearised(problem: ResidualProblem, point: _Point) -> _Linearised:
    """Linearise the prediction errors about a point."""
    # the triangle makes damped steps cheap
    reduced = triangle(np.vstack([problem.jacobian(point.theta).T, point.errors]))
    slopes = reduced[:, :-1]
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0.0] = 1.0
    return _Linearised(slopes / scale, reduced[:, -1], scale)


def _lower_point(problem: ResidualProblem, begin: _Point, step: Array) -> _Point | None:
    """Return the point a step away; None if it is not admissible or costs no less."""
    theta = begin.theta + step
    if not problem.admissible(theta):
        return None
    tried = _point(problem, theta)
    return tried if tried.cost < begin.cost else None
