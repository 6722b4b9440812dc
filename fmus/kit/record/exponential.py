"""The exponential integrator for stiff components, in Python, for interpreted laws.

The operations and their order are those of ``fmi/exponential.c``, which explains the method.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.record.linearisation import ROUNDED, Ladder

# largest error of a step relative to the tolerance, small so that sensitivities are as accurate as
# signals
SHARE = 0.01
SAME = 1e-9  # relative difference below which two steps are the same
_LONGER = 1.0 / 32.0  # error relative to the largest one, below which the step is doubled


class ExponentialIntegrator:
    """An integrator with steps of `largest / 2**level` and the matrix functions of a ladder.

    Parameters
    ----------
    ladder : Ladder
    rates : callable
        Rates of the m states, shape (m,), from the time in s and the states, shape (m,).
    nominal : ndarray, shape (m,)
        Nominal values of the states.
    tolerance : float
        Accuracy of an internal step, relative to ``nominal + |state|``.
    start : float
        Start time of the record, s.

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
        """Try one step towards a target time.

        Parameters
        ----------
        now, target : float
            Times, s.
        x : ndarray, shape (m,)
            States at ``now``.
        sloped : bool
            Whether inputs change during the step.

        Returns
        -------
        tuple of float and ndarray, or None
            Time and states at the end of the step, or at its start if its error was too large. None
            if the target is nearer than the shortest step, or if so many steps were made that the
            Runge-Kutta method costs less.
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
            change, error = (
                self._exact_step(now, h, level, x, sloped)
                if ladder.affine
                else self._step_and_halves(now, h, level, x)
            )
        if not error <= 1.0:
            self.level = level + 1
            return now, x
        if error < _LONGER and level == self.level:
            self.level = max(level - 1, 0)
        if h < remaining * (1.0 - ROUNDED):
            return now + h, x + change
        # the step ends at the target but for the rounding of the sampling clock
        gap = remaining - h
        last = gap * self._rates(target, x + change) if abs(gap) > SAME * remaining else 0.0
        return target, x + change + last

    def _product(self, matrix: Array, v: Array) -> Array:
        """Return the product with a matrix that is stored as the stack of its blocks."""
        blocks = v.reshape(len(matrix), -1)
        product: Array = blocks @ matrix[0].T
        product[1:] += matrix[1:] @ blocks[0]
        return product.ravel()

    def _phi(self, level: int, order: int, v: Array) -> Array:
        """Return ``phi_order(h A) v`` for the step h of a level."""
        return self._product(self._ladder.phi[level, order - 1], v)

    def _nonlinear(self, now: float, x: Array, rate: Array, change: Array) -> Array:
        """Return the change of the rates less that of their linear part, A x."""
        return self._rates(now, x + change) - rate - self._product(self._ladder.matrix, change)

    def _exact_step(
        self, now: float, h: float, level: int, x: Array, sloped: bool
    ) -> tuple[Array, float]:
        """Return the change of the states in an exact step, and its error: 0, or infinity."""
        rate = self._rates(now, x)
        by_slope = np.zeros_like(x)
        if sloped:
            by_slope += h * self._phi(level, 2, self._nonlinear(now + h, x, rate, by_slope))
        change = by_slope + h * self._phi(level, 1, rate)
        return change, 0.0 if np.isfinite(change).all() else math.inf

    def _krogstad_step(self, now: float, h: float, level: int, x: Array) -> Array:
        """Return the change of the states in a step of Krogstad's method, of order 4.

        Krogstad: Generalized integrating factor methods for stiff PDEs, J. Comput. Phys. 203, 2005.
        """
        rate = self._rates(now, x)
        half = 0.5 * h * self._phi(level + 1, 1, rate)
        d2 = self._nonlinear(now + 0.5 * h, x, rate, half)
        d3 = self._nonlinear(now + 0.5 * h, x, rate, half + h * self._phi(level + 1, 2, d2))
        linear = h * self._phi(level, 1, rate)
        d4 = self._nonlinear(now + h, x, rate, linear + 2.0 * h * self._phi(level, 2, d3))
        both = d2 + d3
        return (
            linear
            + h * self._phi(level, 2, 2.0 * both - d4)
            + h * self._phi(level, 3, 4.0 * (d4 - both))
        )

    def _step_and_halves(self, now: float, h: float, level: int, x: Array) -> tuple[Array, float]:
        """Return the change of the states by Richardson extrapolation, and its relative error.

        One step of length h is compared with two of half the length.
        """
        one = self._krogstad_step(now, h, level, x)
        half = self._krogstad_step(now, 0.5 * h, level + 1, x)
        both = half + self._krogstad_step(now + 0.5 * h, 0.5 * h, level + 1, x + half)
        difference = (both - one) / 15.0  # 2**4 - 1, as the method has order 4
        error = np.abs(difference) / (SHARE * self._tolerance) / (self._nominal + np.abs(x))
        return both + difference, float(error.max()) if np.isfinite(error).all() else math.inf
