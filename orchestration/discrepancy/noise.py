"""The colour of what is left: an autoregression for each output, and the filter that makes it white."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.grey_box import autoregression

Array = NDArray[np.float64]
ORDER = 4  # highest that is tried; as many samples are dropped after every gap, whatever the order


@dataclass(frozen=True)
class Noise:
    """``e[k] = sum_i coefficients[i] e[k-1-i] + w[k]`` with white w.

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
    deviation : float
        Standard deviation of w, in the unit of the output.
    """

    coefficients: Array
    deviation: float

    def whiten(self, values: Array, present: NDArray[np.bool_]) -> Array:
        """Filter a residual, or every column of its Jacobian, into innovations over their standard deviation.

        Parameters
        ----------
        values : ndarray, shape (m,) or (m, p)
            Where something was measured.
        present : ndarray of bool, shape (n,)
            Where that was; m of them.

        Returns
        -------
        ndarray, shape (m - dropped,) or (m - dropped, p)
        """
        pieces = [self._filtered(values[a:b]) for a, b in segments(present)]
        return np.concatenate(pieces) if pieces else values[:0]

    @staticmethod
    def kept(present: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Return the samples that innovations belong to."""
        where = np.flatnonzero(present)
        return np.concatenate([where[:0], *(where[a + ORDER : b] for a, b in segments(present))])

    def _filtered(self, piece: Array) -> Array:
        n = len(piece)
        result = piece[ORDER:].copy()
        for lag, coefficient in enumerate(self.coefficients, start=1):
            result -= coefficient * piece[ORDER - lag : n - lag]
        return result / self.deviation


def segments(present: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stretches without a gap, as positions among the samples that are present."""
    where = np.flatnonzero(present)
    breaks = np.flatnonzero(np.diff(where) > 1) + 1
    ends = [0, *breaks.tolist(), len(where)]
    return [(a, b) for a, b in pairwise(ends) if b - a > ORDER]


def estimate(residual: Array, present: NDArray[np.bool_]) -> Noise:
    """Noise of a residual; its order is chosen by BIC.

    Parameters
    ----------
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)

    Returns
    -------
    Noise
    """
    longest = max(segments(present), key=lambda ends: ends[1] - ends[0], default=(0, len(residual)))
    coefficients, _ = autoregression(residual[slice(*longest)], ORDER)
    white = Noise(coefficients, 1.0).whiten(residual, present)
    deviation = float(np.sqrt(np.mean(white**2))) if white.size else 1.0
    return Noise(coefficients, deviation or np.finfo(float).tiny)
