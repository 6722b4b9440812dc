"""The period of a signal, in samples, found by comparing it with itself."""

from __future__ import annotations

import math

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.reporting import option

REPEATED = 0.02  # share of its variance by which a signal may differ from itself a period later
_APART = 0.5  # share by which it has to differ at some lag before its period
_SAME = 1e-9  # share that is rounding
_ASKED = 0.1  # share by which it may differ after a period that the user has named
_MULTIPLES = 20  # periods within which one that is named must come to whole samples
_OFF = 1e-3  # of a sample, by which it may not


def difference_after(values: Array) -> Array:
    """Return the share of its variance by which a signal differs from itself some samples later.

    Parameters
    ----------
    values : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n // 2 + 1,)
        By lag: 0 where it repeats, 1 where it is uncorrelated, 2 where it is reversed.
    """
    signal = values - values.mean()
    size = signal.size
    lags = np.arange(size // 2 + 1)
    spectrum = np.fft.rfft(signal, 2 * size)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, 2 * size)[: lags.size]
    energy = np.concatenate(([0.0], np.cumsum(signal**2)))
    # sum (x(t) - x(t+k))^2 = both - 2 correlation, over the samples that overlap
    both = energy[size - lags] + energy[size] - energy[lags]
    return np.clip(1.0 - 2.0 * correlation / np.maximum(both, np.finfo(float).tiny), 0.0, 2.0)


def period_of(values: Array) -> int:
    """Return the period of a signal that repeats at least once; 0 if it does not.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Equally spaced.

    Returns
    -------
    int
        In samples: the smallest after which it repeats about as well as after any other.
    """
    if np.ptp(values) == 0.0:
        return 0
    difference = difference_after(values)
    apart = np.flatnonzero(difference > _APART)
    if not apart.size:
        return 0
    # small lags do not count: a slow signal has hardly changed yet
    lags = np.arange(apart[0] + 1, difference.size)
    padded = np.append(difference, np.inf)
    is_minimum = (padded[lags] <= padded[lags - 1]) & (padded[lags] <= padded[lags + 1])
    repeated = lags[is_minimum & (difference[lags] <= REPEATED)]
    if not repeated.size:
        return 0
    best = difference[repeated].min()
    return int(repeated[difference[repeated] <= 2.0 * best + _SAME][0])


def named_period(seconds: float, step: float, values: dict[str, Array]) -> dict[str, int]:
    """Return the period of every signal in samples where the user has named one; 0 for the others.

    Parameters
    ----------
    seconds, step : float
        The period, and the sample period.
    values : dict of str to ndarray, shape (n,)

    Raises
    ------
    UserError
        If it is no whole number of samples, the record is shorter than two of it, or no signal
        repeats after it.
    """
    size = next(iter(values.values())).size
    written = option("period", f"{seconds:g}s")
    if not (math.isfinite(seconds) and 2.0 * step <= seconds <= 0.5 * size * step):
        raise UserError(
            f"{written}: a record of {size * step:g} s at {step:g} s has periods from"
            f" {2.0 * step:g} s to half of it"
        )
    exact = seconds / step * np.arange(1, _MULTIPLES + 1)
    whole = exact[np.abs(exact - np.round(exact)) <= _OFF]
    if not whole.size or round(whole[0]) > size // 2:
        raise UserError(
            f"{written}: no multiple of it within half the record is a whole number of samples of"
            f" {step:g} s"
        )
    lag = round(whole[0])
    periods = {
        name: lag if np.ptp(one) > 0.0 and difference_after(one)[lag] <= _ASKED else 0
        for name, one in values.items()
    }
    if not any(periods.values()):
        raise UserError(f"{written}: {' and '.join(values)} do not repeat after {lag * step:g} s")
    return periods
