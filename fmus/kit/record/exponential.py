"""The integrator of a stiff component over a record, for the laws in CasADi's virtual machine.

The same operations in the same order as ``fmi2/exponential.c``, where the method is explained.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fmus.kit.record.linearisation import ROUNDED, Ladder

Array = NDArray[np.float64]
SHARE = 0.01  # of the tolerance, which a step may take: slopes by parameters are to be as good as signals
SAME = 1e-9  # relative: steps this close are the same
_LONGER = (
    1.0 / 32.0
)  # error, relative to what is tolerated, below which twice the step can be tried


class ExponentialIntegrator:
    """Steps of `largest / 2**level` with the functions of a ladder.

    Parameters
    ----------
    ladder : Ladder
    rates : callable
        Rates (m,) from the time and the states (m,).
    nominal : ndarray, shape (m,)
        Of the states.
    tolerance : float
    start : float
        Time at which the record begins.

    Attributes
    ----------
    level : int
        Of the step to try next.
    """

    def __init__(
        self,
        ladder: Ladder,
        rates: Callable[[float, Array], Array],
        nominal: Array,
        tolerance: float,
        start: float,
    ):
        self.level = self._steps = 0
        self._ladder, self._rates, self._nominal = ladder, rates, nominal
        self._tolerance, self._start = tolerance, start

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
            Where the step ended; where it began, if it was rejected.
        x : ndarray
        None
            If what remains is shorter than the shortest step, or so many steps were made that others cost less.
        """
        if self._steps > self._ladder.worth * (target - self._start):
            return None
        ladder, remaining, level = self._ladder, target - now, self.level
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
        left = remaining - h
        return target, x + moved + (
            left * self._rates(target, x + moved) if abs(left) > SAME * remaining else 0.0
        )

    def _product(self, matrix: Array, v: Array) -> Array:
        """Product with a matrix that is kept as the stack of its blocks."""
        blocks = v.reshape(len(matrix), -1)
        product: Array = blocks @ matrix[0].T
        product[1:] += matrix[1:] @ blocks[0]
        return product.ravel()

    def _phi(self, level: int, order: int, v: Array) -> Array:
        return self._product(self._ladder.phi[level, order - 1], v)

    def _changed(self, now: float, x: Array, rate: Array, moved: Array) -> Array:
        return self._rates(now, x + moved) - rate - self._product(self._ladder.matrix, moved)

    def _affine(
        self, now: float, h: float, level: int, x: Array, sloped: bool
    ) -> tuple[Array, float]:
        rate = self._rates(now, x)
        moved = np.zeros_like(x)
        if sloped:
            moved += h * self._phi(level, 2, self._changed(now + h, x, rate, moved))
        moved = moved + h * self._phi(level, 1, rate)
        return moved, 0.0 if np.isfinite(moved).all() else math.inf

    def _krogstad(self, now: float, h: float, level: int, x: Array) -> Array:
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
        one, half = self._krogstad(now, h, level, x), self._krogstad(now, 0.5 * h, level + 1, x)
        both = half + self._krogstad(now + 0.5 * h, 0.5 * h, level + 1, x + half)
        difference = (both - one) / 15.0
        error = np.abs(difference) / (SHARE * self._tolerance) / (self._nominal + np.abs(x))
        return both + difference, float(error.max()) if np.isfinite(error).all() else math.inf
