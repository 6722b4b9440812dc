"""The exponential integrator for stiff components, in Python, for interpreted laws.

The operations and their order are those of ``fmi2/exponential.c``, where the method is explained.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.record.linearisation import ROUNDED, Ladder

# share of the tolerance that the error of a step may reach: sensitivities are to be as good as
# signals
SHARE = 0.01
SAME = 1e-9  # relative difference of steps that are the same
_LONGER = 1.0 / 32.0  # error over the tolerated one, below which twice the step can be tried


class ExponentialIntegrator:
    """An integrator with steps of `largest / 2**level` and the matrix functions of a ladder.

    Parameters
    ----------
    ladder : Ladder
    rates : callable
        Rates (m,) from the time and the states (m,).
    nominal : ndarray, shape (m,)
        Nominal values of the states.
    tolerance : float
    start : float
        Time at which the record begins.

    Attributes
    ----------
    level : int
        Level of the step to try next.
    """

    def __init__(
        self,
        ladder: Ladder,
        rates: Callable[[float, Array], Array],
        nominal: Array,
        tolerance: float,
        start: float,
    ):
        self.level = 0
        self._steps = 0
        self._ladder = ladder
        self._rates = rates
        self._nominal = nominal
        self._tolerance = tolerance
        self._start = start

    def step(self, now: float, target: float, x: Array, sloped: bool) -> tuple[float, Array] | None:
        """Take the longest step towards a time that is accurate enough.

        Parameters
        ----------
        now, target : float
        x : ndarray, shape (m,)
        sloped : bool
            Whether inputs change during the step.

        Returns
        -------
        time : float
            End of the step; its begin, if it was rejected.
        x : ndarray
        None
            If the time to the target is shorter than the shortest step, or so many steps were made
            that the Runge-Kutta method costs less.
        """
        if self._steps > self._ladder.worth * (target - self._start):
            return None
        ladder = self._ladder
        remaining = target - now
        level = self.level
        while level < ladder.levels and ladder.largest * 0.5**level > remaining * (1.0 + ROUNDED):
            level += 1
        if level >= ladder.levels:
            self.level = min(self.level, ladder.levels - 1)
            return None
        h = ladder.largest * 0.5**level
        self._steps += 1
        with np.errstate(all="ignore"):  # a trial step that overflows is rejected
            moved, error = (
                self._affine(now, h, level, x, sloped)
                if ladder.affine
                else self._step_and_halves(now, h, level, x)
            )
        if not error <= 1.0:
            self.level = level + 1
            return now, x
        if error < _LONGER and level == self.level:
            self.level = max(level - 1, 0)
        if h < remaining * (1.0 - ROUNDED):
            return now + h, x + moved
        gap = remaining - h
        last = gap * self._rates(target, x + moved) if abs(gap) > SAME * remaining else 0.0
        return target, x + moved + last

    def _product(self, matrix: Array, v: Array) -> Array:
        """Return the product with a matrix that is stored as the stack of its blocks."""
        blocks = v.reshape(len(matrix), -1)
        product: Array = blocks @ matrix[0].T
        product[1:] += matrix[1:] @ blocks[0]
        return product.ravel()

    def _phi(self, level: int, order: int, v: Array) -> Array:
        """Return the product with phi of a level and an order."""
        return self._product(self._ladder.phi[level, order - 1], v)

    def _changed(self, now: float, x: Array, rate: Array, moved: Array) -> Array:
        """Return the change of the rates that A x does not account for."""
        return self._rates(now, x + moved) - rate - self._product(self._ladder.matrix, moved)

    def _affine(
        self, now: float, h: float, level: int, x: Array, sloped: bool
    ) -> tuple[Array, float]:
        """Return the change of the states in a step that is exact, and an error of zero."""
        rate = self._rates(now, x)
        moved = np.zeros_like(x)
        if sloped:
            moved += h * self._phi(level, 2, self._changed(now + h, x, rate, moved))
        moved = moved + h * self._phi(level, 1, rate)
        return moved, 0.0 if np.isfinite(moved).all() else math.inf

    def _krogstad(self, now: float, h: float, level: int, x: Array) -> Array:
        """Return the change of the states in a step of Krogstad's method."""
        rate = self._rates(now, x)
        moved = 0.5 * h * self._phi(level + 1, 1, rate)
        d2 = self._changed(now + 0.5 * h, x, rate, moved)
        d3 = self._changed(now + 0.5 * h, x, rate, moved + h * self._phi(level + 1, 2, d2))
        plain = h * self._phi(level, 1, rate)
        d4 = self._changed(now + h, x, rate, plain + 2.0 * h * self._phi(level, 2, d3))
        both = d2 + d3
        return (
            plain
            + h * self._phi(level, 2, 2.0 * both - d4)
            + h * self._phi(level, 3, 4.0 * (d4 - both))
        )

    def _step_and_halves(self, now: float, h: float, level: int, x: Array) -> tuple[Array, float]:
        """Return the change of the states, extrapolated from two half steps, and its error."""
        one = self._krogstad(now, h, level, x)
        half = self._krogstad(now, 0.5 * h, level + 1, x)
        both = half + self._krogstad(now + 0.5 * h, 0.5 * h, level + 1, x + half)
        difference = (both - one) / 15.0
        error = np.abs(difference) / (SHARE * self._tolerance) / (self._nominal + np.abs(x))
        return both + difference, float(error.max()) if np.isfinite(error).all() else math.inf
