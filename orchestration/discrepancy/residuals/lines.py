"""Search for lines in the spectrum of a residual, and the level of the spectrum about them.

The residual is taken as it is: whitening would take a line away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, median_filter

from fmus.kit.arrays import Array

ALPHA = 1e-9  # probability of seeing any of it in noise; a hum that matters is far beyond
EDGE_BINS = 4
_SHARE = 0.05  # of the power of the residual, below which a line is not what is wrong
# of the line that the output has, below which another there is what the model does not quite follow
TRACKING_SHARE = 0.1
MAIN_LOBE_BINS = 2  # frequencies on either side of a line into which the window spreads it
_NEIGHBOURS = 61  # frequencies from which the level of the spectrum about one is estimated


@dataclass(frozen=True)
class SpectralLine:
    """A periodic part of a residual.

    Attributes
    ----------
    frequency : float
        Hz.
    amplitude : float
        In the unit of the residual.
    p_value : float
        Of so high a line anywhere in the spectrum of noise.
    """

    frequency: float
    amplitude: float
    p_value: float


def spectral_lines(
    residual: Array, step: float, output: Array | None = None, rounding: float = 0.0
) -> list[SpectralLine]:
    """Find the frequencies at which a residual has far more power than about them.

    The periodogram of noise is exponentially distributed about its local level, which is a running
    median once the noise is roughly white. Under a periodic input whatever a model gets wrong
    has lines, too: a line that is small beside that of the output there is no disturbance.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Equally spaced, without gaps.
    step : float
        Seconds between samples.
    output : ndarray, shape (n,), optional
        As it was measured.
    rounding : float
        Largest mean error that a converter can leave; a square wave of that size has a line 4/pi
        times as large.

    Returns
    -------
    list of SpectralLine
        The strongest first.
    """
    n = len(residual)
    if n < 4 * _NEIGHBOURS:
        return []
    centred = residual - residual.mean()
    if not centred.any():
        return []
    pole = flattening_pole(residual)
    power = _flattened_power(centred, pole)
    level = spectral_level(power, _NEIGHBOURS) / np.log(2.0)
    ratio = power / np.where(level > 0.0, level, np.inf)
    p = np.minimum(1.0, len(power) * np.exp(-ratio))
    frequency = np.fft.rfftfreq(n - 1, step)[EDGE_BINS:-EDGE_BINS]
    gain = flattening_gain(pole, frequency, step)
    amplitude = 2.0 * np.sqrt(power) / np.hanning(n - 1).sum() / gain
    least = max(float(np.sqrt(2.0 * _SHARE * np.mean(centred**2))), 4.0 / np.pi * rounding)
    matters = (p < ALPHA) & (amplitude > least) & (power > _tracking_power(output, power, pole))
    result = []
    for k in np.flatnonzero(matters):
        if power[k] == power[max(0, k - 3) : k + 4].max():
            result.append(SpectralLine(float(frequency[k]), float(amplitude[k]), float(p[k])))
    return sorted(result, key=lambda line: -line.amplitude)


def flattening_pole(residual: Array) -> float:
    """Return the lag-one autocorrelation of a residual (n,).

    As one real pole it flattens red noise, and it cannot swallow a line.
    """
    centred = residual - residual.mean()
    return float(centred[1:] @ centred[:-1]) / (float(centred @ centred) or 1.0)


def flattening_gain(pole: float, frequency: NDArray[np.floating[Any]], step: float) -> Array:
    """Return the amplitude response of the filter 1 - pole/z.

    Parameters
    ----------
    pole : float
    frequency : ndarray, shape (m,)
        Hz.
    step : float
        Seconds between samples.

    Returns
    -------
    ndarray, shape (m,)
    """
    return np.asarray(np.abs(1.0 - pole * np.exp(-2j * np.pi * frequency * step)))


def spectral_level(power: Array, bins: int) -> Array:
    """Return the running median of a flattened power spectrum (m,) over so many frequencies.

    It is the level of the noise, which no line moves.
    """
    return np.asarray(median_filter(power, min(bins, len(power)), mode="reflect"))


def _tracking_power(output: Array | None, power: Array, pole: float) -> Array:
    """Return the power (m,) that a model which does not quite follow the output may leave."""
    if output is None:
        return np.zeros_like(power)
    followed = TRACKING_SHARE**2 * _flattened_power(output - output.mean(), pole)
    return np.asarray(maximum_filter(followed, 2 * MAIN_LOBE_BINS + 1))


def _flattened_power(values: Array, pole: float) -> Array:
    """Return the periodogram, flattened by a pole, at the frequencies that are judged."""
    flat = values[1:] - pole * values[:-1]
    # at either end the window folds the spectrum onto itself, and what is left is not exponentially
    # distributed
    return np.asarray(np.abs(np.fft.rfft(flat * np.hanning(len(flat))))[EDGE_BINS:-EDGE_BINS] ** 2)
