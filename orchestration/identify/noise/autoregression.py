"""Autoregressions as models of the colour of a residual (Box and Jenkins), by Yule and Walker."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from fmus.kit.arrays import Array, Mask

ORDER = 4  # highest order that is tried


def segments(present: Mask) -> list[tuple[int, int]]:
    """Return the stretches of a record without a gap.

    Parameters
    ----------
    present : ndarray of bool, shape (n,)

    Returns
    -------
    list of tuple of int
        First and one past the last, as positions among the samples that are present.
    """
    where = np.flatnonzero(present)
    breaks = np.flatnonzero(np.diff(where) > 1) + 1
    ends = [0, *breaks.tolist(), len(where)]
    return [(a, b) for a, b in pairwise(ends) if b > a]


def estimate_colour(residual: Array, present: Mask, order: int = ORDER) -> Array:
    """Return the coefficients of the autoregression of a residual, its order chosen by BIC.

    Parameters
    ----------
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
        Where it was measured; m of them.
    order : int
        Highest that is considered.

    Returns
    -------
    ndarray, shape (p,)
    """
    if order == 0 or not residual.any():
        return np.empty(0)
    n = len(residual)
    ends = segments(present)
    lags = range(_highest_order(order, n) + 1)
    with np.errstate(over="ignore", invalid="ignore"):  # of one that runs away, as below
        covariance = [
            sum(float(residual[a : b - k] @ residual[a + k : b]) for a, b in ends if b - a > k)
            for k in lags
        ]
    return yule_walker(np.array(covariance) / n, n)[0]


def _highest_order(order: int, samples: int) -> int:
    """Return the highest order up to `order` that a number of samples allows."""
    return min(order, max(samples // 10, 0))


def fit_autoregression(values: Array, most: int = ORDER) -> tuple[Array, float]:
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
    lags = range(_highest_order(most, n) + 1)
    covariance = np.array([values[: n - lag] @ values[lag:] for lag in lags]) / n
    return yule_walker(covariance, n)


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
        As of :func:`fit_autoregression`.

    Raises
    ------
    LinAlgError
        If the covariance is not finite.
    """
    best: tuple[Array, float] = (np.empty(0), float(covariance[0]))
    if covariance[0] <= 0.0:
        return best
    if len(covariance) > 1 and not np.isfinite(covariance[0]):
        # of a residual that has run away; LAPACK would fail as well, and print to standard error
        raise np.linalg.LinAlgError("the covariance of a residual is not finite")
    least = n * np.log(covariance[0])
    for order in range(1, len(covariance)):
        toeplitz = covariance[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        coefficients: Array = np.linalg.lstsq(toeplitz, covariance[1 : order + 1])[0].astype(float)
        variance = float(covariance[0] - coefficients @ covariance[1 : order + 1])
        bic = n * np.log(variance) + order * np.log(n) if variance > 0.0 else np.inf
        if bic < least:
            least = bic
            best = (coefficients, variance)
    return best
