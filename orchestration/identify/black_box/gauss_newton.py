"""Least squares of prediction errors among stable models, by damped Gauss-Newton steps.

The damping is that of Levenberg and Marquardt. Sources: Ljung, System Identification, section 10.2;
Nocedal and Wright, Numerical Optimization, section 10.3.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.polynomials import solved

_ITERATIONS = 100
# share of the cost that a whole Gauss-Newton step promises, below which a search has converged
_ENOUGH = 1e-9
# singular value, relative to the largest, that is zero: free responses of equal paths are collinear
_UNDETERMINED = 1e-12
_WHOLE = 0.8  # share of a step that is as good as all of it
_LEAST_DAMPING = 1e-12  # below it there is none
_FIRST_DAMPING = 1e-3  # after a first failure
_MOST_DAMPING = 1e12  # beyond it no step downhill is to be expected


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
        if damping == 0.0:
            whole = np.linalg.lstsq(self.slopes, -self.errors, rcond=_UNDETERMINED)[0]
            return np.asarray(whole, dtype=np.float64)
        count = self.slopes.shape[1]
        rows = np.vstack([self.slopes, np.sqrt(damping) * np.eye(count)])
        return solved(rows, -np.concatenate([self.errors, np.zeros(count)]))

    @property
    def promised(self) -> float:
        """The fall of the cost with a whole step, if errors were linear."""
        after = self.errors + self.slopes @ self.step(0.0)
        return float(self.errors @ self.errors) - float(np.sum(after**2))


def minimise(problem: ResidualProblem, theta: Array) -> GaussNewtonMinimum:
    """Minimise the sum of squared prediction errors among stable models.

    Parameters
    ----------
    problem : ResidualProblem
    theta : ndarray, shape (p,)
        Where to start; admissible.

    Returns
    -------
    GaussNewtonMinimum
    """
    best = _point(problem, theta)
    damping = 0.0
    for _ in range(_ITERATIONS):
        linearised = _linearised(problem, best)
        if linearised.promised <= _ENOUGH * best.cost:
            return GaussNewtonMinimum(best.theta, best.cost, True)
        better = _better_point(problem, best, linearised, damping)
        while better is None:
            damping = max(10.0 * damping, _FIRST_DAMPING)
            if damping > _MOST_DAMPING:
                # rounding, or the edge of stability, forbids any step downhill
                return GaussNewtonMinimum(best.theta, best.cost, True)
            better = _better_point(problem, best, linearised, damping)
        best = better
        damping = 0.0 if damping < _LEAST_DAMPING else 0.1 * damping
    return GaussNewtonMinimum(best.theta, best.cost, False)


def _point(problem: ResidualProblem, theta: Array) -> _Point:
    """Evaluate the prediction errors at a point."""
    e = problem.errors(theta)
    return _Point(theta, e, float(e @ e))


def _linearised(problem: ResidualProblem, point: _Point) -> _Linearised:
    """Linearise the prediction errors about a point."""
    # a triangle of a few rows holds all there is in many thousand, and makes damped steps cheap
    rows = np.column_stack([problem.jacobian(point.theta), point.errors])
    triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    slopes = triangle[:, :-1]
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0.0] = 1.0
    return _Linearised(slopes / scale, triangle[:, -1], scale)


def _better_point(
    problem: ResidualProblem, begin: _Point, linearised: _Linearised, damping: float
) -> _Point | None:
    """Return the better of two points along a damped step; None if neither costs less.

    The first is the end of the step. The second is the lowest point of the parabola through both
    costs and the slope at the beginning: where a model cannot describe the data, whole steps go too
    far again and again.
    """
    step = linearised.step(damping)
    slope = 2.0 * float(linearised.errors @ (linearised.slopes @ step))
    share = 1.0
    best = None
    for _ in range(2):
        theta = begin.theta + share * step / linearised.scale
        if not problem.admissible(theta):
            break
        tried = _point(problem, theta)
        if tried.cost < (begin.cost if best is None else best.cost):
            best = tried
        bend = tried.cost - begin.cost - slope
        share = -0.5 * slope / bend if bend > 0.0 else 1.0
        if share > _WHOLE:
            break
    return best
