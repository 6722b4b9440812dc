"""The noise of an output: an autoregression of its residual, and the filter that makes it white (Box and Jenkins)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import norm

Array = NDArray[np.float64]
ORDER = 4  # highest that is tried
_LEAST = 1e-100  # deviation: a derivative over it must still have a square


@dataclass(frozen=True)
class Noise:
    """``e[k] = sum_i coefficients[i] e[k-1-i] + w[k]`` with white w.

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
    deviation : float
        Standard deviation of w, in the unit of the output.
    memory : int
        Samples dropped after every gap, the same for every candidate of one record, whatever the order that it takes.
    """

    coefficients: Array
    deviation: float
    memory: int = ORDER

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
        pieces = [self._filtered(values[a:b]) for a, b in segments(present, self.memory)]
        return np.concatenate(pieces) if pieces else values[:0]

    def backwards(self, values: Array) -> Array:
        """Filter the columns of a Jacobian by the noise model, backwards in time.

        With e = H w the scores J'e have the covariance J'HH'J var(w), and this is H'J times the deviation of w (Ljung:
        System Identification, section 9.4).

        Parameters
        ----------
        values : ndarray, shape (m, p)

        Returns
        -------
        ndarray, shape (m, p)
        """
        return np.asarray(lfilter([self.deviation], [1.0, *-self.coefficients], values[::-1], axis=0)[::-1])

    def kept(self, present: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Return the samples that innovations belong to.

        Parameters
        ----------
        present : ndarray of bool, shape (n,)

        Returns
        -------
        ndarray of int, shape (m - dropped,)
        """
        where = np.flatnonzero(present)
        return np.concatenate([where[:0], *(where[a + self.memory : b] for a, b in segments(present, self.memory))])

    def _filtered(self, piece: Array) -> Array:
        n = len(piece)
        result = piece[self.memory :].copy()
        for lag, coefficient in enumerate(self.coefficients, start=1):
            result -= coefficient * piece[self.memory - lag : n - lag]
        return result / self.deviation


def segments(present: NDArray[np.bool_], memory: int = ORDER) -> list[tuple[int, int]]:
    """Stretches without a gap, longer than the memory.

    Parameters
    ----------
    present : ndarray of bool, shape (n,)
    memory : int
        Samples.

    Returns
    -------
    list of tuple of int
        First and one past the last, as positions among the samples that are present.
    """
    where = np.flatnonzero(present)
    breaks = np.flatnonzero(np.diff(where) > 1) + 1
    ends = [0, *breaks.tolist(), len(where)]
    return [(a, b) for a, b in pairwise(ends) if b - a > memory]


def white(residual: Mapping[str, Array], memory: int = ORDER) -> dict[str, Noise]:
    """White noise of the size of residuals.

    Parameters
    ----------
    residual : Mapping of str to ndarray, shape (m,)
        By output.
    memory : int
        See `Noise`.

    Returns
    -------
    dict of str to Noise
    """
    return {o: Noise(np.empty(0), float(np.sqrt(np.mean(e**2))) or _LEAST, memory) for o, e in residual.items()}


def estimate(residual: Array, present: NDArray[np.bool_], order: int = ORDER) -> Noise:
    """Noise of a residual; its order is chosen by BIC.

    Parameters
    ----------
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
    order : int
        Highest that is considered; 0 for white noise.

    Returns
    -------
    Noise
    """
    if order == 0:
        return white({"": residual}, 0)[""]
    longest = max(segments(present, order), key=lambda ends: ends[1] - ends[0], default=(0, len(residual)))
    coefficients, _ = autoregression(residual[slice(*longest)], order)
    innovation = Noise(coefficients, 1.0, order).whiten(residual, present)
    deviation = float(np.sqrt(np.mean(innovation**2))) if innovation.size else 1.0
    return Noise(coefficients, deviation or _LEAST, order)


def autoregression(values: Array, most: int = ORDER) -> tuple[Array, float]:
    """Fit a stationary autoregression by Yule-Walker, its order chosen by BIC.

    Parameters
    ----------
    values : ndarray, shape (n,)
        A series; its mean is taken as zero.
    most : int
        Highest order considered.

    Returns
    -------
    coefficients : ndarray, shape (p,)
        ``e[k] = sum_i coefficients[i] e[k-1-i] + w[k]``.
    variance : float
        Of the innovations w.
    """
    n = len(values)
    most = min(most, max(n // 10, 0))
    return yule_walker(np.array([values[: n - k] @ values[k:] for k in range(most + 1)]) / n, n)


def yule_walker(covariance: Array, n: int) -> tuple[Array, float]:
    """Fit a stationary autoregression to a covariance, its order chosen by BIC.

    Parameters
    ----------
    covariance : ndarray, shape (m + 1,)
        At the first lags; its length gives the highest order considered.
    n : int
        Samples that it is of.

    Returns
    -------
    coefficients, variance
        As of :func:`autoregression`.
    """
    best: tuple[Array, float] = (np.empty(0), float(covariance[0]))
    if covariance[0] <= 0.0:
        return best
    least = n * np.log(covariance[0])
    for order in range(1, len(covariance)):
        toeplitz = covariance[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        coefficients: Array = np.linalg.lstsq(toeplitz, covariance[1 : order + 1])[0].astype(float)
        variance = float(covariance[0] - coefficients @ covariance[1 : order + 1])
        if variance > 0.0 and (bic := n * np.log(variance) + order * np.log(n)) < least:
            least, best = bic, (coefficients, variance)
    return best


def noise_std(values: Array, differences: int = 2) -> float:
    """Standard deviation of white noise on a signal, robustly from its differences; steps of the signal do no harm.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN is a gap.
    differences : int
        How often the signal is differenced: the k-th difference of white noise has its variance times (2k)! / k!^2.

    Returns
    -------
    float
        In the unit of the signal; zero if there are too few samples.
    """
    steps = np.diff(values[np.isfinite(values)], differences)
    scale = float(norm.ppf(0.75)) * np.sqrt(comb(2 * differences, differences))
    return float(np.median(np.abs(steps)) / scale) if steps.size else 0.0
