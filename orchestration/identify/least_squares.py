"""Nonlinear least squares within bounds: SciPy's trust-region reflective method, stepping back where a model fails.

Sources: Branch, Coleman and Li, *SIAM Journal on Scientific Computing* 21 (1999); Bates and Watts, *Technometrics* 23
(1981); docs/decisions/0014-one-fit.md.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fmus.kit.errors import UserError

Array = NDArray[np.float64]
Function = Callable[[Array], Array]
_NOWHERE = 1e-9  # from the best point, in searched coordinates, where a step back ends
_ROUNDING = 1e-12  # relative change of the point, and size of the gradient, that ends a search
_UNDETERMINED = (
    1e-10  # of the largest singular value, below which a direction is not one that a step takes
)


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
    residual: Function,
    jacobian: Function,
    q: Array,
    low: Array,
    high: Array,
    tolerance: float = 1e-6,
    trials: int = 200,
) -> Minimum:
    """Minimise a sum of squared residuals within bounds.

    Parameters
    ----------
    residual, jacobian : callable
        Residuals (m,) and their Jacobian (m, p) at a point. From a point where a residual is not finite, or raises a
        UserError, the search steps back; at a SearchEndedError it ends with the best point so far.
    q, low, high : ndarray, shape (p,)
        Starting point and bounds; a coordinate whose bounds are equal stays there. A step of one should be a large one
        in every coordinate.
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
        If the residual raises it, or it or its Jacobian is not finite, where the search starts.
    """
    search = _Search(residual, jacobian, np.clip(q, low, high), low < high)
    fallen = np.inf
    # A trust region that has become small makes steps that gain little. Begun anew, it is as large as at first.
    while search.free.any() and search.least > 0.0 and fallen > tolerance * search.least:
        before = search.least
        try:
            converged, promised = search.run(low, high, tolerance, trials)
        except SearchEndedError:
            return Minimum(search.best, False)
        if not converged:
            return Minimum(search.best, False)
        fallen = before - search.least if promised > tolerance * search.least else 0.0
    return Minimum(search.best, True)


class _Search:
    """Points that were tried, and the best of them.

    Parameters
    ----------
    residual, jacobian, q
        See `minimise`.
    free : ndarray of bool, shape (p,)
        Coordinates that are searched.
    """

    def __init__(self, residual: Function, jacobian: Function, q: Array, free: NDArray[np.bool_]):
        self._residual, self._jacobian, self.free = residual, jacobian, free
        self.best, self._rows, self._tried = q, residual(q), 0
        if not np.isfinite(self._rows).all():
            raise UserError("the simulation is not finite where the search starts")

    @property
    def least(self) -> float:
        """The cost at the best point."""
        return float(self._rows @ self._rows)

    def run(self, low: Array, high: Array, tolerance: float, trials: int) -> tuple[bool, float]:
        """Search from the best point until steps gain no more; return whether they did, and what is promised yet.

        Coordinates are searched in steps from the best point: one is a large step, or what changes the simulation by as
        much as it is wrong, if that is less. They begin at a distance of one from their origin, because that is how far
        SciPy's first step may go.
        """
        origin, begin, free = self.best, self._rows, self.free
        at_origin = [
            self._jacobian(origin)[:, free]
        ]  # it may cost as many simulations as there are coordinates
        if not np.isfinite(at_origin[0]).all():
            raise UserError("the derivatives are not finite where the search starts")
        effect, wrong = np.linalg.norm(at_origin[0], axis=0), np.sqrt(self.least)
        size, start = (
            wrong / np.maximum(effect, wrong),
            np.full(int(free.sum()), free.sum() ** -0.5),
        )
        known = True  # the first point, even if there is no time for any other

        def moved(steps: Array) -> Array:
            point = origin.copy()
            point[free] += size * (steps - start)
            return point

        def rows(steps: Array) -> Array:
            nonlocal known
            if not known:
                return self._at(moved(steps))
            known = False
            return begin

        def slopes(steps: Array) -> Array:
            return (at_origin.pop() if at_origin else self._jacobian(moved(steps))[:, free]) * size

        ends = start + (low - origin)[free] / size, start + (high - origin)[free] / size
        with np.errstate(
            over="ignore"
        ):  # of a trust region that comes to nothing where nothing is left to gain
            solution = least_squares(
                rows,
                start,
                slopes,
                ends,
                ftol=tolerance,
                xtol=_ROUNDING,
                gtol=_ROUNDING,
                max_nfev=max(1, trials - self._tried),
            )
        # it stays within the bounds by a rounding error
        at_end, there = solution.active_mask, moved(solution.x)
        there[free] = np.where(at_end < 0, low[free], np.where(at_end > 0, high[free], there[free]))
        self.best, self._rows = there, solution.fun
        return bool(solution.success), _promised(
            np.asarray(solution.jac)[:, at_end == 0], solution.fun
        )

    def _at(self, point: Array) -> Array:
        """Residual at a point; infinite where there is none, so that the search steps back."""
        self._tried += 1
        values = residual_or_none(self._residual, point)
        if values is None:
            if np.abs(point - self.best).max() <= _NOWHERE:
                raise SearchEndedError("the model fails wherever the search could go")
            return np.full_like(self._rows, np.inf)
        if float(values @ values) < self.least:
            self.best, self._rows = point, values
        return values


def _promised(jacobian: Array, residual: Array) -> float:
    """By how much the cost would fall with a whole step of Gauss and Newton, were the residual linear."""
    step = np.linalg.lstsq(jacobian, -residual, rcond=_UNDETERMINED)[0]
    after = residual + jacobian @ step
    return float(residual @ residual - after @ after)


def residual_or_none(residual: Function, q: Array) -> Array | None:
    """Residual at a point; None where it is not finite or raises a UserError, so that a search has to step back."""
    try:
        values = residual(q)
    except SearchEndedError:
        raise
    except UserError:
        return None
    return values if np.isfinite(values).all() else None
