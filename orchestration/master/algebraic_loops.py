"""Algebraic loops: inputs and outputs that determine each other at the same time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError

Array = NDArray[np.float64]
TOLERANCE = 1e-10  # of nominal value plus magnitude before
_ROUNDING = 1e-13  # of the magnitude
_EVALUATIONS = 200
_PATIENCE = 8  # steps with a Jacobian that is only updated, before it is measured anew


class FixedPoint:
    """Solves ``v = g(v)`` again and again, each time from the solution before.

    Newton's method. The Jacobian of ``g(v) - v`` is measured by differences once, and then only updated (Broyden); it
    is measured anew where that does not lead to the goal. Booleans and integers have no Jacobian: with one of them in
    the loop, values are passed around until nothing changes.

    Parameters
    ----------
    g : callable
        What the inputs receive if they are ``v``.
    scale : ndarray, shape (n,)
        Nominal values.
    continuous : bool
        Whether all of ``v`` are real numbers.

    Attributes
    ----------
    evaluations : int
        How often `g` was asked.
    """

    def __init__(self, g: Callable[[Array], Array], scale: Array, continuous: bool = True):
        self._g, self._scale, self._continuous = g, scale, continuous
        self._jacobian: Array | None = None
        self.evaluations = 0

    def solve(self, v: Array) -> Array:
        """Find the fixed point near ``v``; `g` is last asked for the solution.

        Raises
        ------
        UserError
            If none is found.
        """
        with np.errstate(all="ignore"):  # what is no number is noticed
            return self._solve(v)

    def _solve(self, v: Array) -> Array:
        limit, patience = self.evaluations + _EVALUATIONS, _PATIENCE
        x = v / self._scale
        r, usual = self._residual(x), 1.0 + np.abs(x)

        def error(x: Array, r: Array) -> float:
            """Largest residual over what is tolerated; infinite if it is no number."""
            largest = float(np.max(np.abs(r) / (TOLERANCE * usual + _ROUNDING * np.abs(x))))
            return largest if np.isfinite(largest) else np.inf

        while 1.0 < error(x, r) < np.inf and self.evaluations < limit:
            step = self._step(x, r, patience == 0)
            if not step.any():
                break  # nowhere to go
            patience = patience - 1 if patience else _PATIENCE
            r_new = self._residual(x + step)
            while (
                self._continuous
                and self.evaluations < limit
                and error(x + step, r_new) > 2.0 * error(x, r)
            ):
                step, patience = 0.5 * step, 0  # too far
                r_new = self._residual(x + step)
            if self._jacobian is not None:
                change = r_new - r - self._jacobian @ step
                self._jacobian = self._jacobian + np.outer(change, step) / (step @ step)
            x, r = x + step, r_new
        if error(x, r) > 1.0:
            self._jacobian = None
            raise UserError(
                f"no solution found in {self.evaluations - limit + _EVALUATIONS} evaluations; what comes around "
                f"still differs by {np.max(np.abs(r * self._scale)):.3g}"
            )
        return x * self._scale

    def _residual(self, x: Array) -> Array:
        self.evaluations += 1
        return self._g(x * self._scale) / self._scale - x

    def _step(self, x: Array, r: Array, anew: bool) -> Array:
        if not self._continuous:
            return r
        if self._jacobian is None or anew:
            sizes = 1e-6 * (1.0 + np.abs(x))
            columns = [(self._residual(x + move) - r) / move.sum() for move in np.diag(sizes)]
            self._jacobian = np.column_stack(columns)
        if not np.isfinite(self._jacobian).all():
            raise UserError("near the start of the search an output is no number")
        return np.asarray(np.linalg.lstsq(self._jacobian, -r, rcond=None)[0], dtype=np.float64)
