"""Ljung and Box's test of whether a residual is white (Biometrika 65, 1978)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, ndtri

from fmus.kit.arrays import Array, Mask

WHITENESS_SAMPLES = 20  # for every lag of a test, and so the fewest that a test needs


@dataclass(frozen=True)
class Whiteness:
    """The result of :func:`whiteness`, dimensionless.

    A constant residual has NaN figures and is not white.

    Attributes
    ----------
    samples, lags : int
        Finite samples used, and lags tested.
    statistic, p_value : float
        Ljung and Box's Q, and its probability under whiteness.
    lag_one : float
        Autocorrelation at the first lag.
    fraction_outside : float
        Of the lags, those whose autocorrelation is outside its 99 % band; 0.01 expected if white.
    significance : float
    """

    samples: int
    lags: int
    statistic: float
    p_value: float
    lag_one: float
    fraction_outside: float
    significance: float

    @property
    def is_white(self) -> bool:
        """True if the Ljung-Box test does not reject whiteness at the declared significance."""
        return self.p_value >= self.significance

    def summary(self) -> str:
        """Describe the verdict in a few words."""
        if np.isnan(self.p_value):
            return "constant"
        verdict = "white" if self.is_white else "not white"
        return f"{verdict} (p = {self.p_value:.2g}, lag-1 {self.lag_one:+.2f})"


def whiteness(
    residual: ArrayLike, lags: int | None = None, significance: float = 0.01
) -> Whiteness:
    """Test whether a residual is white, by Ljung and Box.

    The mean is removed first, so a constant offset is not counted against whiteness. Samples that
    are NaN are gaps: each lag uses the pairs that exist, with the variance that so many pairs have;
    without gaps this is the usual test.

    Parameters
    ----------
    residual : array_like, shape (n,)
        Equally spaced samples, any unit.
    lags : int, optional
        Number of lags; by default 25, or a twentieth of the samples if that is less, because with
        more lags the test raises too many false alarms (2 % instead of 1 % with a fifth of 100
        samples); so by default fewer than 20 samples are refused.
    significance : float
        False alarm rate of `Whiteness.is_white`.

    Returns
    -------
    Whiteness

    Raises
    ------
    ValueError
        If the residual is infinite, too short for the lags, or there are no lags.
    """
    values = np.asarray(residual, dtype=float)
    present = ~np.isnan(values)
    n = int(np.count_nonzero(present))
    count = min(25, n // WHITENESS_SAMPLES) if lags is None else lags
    if values.ndim != 1 or np.any(np.isinf(values)):
        raise ValueError("the residual must be a vector without infinite values")
    if not 0 < count < n:
        raise ValueError(f"lags = {count} for {n} samples: must be at least 1 and stay below {n}")
    if np.ptp(values[present]) == 0:
        undefined = float("nan")
        return Whiteness(n, count, undefined, undefined, undefined, undefined, significance)
    correlation, score, tested = _autocorrelations(values, present, count)
    statistic = float(score @ score)
    freedom = int(np.count_nonzero(tested))
    if freedom < 1:
        raise ValueError(f"the gaps leave none of {count} lags with pairs of samples")
    return Whiteness(
        samples=n,
        lags=count,
        statistic=statistic,
        p_value=float(chdtrc(freedom, statistic)),
        lag_one=float(correlation[0]),
        fraction_outside=float(np.mean(np.abs(score[tested]) > ndtri(0.995))),
        significance=significance,
    )


def _autocorrelations(values: Array, present: Mask, lags: int) -> tuple[Array, Array, Mask]:
    """Return the autocorrelations of a residual with gaps, about its mean.

    Returns
    -------
    correlation : ndarray, shape (lags,)
    score : ndarray, shape (lags,)
        Over its standard deviation under whiteness; zero where a lag has no pairs of samples.
    tested : ndarray of bool, shape (lags,)
        True where a lag has pairs of samples.
    """
    n = int(np.count_nonzero(present))
    centred = np.where(present, values - np.mean(values[present]), 0.0)
    weight = present.astype(float)
    products = np.array([centred[:-k] @ centred[k:] for k in range(1, lags + 1)])
    pairs = np.array([weight[:-k] @ weight[k:] for k in range(1, lags + 1)])
    correlation = products / (centred @ centred)
    # Ljung and Box: (n - k) / (n (n + 2)) at lag k, where n - k is the number of pairs
    deviation = np.sqrt(pairs / (n * (n + 2.0)))
    tested = pairs > 0
    score = np.divide(correlation, deviation, out=np.zeros(lags), where=tested)
    return correlation, score, tested
