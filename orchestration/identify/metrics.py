"""Measures of the distance between a simulation and a measurement: RMS, NRMSE, fit percent."""

import numpy as np
from numpy.typing import ArrayLike


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


def finite_or_none(value: float) -> float | None:
    """Return a number as JSON has it: None, which is null there, unless it is finite."""
    return float(value) if np.isfinite(value) else None


def normalised_rms(measured: ArrayLike, simulated: ArrayLike) -> float:
    """Return ``rms(y - yhat) / rms(y - mean(y))``: 0 is perfect, 1 is no better than the mean.

    Parameters
    ----------
    measured : array_like, shape (n,)
        The record; NaN samples are gaps and do not count.
    simulated : array_like, shape (n,)
        In the same unit; NaN where there is a measurement makes the result NaN, it is never a gap.

    Returns
    -------
    float
        NaN if the measurement is constant or empty.

    Raises
    ------
    ValueError
        If the two differ in shape.
    """
    y = np.asarray(measured, dtype=float)
    prediction = np.asarray(simulated, dtype=float)
    if y.shape != prediction.shape or y.ndim != 1:
        raise ValueError(
            f"measured {y.shape} and simulated {prediction.shape} must be vectors of one length"
        )
    present = ~np.isnan(y)
    error = (y - prediction)[present]
    signal = y[present]
    if error.size == 0 or np.all(signal == signal[0]):
        return float("nan")
    spread = np.sqrt(np.mean((signal - np.mean(signal)) ** 2))
    return float(np.sqrt(np.mean(error**2)) / spread)


def fit_percent(measured: ArrayLike, simulated: ArrayLike) -> float:
    """Return the fit of the thesis' table 3-2 in percent.

    It is ``100 (1 - ||y - yhat|| / ||y - mean(y)||)``.

    Parameters
    ----------
    measured, simulated : array_like, shape (n,)
        See `normalised_rms`, also for gaps, NaN and errors.

    Returns
    -------
    float
        100 is perfect, 0 no better than the mean, below 0 worse.
    """
    return 100.0 * (1.0 - normalised_rms(measured, simulated))
