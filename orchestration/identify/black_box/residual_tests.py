"""Residual tests: whiteness, and independence of the inputs (Ljung, section 16.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz
from scipy.signal import correlate
from scipy.special import chdtrc, ndtri

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify.black_box.polynomials import columns_of
from orchestration.identify.noise import Whiteness, whiteness

# eigenvalue of a correlation matrix, relative to the largest, below which its direction is ignored
_SINGULAR = 1e-9


@dataclass(frozen=True)
class ResidualInputCorrelation:
    """Cross-correlation of a residual with an input, dimensionless.

    Attributes
    ----------
    lags : ndarray of int, shape (2 k + 1,)
        In samples; where positive the input comes first, where negative the residual does, as under
        feedback.
    values : ndarray, shape (2 k + 1,)
    limit : float
        Confidence limit of every value if the two are independent.
    statistic, p_value : float
        Of the lags from zero on together, and the probability of as much under independence.
    significance : float
    """

    lags: NDArray[np.int_]
    values: Array
    limit: float
    statistic: float
    p_value: float
    significance: float

    @property
    def is_independent(self) -> bool:
        """True if independence of past inputs is not rejected."""
        return self.p_value >= self.significance


@dataclass(frozen=True)
class ResidualTests:
    """The results of :func:`residual_tests`.

    Attributes
    ----------
    autocorrelation : ndarray, shape (k + 1,)
        Of the residual at lags 0 to k; the first is one.
    limit : float
        Confidence limit of every value but the first if the residual is white.
    whiteness : Whiteness
        Of all lags together, by Ljung and Box.
    inputs : tuple of ResidualInputCorrelation, length m
    """

    autocorrelation: Array
    limit: float
    whiteness: Whiteness
    inputs: tuple[ResidualInputCorrelation, ...]

    @property
    def passed(self) -> bool:
        """True if the residual is white and independent of every past input."""
        return self.whiteness.is_white and all(cross.is_independent for cross in self.inputs)


def residual_tests(
    residual: ArrayLike, inputs: ArrayLike, lags: int = 25, significance: float = 0.01
) -> ResidualTests:
    """Test a residual for whiteness, and for independence of the inputs.

    The limits for cross-correlations allow for the colour of both signals, ``P = sum_k R_e(k)
    R_u(k)`` (Ljung, section 16.6), with the residual's autocovariance up to the number of lags. The
    number of fitted parameters is ignored, so that a right model is rejected somewhat less often
    than the significance states.

    Parameters
    ----------
    residual : array_like, shape (n,)
        Equally spaced, any unit.
    inputs : array_like, shape (n, m)
    lags : int
        Largest lag, in samples.
    significance : float
        False alarm rate of each test, and of each limit.

    Returns
    -------
    ResidualTests

    Raises
    ------
    UserError
        If shapes do not agree, a sample is not finite, the residual is constant, the significance
        is no probability, there are no lags or more than a quarter of the samples.
    """
    e = np.asarray(residual, dtype=np.float64)
    u = columns_of(inputs)
    if e.ndim != 1 or u.ndim != 2 or len(u) != len(e):
        raise UserError(
            f"residual of shape {e.shape} and inputs of {u.shape}: must be (n,) and (n, m)"
        )
    if not 0.0 < significance < 1.0:
        raise UserError(f"significance = {significance:g}: must be between 0 and 1")
    if not 1 <= lags <= len(e) // 4:
        raise UserError(f"lags = {lags}: must be from 1 to a quarter of the {len(e)} samples")
    if not (np.isfinite(e).all() and np.isfinite(u).all()) or np.ptp(e) == 0.0:
        raise UserError("residual and inputs must be finite numbers, and the residual not constant")
    r_e = _cross_covariance(e, e, lags)
    return ResidualTests(
        r_e[lags:] / r_e[lags],
        float(-ndtri(significance / 2.0)) / np.sqrt(len(e)),
        whiteness(e, lags, significance),
        tuple(_correlate_with_input(e, column, r_e, lags, significance) for column in u.T),
    )


def _cross_covariance(x: Array, y: Array, lags: int) -> Array:
    """Return the mean of ``x(t) y(t - k)`` about the means, k from minus to plus the lags."""
    middle = len(x) - 1
    products = correlate(x - x.mean(), y - y.mean(), method="fft")
    return products[middle - lags : middle + lags + 1] / len(x)


def _correlate_with_input(
    e: Array, u: Array, r_e: Array, lags: int, significance: float
) -> ResidualInputCorrelation:
    """Correlate a residual with one input.

    The residual's autocovariance R_e (2 lags + 1,) is given from minus to plus the lags.
    """
    n = len(e)
    all_lags = np.arange(-lags, lags + 1)
    r_u = _cross_covariance(u, u, 2 * lags)
    power = r_u[2 * lags]
    if power == 0.0:
        none = np.zeros(len(all_lags))
        return ResidualInputCorrelation(all_lags, none, 0.0, 0.0, 1.0, significance)
    values = _cross_covariance(e, u, lags)
    # covariance of the estimates at lags k and l: sum_s R_e(s) R_u(s + k - l) / n
    covariance = np.correlate(r_u, r_e, "valid")[lags:]
    statistic, freedom = _joint_statistic(values[lags:], covariance / n)
    scale = np.sqrt(r_e[lags] * power)
    limit = float(-ndtri(significance / 2.0)) * np.sqrt(max(covariance[0], 0.0) / n) / scale
    p_value = float(chdtrc(freedom, statistic))
    return ResidualInputCorrelation(
        all_lags, values / scale, float(limit), statistic, p_value, significance
    )


def _joint_statistic(values: Array, covariance: Array) -> tuple[float, int]:
    """Return the sum of squares of decorrelated values over their variances, and their number.

    Parameters
    ----------
    values : ndarray, shape (k,)
        Covariances at the lags from zero on.
    covariance : ndarray, shape (k,)
        Of any two of them, by the difference of their lags.
    """
    eigenvalues, directions = np.linalg.eigh(toeplitz(covariance))
    kept = eigenvalues > _SINGULAR * eigenvalues[-1]
    statistic = float(np.sum((directions[:, kept].T @ values) ** 2 / eigenvalues[kept]))
    return statistic, int(np.count_nonzero(kept))
