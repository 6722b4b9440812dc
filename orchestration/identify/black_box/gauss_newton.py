"""Least squares of prediction errors among stable models, by Gauss-Newton steps in a trust region.

The region is a ball in the parameters as they are. Scaled by the effect of each, as Levenberg's and
Marquardt's damping is often made, steps would be longest in those that do least: in reflection
coefficients near one, where a search then stays.

Sources: Ljung, System Identification, section 10.2; Nocedal and Wright, Numerical Optimization,
chapter 4 and section 10.3.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.polynomials import triangle

_ITERATIONS = 100
_ENOUGH = 1e-9
# singular value, relative to the largest, that is zero: free responses of equal paths are collinear
_UNDETERMINED = 1e-12
_RADIUS = 1.0  # of the first trust region: parameters are such that one is a change of some size
_FARTHEST = 3.0  # a step within this radius that promises little ends a search
_LEAST_RADIUS = 1e-9  # of a step to which nothing answers but rounding
# Shares of the promised fall of the cost below which the radius is a part of the step, and above
# which it is larger if the step had all of it (Nocedal and Wright, algorithm 4.1).
_POOR = 0.25
_GOOD = 0.75
_LOWERED = 0.25
_RAISED = 2.0
_EDGE = 0.9  # of the radius, a step that had all of it
_ALIKE = 0.05  # relative difference of a step's length from the radius
_TRIALS = 20  # of the damping that makes a step so long


class ResidualProblem(Protocol):
    """Prediction errors as functions of parameters, some of which are not admissible."""

    def errors(self, theta: Array, /) -> Array:
        """Return the prediction errors (n,)."""

    def jacobian(self, theta: Array, /) -> Array:
        """Return the derivatives (n, p) of the prediction errors by the parameters."""

    def admissible(self, theta: Array, /) -> bool:
        """Return whether the predictor is stable."""


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
    """Prediction errors linearised about a point, in the singular directions of their derivatives.

    Attributes
    ----------
    directions : ndarray, shape (r, p)
        Orthonormal.
    slopes : ndarray, shape (r,)
        Singular values.
    errors : ndarray, shape (r,)
        Components of the errors that a change along each direction can undo.
    """

    directions: Array
    slopes: Array
    errors: Array

    def step(self, radius: float) -> Array:
        """Return the Gauss-Newton step (r,), along the directions, within a radius.

        A longer one is damped until its length is the radius, by Newton's method for the damping
        (Nocedal and Wright, algorithm 4.3).
        """
        gradient = self.slopes * self.errors
        step = -self.errors / self.slopes
        damping = 0.0
        for _ in range(_TRIALS):
            length = float(np.linalg.norm(step))
            if length <= (1.0 + _ALIKE) * radius:
                break
            stiffness = self.slopes**2 + damping
            decline = float(step**2 @ (1.0 / stiffness)) / length  # of the length, by the damping
            damping += (length / radius - 1.0) * length / decline
            step = -gradient / (self.slopes**2 + damping)
        return step

    def promised(self, step: Array) -> float:
        """Return the fall of the cost with a step, if errors were linear."""
        after = self.errors + self.slopes * step
        return float(self.errors @ self.errors) - float(after @ after)


def minimise(
    problem: ResidualProblem,
    theta: Array,
    iterations: int = _ITERATIONS,
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
    enough : float
        Share of the cost that a step promises, below which the search has converged.

    Returns
    -------
    GaussNewtonMinimum
    """
    best = _evaluate(problem, theta)
    radius = _RADIUS
    for _ in range(iterations if theta.size else 0):
        linearised = _linearise(problem, best)
        if linearised.promised(linearised.step(_FARTHEST)) <= enough * best.cost:
            return GaussNewtonMinimum(best.theta, best.cost, True)
        better = None
        while better is None:
            if radius < _LEAST_RADIUS:
                # rounding, or the edge of stability, forbids any step downhill
                return GaussNewtonMinimum(best.theta, best.cost, True)
            step = linearised.step(radius)
            better = _lower_point(problem, best, step @ linearised.directions)
            fallen = best.cost - better.cost if better else 0.0
            promised = linearised.promised(step)
            share = fallen / promised if promised > 0.0 else 0.0  # rounding promises nothing
            radius = _next_radius(radius, step, share)
        best = better
    return GaussNewtonMinimum(best.theta, best.cost, not theta.size)


def _next_radius(radius: float, step: Array, share: float) -> float:
    """Return the next radius, from the ratio of actual to predicted reduction of the last step."""
    length = float(np.linalg.norm(step))
    if share < _POOR:
        return _LOWERED * min(length, radius)
    is_all = share > _GOOD and length > _EDGE * radius
    return _RAISED * radius if is_all else radius


def _evaluate(problem: ResidualProblem, theta: Array) -> _Point:
    """Evaluate the prediction errors at a point."""
    e = problem.errors(theta)
    return _Point(theta, e, float(e @ e))


def _linearise(problem: ResidualProblem, point: _Point) -> _Linearised:
    """Linearise the prediction errors about a point."""
    # R of the QR decomposition has the same least squares as the many thousand samples
    reduced = triangle(np.vstack([problem.jacobian(point.theta).T, point.errors]))
    u, s, v = np.linalg.svd(reduced[:, :-1], full_matrices=False)
    kept = s > _UNDETERMINED * s.max(initial=0.0)
    return _Linearised(v[kept], s[kept], u[:, kept].T @ reduced[:, -1])


def _lower_point(problem: ResidualProblem, begin: _Point, step: Array) -> _Point | None:
    """Return the point after a step; None if it is not admissible or does not lower the cost."""
    theta = begin.theta + step
    if not problem.admissible(theta):
        return None
    tried = _evaluate(problem, theta)
    return tried if tried.cost < begin.cost else None
