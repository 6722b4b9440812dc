"""How far a simulation is from a measurement, and whether the residual is white."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2, norm

Array = NDArray[np.float64]
WHITENESS_SAMPLES = 20  # for every lag of a test of whiteness, and so the fewest that it needs


def rms(residual: ArrayLike) -> float:
    """Return the root mean square of a residual.

    Parameters
    ----------
    residual : array_like, shape (n,)
        NaN samples are gaps.

    Returns
    -------
    float
        In its unit; NaN if there are only gaps.
    """
    values = np.asarray(residual, dtype=float)
    values = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def number(value: float) -> float | None:
    """Return a figure as JSON has it: null where it is no number."""
    return float(value) if np.isfinite(value) else None


def normalised_rms(
    measured: ArrayLike, simulated: ArrayLike, judged: ArrayLike | None = None
) -> float:
    """Return ``rms(y - yhat) / rms(y - mean(y))``: 0 is perfect, 1 is no better than the mean.

    Parameters
    ----------
    measured : array_like, shape (n,)
        The record; NaN samples are gaps and do not count.
    simulated : array_like, shape (n,)
        In the same unit; NaN where there is a measurement makes the result NaN, it is never a gap.
    judged : array_like of bool, shape (n,), optional
        Samples whose errors count; all by default. How far the signal spreads all of it tells in any case.

    Returns
    -------
    float
        NaN if the measurement is constant or empty, because there is then nothing to compare with.

    Raises
    ------
    ValueError
        If the two differ in shape.
    """
    y, prediction = np.asarray(measured, dtype=float), np.asarray(simulated, dtype=float)
    if y.shape != prediction.shape or y.ndim != 1:
        raise ValueError(
            f"measured {y.shape} and simulated {prediction.shape} must be vectors of one length"
        )
    present = ~np.isnan(y)
    counted = present if judged is None else present & np.asarray(judged, dtype=bool)
    error, y = (y - prediction)[counted], y[present]
    if error.size == 0 or np.all(y == y[0]):
        return float("nan")
    return float(np.sqrt(np.mean(error**2)) / np.sqrt(np.mean((y - np.mean(y)) ** 2)))


def fit_percent(measured: ArrayLike, simulated: ArrayLike) -> float:
    """Return ``100 (1 - ||y - yhat|| / ||y - mean(y)||)``, the fit of the thesis' table 3-2, in percent.

    Parameters
    ----------
    measured, simulated : array_like, shape (n,)
        As of `normalised_rms`, gaps, NaN and errors too.

    Returns
    -------
    float
        100 is perfect, 0 no better than the mean, below 0 worse.
    """
    return 100.0 * (1.0 - normalised_rms(measured, simulated))


@dataclass(frozen=True)
class Whiteness:
    """The result of :func:`whiteness`, dimensionless; a constant residual has NaN figures and is not called white.

    Attributes
    ----------
    samples, lags : int
        Finite samples used, and lags looked at.
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
        """Whether the Ljung-Box test does not reject whiteness at the declared significance."""
        return self.p_value >= self.significance

    def summary(self) -> str:
        """Return the verdict in a few words."""
        if np.isnan(self.p_value):
            return "constant"
        return f"{'white' if self.is_white else 'not white'} (p = {self.p_value:.2g}, lag-1 {self.lag_one:+.2f})"


def whiteness(
    residual: ArrayLike, lags: int | None = None, significance: float = 0.01
) -> Whiteness:
    """Test whether a residual is white, by Ljung and Box.

    The mean is removed first, so a constant offset is not counted against whiteness. Samples that are NaN are gaps:
    each lag uses the pairs that exist, with the variance that so many pairs have; without gaps this is the usual test.

    Parameters
    ----------
    residual : array_like, shape (n,)
        Equally spaced samples, any unit.
    lags : int, optional
        Number of lags; by default 25, or a twentieth of the samples if that is less, because with more lags the test
        raises too many false alarms (2 % instead of 1 % with a fifth of 100 samples); so by default fewer than 20
        samples are refused.
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
    centred = np.where(present, values - np.mean(values[present]), 0.0)
    weight = present.astype(float)
    correlation = np.array([centred[:-k] @ centred[k:] for k in range(1, count + 1)]) / (
        centred @ centred
    )
    pairs = np.array([weight[:-k] @ weight[k:] for k in range(1, count + 1)])
    deviation = np.sqrt(
        pairs / (n * (n + 2.0))
    )  # of an autocorrelation under whiteness; zero if a lag has no pairs
    score = np.divide(correlation, deviation, out=np.zeros(count), where=pairs > 0)
    statistic = float(score @ score)
    freedom = int(np.count_nonzero(pairs))
    if freedom < 1:
        raise ValueError(f"the gaps leave none of {count} lags with pairs of samples")
    return Whiteness(
        samples=n,
        lags=count,
        statistic=statistic,
        p_value=float(chi2.sf(statistic, freedom)),
        lag_one=float(correlation[0]),
        fraction_outside=float(np.mean(np.abs(score[pairs > 0]) > norm.ppf(0.995))),
        significance=significance,
    )
