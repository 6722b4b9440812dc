"""Levenberg-Marquardt within bounds, on the normal equations: many residuals, few parameters, derivatives for free.

A singular value decomposition of the Jacobian, as `scipy.optimize.least_squares` makes in every step, costs several
times the simulation that gave it. Columns are scaled to unit length, so that the squared condition does no harm at the
accuracy that noise allows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError

Array = NDArray[np.float64]
_FIRST, _LEAST, _MOST = 1e-3, 1e-9, 1e9  # damping, relative to the curvature
_STRIDE = 1.0  # longest step of a coordinate: a factor of 2.7 of what is searched in its logarithm


class Minimum(NamedTuple):
    """Where a search ended.

    Attributes
    ----------
    q : ndarray, shape (p,)
        The best point.
    converged : bool
        Whether no step promised to lower the cost any more; else the trial points were used up.
    """

    q: Array
    converged: bool


def minimise(
    residual: Callable[[Array], Array], jacobian: Callable[[Array], Array], q: Array, low: Array, high: Array,
    tolerance: float = 1e-6, trials: int = 200,
) -> Minimum:  # fmt: skip
    """Minimise a sum of squared residuals within bounds.

    Parameters
    ----------
    residual, jacobian : callable
        Residuals (m,) and their Jacobian (m, p) at a point. From a point where a residual is not finite, or raises a
        UserError, the search steps back.
    q, low, high : ndarray, shape (p,)
        Starting point and bounds.
    tolerance : float
        Fall of the cost, predicted and relative to it, that ends the search.
    trials : int
        Points that are tried at most.

    Returns
    -------
    Minimum

    Raises
    ------
    UserError
        If the residual raises it where the search starts.
    """
    q = np.clip(q, low, high)
    error = residual(q)
    cost, damping = float(error @ error), _FIRST
    slopes = jacobian(q)
    for _ in range(trials):
        gradient, curvature = slopes.T @ error, slopes.T @ slopes
        moved = _step(gradient, curvature, damping, low - q, high - q)
        moved *= min(1.0, _STRIDE / max(np.abs(moved).max(initial=0.0), np.finfo(float).tiny))
        trial = np.clip(q + moved, low, high)
        moved = trial - q
        predicted = -float(2.0 * gradient @ moved + moved @ curvature @ moved)
        if predicted <= tolerance * cost:
            return Minimum(q, True)
        tried = residual_or_none(residual, trial)
        after = np.inf if tried is None else float(tried @ tried)
        if tried is not None and after < cost:
            gain = (cost - after) / predicted
            damping = max(_LEAST, damping / (10.0 if gain > 0.75 else 2.0))
            q, error, cost, slopes = trial, tried, after, jacobian(trial)
        else:
            damping *= 10.0
            if damping > _MOST:
                return Minimum(q, True)
    return Minimum(q, False)


def residual_or_none(residual: Callable[[Array], Array], q: Array) -> Array | None:
    """Residual at a point; None where it is not finite or raises a UserError, so that a search has to step back."""
    try:
        values = residual(q)
    except UserError:
        return None
    return values if np.isfinite(values).all() else None


def _step(gradient: Array, curvature: Array, damping: float, low: Array, high: Array) -> Array:
    """Return the damped step within bounds: a coordinate that would pass one stays there, and the others adapt."""
    scale = np.sqrt(np.diag(curvature))
    moved = np.zeros_like(gradient)
    free = (scale > 0.0) & ~((low >= 0.0) & (gradient > 0.0)) & ~((high <= 0.0) & (gradient < 0.0))
    while free.any():
        remaining = gradient[free] + curvature[np.ix_(free, ~free)] @ moved[~free]
        unit = curvature[np.ix_(free, free)] / np.outer(scale[free], scale[free])
        moved[free] = -np.linalg.solve(unit + damping * np.eye(free.sum()), remaining / scale[free]) / scale[free]
        beyond = free & ((moved < low) | (moved > high))
        if not beyond.any():
            break
        moved = np.clip(moved, low, high)
        free &= ~beyond
    return moved
