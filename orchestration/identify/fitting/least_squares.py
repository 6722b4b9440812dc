"""Nonlinear least squares within bounds, stepping back where a model fails.

The method is SciPy's trust-region reflective one. It sees a residual of many rows only as a point
has it after a QR decomposition, as one row more than there are coordinates: its steps depend on
the products of residual and Jacobian alone.

Sources: Branch, Coleman and Li, *SIAM Journal on Scientific Computing* 21 (1999); Bates and Watts,
*Technometrics* 23 (1981); docs/decisions/archive.md#14-one-fit-one-search.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgeqrf
from scipy.optimize import least_squares

from fmus.kit import UserError
from fmus.kit.arrays import Array, Mask

Function = Callable[[Array], Array]
_NOWHERE = 1e-9  # length of a step, in searched coordinates, after which a search gives up
_ROUNDING = 1e-12  # relative change of the point, and size of the gradient, that ends a search
# singular value, relative to the largest, below which no step goes in its direction
_UNDETERMINED = 1e-10
_BLOCK = 2_048  # rows of a Jacobian that are decomposed at once: as many as the cache holds


class SearchEndedError(UserError):
    """A search cannot go on: there is nowhere to go."""


class Minimum(NamedTuple):
    """The point where a search ended.

    Attributes
    ----------
    q : ndarray, shape (p,)
        The best point.
    converged : bool
        True if the cost fell no more; else the trial points were used up.
    promised : float
        Fall of the cost with another whole step, were the residual linear; infinite if unknown.
    """

    q: Array
    converged: bool
    promised: float = np.inf


# a simulation may run away, and a trust region vanishes where nothing is to gain
@np.errstate(over="ignore", divide="ignore", invalid="ignore")
def minimise(
    residual: Function,
    jacobian: Function,
    q: Array,
    low: Array,
    high: Array,
    tolerance: float = 1e-6,
    *,
    trials: int = 200,
) -> Minimum:
    """Minimise a sum of squared residuals within bounds.

    Parameters
    ----------
    residual, jacobian : callable
        Residuals (m,) and their Jacobian (m, p) at a point. From a point where a residual is not
        finite, or raises a UserError, the search steps back; at a SearchEndedError it ends with the
        best point so far.
    q, low, high : ndarray, shape (p,)
        Starting point and bounds; a coordinate whose bounds are equal stays there. In every
        coordinate a step of one should be a large one.
    tolerance : float
        Fall of the cost, relative to it, that ends the search.
    trials : int
        Largest number of points that are tried.

    Returns
    -------
    Minimum

    Raises
    ------
    UserError
        If the start is not finite, or the residual or its Jacobian is not finite there, or the
        residual raises it there.
    """
    if not np.isfinite(q).all():
        raise UserError("the search starts at a point that is not finite")
    search = _Search(residual, jacobian, np.clip(q, low, high), low < high)
    if search.least == np.inf:  # a simulation that runs away has no direction of descent
        return Minimum(search.best, False)
    fallen = np.inf
    # A trust region that has become small makes steps that gain little. A new search begins with a
    # large one.
    while search.free.any() and search.least > 0.0 and fallen > tolerance * search.least:
        before = search.least
        try:
            converged, promised = search.run(low, high, tolerance, trials)
        except SearchEndedError:
            return Minimum(search.best, False)
        if not converged:
            return Minimum(search.best, False, promised)
        fallen = before - search.least if promised > tolerance * search.least else 0.0
    return Minimum(search.best, True)


class _Search:
    """A search of the free coordinates, with the best point so far.

    Parameters
    ----------
    residual, jacobian, q
        See `minimise`.
    free : ndarray of bool, shape (p,)
        Coordinates that are searched.
    """

    def __init__(self, residual: Function, jacobian: Function, q: Array, free: Mask):
        self._residual = residual
        self._jacobian = jacobian
        self.free = free
        self.best = q
        self._rows = residual(q)
        self._last = self._rows
        self._tried = 0
        if not np.isfinite(self._rows).all():
            raise UserError("the simulation is not finite where the search starts")

    @property
    def least(self) -> float:
        """The cost at the best point."""
        return float(self._rows @ self._rows)

    def run(self, low: Array, high: Array, tolerance: float, trials: int) -> tuple[bool, float]:
        """Search from the best point until steps gain no more.

        Coordinates are scaled: a step of one is a large one, or one that changes the simulation by
        as much as its error, if that is less. They begin at a distance of one from their origin,
        because that is the length of SciPy's first step.

        Returns
        -------
        converged : bool
            False if the trial points were used up.
        promised : float
            Fall of the cost with another whole step, were the residual linear.
        """
        origin = self.best
        free = self.free
        first_triangle = self._triangle_at(origin, self._rows)
        if not np.isfinite(first_triangle).all():
            raise UserError("the derivatives are not finite where the search starts")
        effect = np.linalg.norm(first_triangle, axis=0)
        error = np.sqrt(self.least)
        size = error / np.maximum(effect, error)
        start = np.full(int(free.sum()), free.sum() ** -0.5)

        def point_at(steps: Array) -> Array:
            point = origin.copy()
            point[free] += size * (steps - start)
            return point

        # SciPy's first call needs no simulation, of which a Jacobian may cost as many as there are
        # coordinates
        residual = _first_known(self._rows, lambda steps: self._residual_at(point_at(steps)))
        triangle = _first_known(
            first_triangle, lambda steps: self._triangle_at(point_at(steps), self._last)
        )

        def rows(steps: Array) -> Array:
            self._last = residual(steps)
            return _as_one_row(self._last, len(start))

        def slopes(steps: Array) -> Array:
            unscaled = triangle(steps)
            if not np.isfinite(unscaled).all():
                raise SearchEndedError("the derivatives are not finite where the search came to")
            return unscaled * size

        bounds = (start + (low - origin)[free] / size, start + (high - origin)[free] / size)
        solution = least_squares(
            rows,
            start,
            slopes,
            bounds,
            ftol=tolerance,
            xtol=_ROUNDING,
            gtol=_ROUNDING,
            max_nfev=max(1, trials - self._tried),
        )
        # SciPy leaves a coordinate a rounding error off its bound
        active = solution.active_mask
        end = point_at(solution.x)
        upper = np.where(active > 0, high[free], end[free])
        end[free] = np.where(active < 0, low[free], upper)
        self.best = end
        promised = _predicted_fall(np.asarray(solution.jac)[:, active == 0], solution.fun)
        return bool(solution.success), promised

    def _triangle_at(self, point: Array, values: Array) -> Array:
        """Return the triangle of the free columns of the Jacobian at a point of some residual."""
        slopes = self._jacobian(point)
        # no copy if all columns are free
        return _triangle(slopes if self.free.all() else slopes[:, self.free], values)

    def _residual_at(self, point: Array) -> Array:
        """Return the residual at a point; infinite if it cannot be simulated, for a step back."""
        self._tried += 1
        values = residual_or_none(self._residual, point)
        if values is None:
            if np.abs(point - self.best).max() <= _NOWHERE:
                raise SearchEndedError("the model fails wherever the search could go")
            return np.full_like(self._rows, np.inf)
        if float(values @ values) < self.least:
            self.best = point
            self._rows = values
        return values


def _first_known(value: Array, function: Function) -> Function:
    """Return a function whose first call returns a value that is known, as others call it."""
    known = [value]
    return lambda q: known.pop() if known else function(q)


def _as_one_row(values: Array, count: int) -> Array:
    """Return a residual (m,) in coordinates in which only its first is not zero, (count + 1,)."""
    row = np.zeros(count + 1)
    # values that are not finite stay so
    row[0] = np.sqrt(values @ values)
    return row


def _triangle(slopes: Array, values: Array) -> Array:
    """Return a Jacobian (m, p) in the coordinates of `_as_one_row`, (p + 1, p).

    They are those of a QR decomposition of Jacobian and residual, reflected so that the residual
    lies along the first (Golub and Van Loan: Matrix Computations, section 5.1).
    """
    count = slopes.shape[1]
    triangle = np.zeros((count + 1, count + 1))
    for first in range(0, len(values), _BLOCK):
        block = slice(first, first + _BLOCK)
        whole = np.empty((count + 1 + len(values[block]), count + 1), order="F")
        whole[: count + 1] = triangle
        whole[count + 1 :, :-1] = slopes[block]
        whole[count + 1 :, -1] = values[block]
        if not np.isfinite(whole).all():
            return np.full((count + 1, count), np.nan)
        # LAPACK's own, as NumPy's QR decomposition copies
        triangle = np.triu(dgeqrf(whole, overwrite_a=True)[0][: count + 1])
    residual = triangle[:, -1].copy()
    residual[0] -= np.linalg.norm(residual)
    square = float(residual @ residual)
    reflected: Array = triangle[:, :-1]
    if square > 0.0:
        reflected = reflected - np.outer(residual, 2.0 / square * (residual @ reflected))
    return reflected


def _predicted_fall(jacobian: Array, residual: Array) -> float:
    """Return the fall of the cost with a whole Gauss-Newton step, were the residual linear."""
    step = np.linalg.lstsq(jacobian, -residual, rcond=_UNDETERMINED)[0]
    after = residual + jacobian @ step
    return float(residual @ residual - after @ after)


def residual_or_none(residual: Function, q: Array) -> Array | None:
    """Return the residual at a point; None if it raises a UserError or its square is not finite."""
    try:
        values = residual(q)
    except SearchEndedError:
        raise
    except UserError:
        return None
    with np.errstate(over="ignore"):
        return values if np.isfinite(values @ values) else None
