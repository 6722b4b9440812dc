"""Nonlinear least squares within bounds: SciPy's trust-region reflective method, stepping back where a model fails.

Sources: Branch, Coleman and Li, *SIAM Journal on Scientific Computing* 21 (1999); docs/decisions/0014-one-fit.md.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fmus.kit.errors import UserError

Array = NDArray[np.float64]
_NOWHERE = 1e-9  # from the best point, in searched coordinates, where a step back ends
_ROUNDING = 1e-12  # relative change of the point, and size of the gradient, that ends a search


class SearchEndedError(UserError):
    """A search cannot go on: there is no time left, or nowhere to go."""


class Minimum(NamedTuple):
    """Where a search ended.

    Attributes
    ----------
    q : ndarray, shape (p,)
        The best point.
    converged : bool
        Whether the cost fell no more; else the trial points were used up.
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
        UserError, the search steps back; at a SearchEndedError it ends with the best point so far.
    q, low, high : ndarray, shape (p,)
        Starting point and bounds; a coordinate whose bounds are equal stays there.
    tolerance : float
        Fall of the cost, relative to it, that ends the search.
    trials : int
        Points that are tried at most.

    Returns
    -------
    Minimum

    Raises
    ------
    UserError
        If the residual raises it, or is not finite, where the search starts.
    """
    q = np.clip(q, low, high)
    free = low < high
    begin = residual(q)
    if not np.isfinite(begin).all():
        raise UserError("the simulation is not finite where the search starts")
    if not free.any():
        return Minimum(q, True)

    def at(moved: Array) -> Array:
        point = q.copy()
        point[free] = moved
        return point

    best, least, started = q, float(begin @ begin), False

    def finite(moved: Array) -> Array:
        nonlocal best, least, started
        if not started:  # it is known, even if there is no time for any other
            started = True
            return begin
        point = at(moved)
        values = residual_or_none(residual, point)
        if values is None and np.abs(point - best).max() <= _NOWHERE:
            raise SearchEndedError("the model fails wherever the search could go")
        if values is not None and (cost := float(values @ values)) < least:
            best, least = point, cost
        return np.full_like(begin, np.inf) if values is None else values

    def slopes(moved: Array) -> Array:
        return jacobian(at(moved))[:, free]

    try:
        solution = least_squares(
            finite, q[free], slopes, (low[free], high[free]), ftol=tolerance, xtol=_ROUNDING, gtol=_ROUNDING,
            max_nfev=trials,
        )  # fmt: skip
    except SearchEndedError:
        return Minimum(best, False)
    # it stays within the bounds by a rounding error
    ends = np.where(solution.active_mask < 0, low[free], high[free])
    return Minimum(at(np.where(solution.active_mask == 0, solution.x, ends)), solution.success)


def residual_or_none(residual: Callable[[Array], Array], q: Array) -> Array | None:
    """Residual at a point; None where it is not finite or raises a UserError, so that a search has to step back."""
    try:
        values = residual(q)
    except SearchEndedError:
        raise
    except UserError:
        return None
    return values if np.isfinite(values).all() else None
