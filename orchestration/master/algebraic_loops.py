"""Solution of algebraic loops, in which inputs and outputs determine each other at one time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array

TOLERANCE = 1e-10  # of nominal value plus magnitude before
_ROUNDING = 1e-13  # of the magnitude
_DIFFERENCE = 1e-6  # step of differences for a Jacobian, of nominal value plus magnitude
_MOST_EVALUATIONS = 200
_MOST_UPDATES = 8  # of a Jacobian, before it is measured anew


class FixedPoint:
    """A solver of ``v = g(v)``, used many times, each time from a value near the last solution.

    It uses Newton's method. The Jacobian of ``g(v) - v`` is measured by differences once, and then
    only updated (Broyden); it is measured anew where that does not converge. Booleans and integers
    have no Jacobian: with one of them in the loop, ``v`` is replaced by ``g(v)`` until nothing
    changes.

    Parameters
    ----------
    g : callable
        Returns the values that the inputs receive if they are ``v``.
    scale : ndarray, shape (n,)
        Nominal values.
    continuous : bool
        Whether all of ``v`` are real numbers.

    Attributes
    ----------
    evaluations : int
        Number of evaluations of `g`.
    """

    def __init__(self, g: Callable[[Array], Array], scale: Array, continuous: bool = True):
        self._g = g
        self._scale = scale
        self._continuous = continuous
        self._jacobian: Array | None = None
        self.evaluations = 0

    def solve(self, v: Array) -> Array:
        """Return the fixed point near ``v``; the last evaluation of `g` is at the solution.

        Raises
        ------
        UserError
            If none is found.
        """
        with np.errstate(all="ignore"):  # NaN and infinity are handled
            return self._solve(v)

    def _solve(self, v: Array) -> Array:
        """Do the work of `solve`, with variables x and residuals r over the nominal values.

        A step that more than doubles the error is halved until it does not. After a halved step,
        and after some updates, the Jacobian is measured anew.
        """
        before = self.evaluations
        limit = before + _MOST_EVALUATIONS
        updates_left = _MOST_UPDATES  # of the Jacobian, before it is measured again
        x = v / self._scale
        r = self._residual(x)
        magnitude = 1.0 + np.abs(x)

        def error(x: Array, r: Array) -> float:
            """Return the largest residual relative to the tolerance; infinite if not a number."""
            largest = float(np.max(np.abs(r) / (TOLERANCE * magnitude + _ROUNDING * np.abs(x))))
            return largest if np.isfinite(largest) else np.inf

        def is_too_long(step: Array, r_new: Array) -> bool:
            may_halve = self._continuous and self.evaluations < limit
            return may_halve and error(x + step, r_new) > 2.0 * error(x, r)

        while 1.0 < error(x, r) < np.inf and self.evaluations < limit:
            step = self._step(x, r, updates_left == 0)
            if not step.any():
                break
            updates_left = updates_left - 1 if updates_left else _MOST_UPDATES
            r_new = self._residual(x + step)
            while is_too_long(step, r_new):
                step = 0.5 * step
                updates_left = 0
                r_new = self._residual(x + step)
            self._update_jacobian(step, r_new - r)
            x = x + step
            r = r_new
        if error(x, r) > 1.0:
            self._jacobian = None
            raise UserError(
                f"no solution found in {self.evaluations - before} evaluations; the"
                f" residual of the loop is still {np.max(np.abs(r * self._scale)):.3g}"
            )
        return x * self._scale

    def _update_jacobian(self, step: Array, change: Array) -> None:
        """Correct the Jacobian by the change of the residual over a step (Broyden's update)."""
        if self._jacobian is not None:
            unexplained = change - self._jacobian @ step
            self._jacobian = self._jacobian + np.outer(unexplained, step) / (step @ step)

    def _residual(self, x: Array) -> Array:
        """Return the values after one pass of the loop minus those before, in nominal values."""
        self.evaluations += 1
        return self._g(x * self._scale) / self._scale - x

    def _step(self, x: Array, r: Array, measure_jacobian: bool) -> Array:
        """Return Newton's step, or that of plain iteration with booleans or integers.

        Raises
        ------
        UserError
            If the Jacobian is not finite.
        """
        if not self._continuous:
            return r
        if self._jacobian is None or measure_jacobian:
            sizes = _DIFFERENCE * (1.0 + np.abs(x))
            # each move changes one value, so that its sum is the size
            columns = [(self._residual(x + move) - r) / move.sum() for move in np.diag(sizes)]
            self._jacobian = np.column_stack(columns)
        if not np.isfinite(self._jacobian).all():
            raise UserError("near the start of the search an output is no number")
        return np.asarray(np.linalg.lstsq(self._jacobian, -r, rcond=None)[0], dtype=np.float64)
