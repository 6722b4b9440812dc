"""Least squares of prediction errors: Gauss-Newton steps, damped after Levenberg and Marquardt, that stay stable.

Sources: Ljung, System Identification, section 10.2; Nocedal and Wright, Numerical Optimization, section 10.3.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.black_box.polynomials import solved

Array = NDArray[np.float64]
_ITERATIONS = 100
_ENOUGH = 1e-9  # share of the cost that a whole Gauss-Newton step promises, below which a search has converged
_UNDETERMINED = (
    1e-12  # of the largest singular value: free responses of like paths cannot be told apart
)
_WHOLE = 0.8  # share of a step that is as good as all of it
_DAMPING = (1e-12, 1e-3, 1e12)  # least, after a first failure, and where there is nowhere to go


class Problem(Protocol):
    """Prediction errors as functions of parameters."""

    def errors(self, theta: Array, /) -> Array:
        """Return the prediction errors (n,)."""

    def jacobian(self, theta: Array, /) -> Array:
        """Return their derivatives (n, p)."""

    def admissible(self, theta: Array, /) -> bool:
        """Whether the predictor is stable."""


class Minimum(NamedTuple):
    """Where a search ended.

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


def minimise(problem: Problem, theta: Array) -> Minimum:
    """Minimise the sum of squared prediction errors among stable models.

    Parameters
    ----------
    problem : Problem
    theta : ndarray, shape (p,)
        Where to start; admissible.

    Returns
    -------
    Minimum
    """
    e = problem.errors(theta)
    cost, damping = float(e @ e), 0.0
    for _ in range(_ITERATIONS):
        # all that there is in many thousand rows is in a triangle of a few, from which every damped step is cheap
        triangle = np.asarray(np.linalg.qr(np.column_stack([problem.jacobian(theta), e]), mode="r"))
        slopes, rest = triangle[:, :-1], triangle[:, -1]
        scale = np.linalg.norm(slopes, axis=0)
        scale[scale == 0.0] = 1.0
        slopes = slopes / scale
        promised = float(rest @ rest) - float(
            np.sum((rest + slopes @ _damped(slopes, rest, 0.0)) ** 2)
        )
        if promised <= _ENOUGH * cost:
            return Minimum(theta, cost, True)
        while (tried := _along(problem, theta, cost, slopes, rest, scale, damping)) is None:
            damping = max(10.0 * damping, _DAMPING[1])
            if damping > _DAMPING[2]:
                return Minimum(
                    theta, cost, True
                )  # rounding, or the edge of stability, forbids any step downhill
        theta, e, cost = tried
        damping = 0.0 if damping < _DAMPING[0] else 0.1 * damping
    return Minimum(theta, cost, False)


def _along(
    problem: Problem,
    theta: Array,
    cost: float,
    slopes: Array,
    rest: Array,
    scale: Array,
    damping: float,
) -> tuple[Array, Array, float] | None:
    """Best of a damped step and of the part of it where a parabola is lowest; None where neither gains.

    Where a model cannot describe the data whole steps go too far, again and again: half of each is then far better.
    """
    step = _damped(slopes, rest, damping)
    slope, share = 2.0 * float(rest @ (slopes @ step)), 1.0
    best = None
    for _ in range(2):
        tried = theta + share * step / scale
        if not problem.admissible(tried):
            break
        e = problem.errors(tried)
        value = float(e @ e)
        if value < (cost if best is None else best[2]):
            best = tried, e, value
        bend = value - cost - slope
        share = -0.5 * slope / bend if bend > 0.0 else 1.0
        if share > _WHOLE:
            break
    return best


def _damped(slopes: Array, rest: Array, damping: float) -> Array:
    if damping == 0.0:
        return np.asarray(np.linalg.lstsq(slopes, -rest, rcond=_UNDETERMINED)[0], dtype=np.float64)
    count = slopes.shape[1]
    rows = np.vstack([slopes, np.sqrt(damping) * np.eye(count)])
    return solved(rows, -np.concatenate([rest, np.zeros(count)]))
