"""Least squares of prediction errors: Gauss-Newton steps, damped after Levenberg and Marquardt, that stay stable.

Sources: Ljung, System Identification, section 10.2; Nocedal and Wright, Numerical Optimization, section 10.3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.black_box.prediction_error import PredictionError

Array = NDArray[np.float64]
_ITERATIONS = 200
_ENOUGH = 1e-10  # share of the cost that a whole Gauss-Newton step promises, below which a search has converged
_UNDETERMINED = 1e-12  # of the largest singular value: free responses of like paths cannot be told apart
_DAMPING = (1e-12, 1e-3, 1e12)  # least, after a first failure, and where there is nowhere to go


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


def minimise(problem: PredictionError, theta: Array) -> Minimum:
    """Minimise the sum of squared prediction errors among stable models.

    Parameters
    ----------
    problem : PredictionError
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
        triangle = np.linalg.qr(np.column_stack([problem.jacobian(theta), e]), mode="r")
        slopes, rest = triangle[:, :-1], triangle[:, -1]
        scale = np.linalg.norm(slopes, axis=0)
        scale[scale == 0.0] = 1.0
        slopes = slopes / scale
        whole = np.linalg.lstsq(slopes, -rest, rcond=_UNDETERMINED)[0]
        promised = float(rest @ rest) - float(np.sum((rest + slopes @ whole) ** 2))
        if promised <= _ENOUGH * cost:
            return Minimum(theta, cost, True)
        while True:
            step = whole if damping == 0.0 else _damped(slopes, rest, damping)
            tried = theta + step / scale
            if problem.admissible(tried):
                e = problem.errors(tried)
                if float(e @ e) < cost:
                    break
            damping = max(10.0 * damping, _DAMPING[1])
            if damping > _DAMPING[2]:
                return Minimum(theta, cost, True)  # rounding, or the edge of stability, forbids any step downhill
        theta, cost = tried, float(e @ e)
        damping = 0.0 if damping < _DAMPING[0] else 0.1 * damping
    return Minimum(theta, cost, False)


def _damped(slopes: Array, rest: Array, damping: float) -> Array:
    count = slopes.shape[1]
    rows = np.vstack([slopes, np.sqrt(damping) * np.eye(count)])
    step: Array = np.linalg.lstsq(rows, -np.concatenate([rest, np.zeros(count)]), rcond=None)[0]
    return step
