"""Autoregressions as models of the colour of a residual (Box and Jenkins), by Yule and Walker."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.linalg import toeplitz

from fmus.kit.arrays import Array
from orchestration.identify.filters import autoregression

_ORDER = 4  # highest order that is tried


@dataclass(frozen=True)
class Autoregression:
    """``e[k] = sum_i coefficients[i] e[k-1-i] + deviation w[k]`` with white w of unit variance.

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
    deviation : float
        Standard deviation of an innovation, in the unit of the series.
    """

    coefficients: Array
    deviation: float

    def backwards(self, values: Array) -> Array:
        """Filter the columns of a Jacobian by the autoregression, backwards in time.

        With e = H w the scores J'e have the covariance J'HH'J var(w), and this is H'J times the
        deviation of w (Ljung: System Identification, section 9.4).

        Parameters
        ----------
        values : ndarray, shape (m, p)

        Returns
        -------
        ndarray, shape (m, p)
        """
        reversed_result = autoregression([1.0, *-self.coefficients], values[::-1])
        return self.deviation * reversed_result[::-1]


def fit_autoregression(values: Array) -> Autoregression:
    """Fit a stationary autoregression by Yule-Walker, its order chosen by BIC.

    Parameters
    ----------
    values : ndarray, shape (n,)
        A series; its mean is taken as zero.
    """
    n = len(values)
    highest = min(_ORDER, n // 10)
    covariance = np.array([values[: n - lag] @ values[lag:] for lag in range(highest + 1)]) / n
    coefficients, variance = yule_walker(covariance, n)
    return Autoregression(coefficients, sqrt(variance))


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
    coefficients : ndarray, shape (p,)
    variance : float
        Of the innovations.

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
        lagged = covariance[1 : order + 1]
        coefficients: Array = np.linalg.lstsq(toeplitz(covariance[:order]), lagged)[0].astype(float)
        variance = float(covariance[0] - coefficients @ lagged)
        bic = n * np.log(variance) + order * np.log(n) if variance > 0.0 else np.inf
        if bic < least:
            least = bic
            best = (coefficients, variance)
    return best
