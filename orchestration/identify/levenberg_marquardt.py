"""Levenberg-Marquardt within bounds, on the normal equations: many residuals, few parameters, derivatives for free.

A singular value decomposition of the Jacobian, as `scipy.optimize.least_squares` makes in every step, costs several
times the simulation that gave it. Columns are scaled to unit length, so that the squared condition does no harm at the
accuracy that noise leaves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_FIRST, _LEAST, _MOST = 1e-3, 1e-9, 1e9  # damping
_STRIDE = 1.0  # longest step of a coordinate: a factor of 2.7 of what is searched in its logarithm


def minimise(
    rows: Callable[[Array], Array], slopes: Callable[[Array], Array], q: Array, low: Array, high: Array,
    relative: float = 1e-6, most: int = 40,
) -> Array:  # fmt: skip
    """Minimise the sum of squares of some residuals.

    Parameters
    ----------
    rows, slopes : callable
        Residuals (m,) and their Jacobian (m, p) at a point; a residual that is not finite is stepped back from.
    q, low, high : ndarray, shape (p,)
        Starting point and bounds.
    relative : float
        Fall of the cost, predicted and relative to it, that ends the search.
    most : int
        Trial points.

    Returns
    -------
    ndarray, shape (p,)
    """
    q = np.clip(q, low, high)
    error = rows(q)
    cost, damping = float(error @ error), _FIRST
    jacobian = slopes(q)
    for _ in range(most):
        gradient, curvature = jacobian.T @ error, jacobian.T @ jacobian
        moved = _step(gradient, curvature, damping, low - q, high - q)
        moved *= min(1.0, _STRIDE / max(np.abs(moved).max(initial=0.0), np.finfo(float).tiny))
        trial = np.clip(q + moved, low, high)
        moved = trial - q
        predicted = -float(2.0 * gradient @ moved + moved @ curvature @ moved)
        if predicted <= relative * cost:
            break
        tried = rows(trial)
        after = float(tried @ tried) if np.isfinite(tried).all() else np.inf
        if after < cost:
            gain = (cost - after) / predicted
            damping = max(_LEAST, damping / (10.0 if gain > 0.75 else 2.0))
            q, error, cost, jacobian = trial, tried, after, slopes(trial)
        else:
            damping *= 10.0
            if damping > _MOST:
                break
    return q


def _step(gradient: Array, curvature: Array, damping: float, low: Array, high: Array) -> Array:
    """Return the damped step within bounds: who would leave them stays there, and the others make the best of it."""
    scale = np.sqrt(np.diag(curvature))
    moved = np.zeros_like(gradient)
    free = (scale > 0.0) & ~((low >= 0.0) & (gradient > 0.0)) & ~((high <= 0.0) & (gradient < 0.0))
    while free.any():
        rest = gradient[free] + curvature[np.ix_(free, ~free)] @ moved[~free]
        unit = curvature[np.ix_(free, free)] / np.outer(scale[free], scale[free])
        moved[free] = -np.linalg.solve(unit + damping * np.eye(free.sum()), rest / scale[free]) / scale[free]
        beyond = free & ((moved < low) | (moved > high))
        if not beyond.any():
            break
        moved = np.clip(moved, low, high)
        free &= ~beyond
    return moved
