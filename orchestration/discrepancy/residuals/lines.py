"""Lines in the spectrum of a residual, looked for before it is whitened away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from orchestration.discrepancy.residuals.spectrum import (
    flattening_gain,
    flattening_pole,
    local_level,
)

Array = NDArray[np.float64]
ALPHA = 1e-9  # probability of seeing any of it in noise; a hum that matters is far beyond
EDGE_BINS = 4
_SHARE = 0.05  # of the power of the residual, below which a line is not what is wrong
TRACKING_SHARE = 0.1  # of the line that the output has, below which another there is what the model does not quite follow
MAIN_LOBE_BINS = 2  # frequencies on either side of a line into which the window spreads it
_NEIGHBOURS = 61  # frequencies that tell how large the spectrum is about one of them


@dataclass(frozen=True)
class SpectralLine:
    """A periodic part.

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
    """Frequencies at which a residual has far more power than about them.

    The periodogram of noise is exponentially distributed about its local level, which a running median tells once the
    noise is roughly white. Under a periodic input whatever a model gets wrong has lines, too: what is little beside the
    line that the output has there is no disturbance.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Equally spaced, without gaps.
    step : float
        Seconds between samples.
    output : ndarray, shape (n,), optional
        As it was measured.
    rounding : float
        Largest mean error that a converter can leave; a square wave of that size has a line 4/pi times as large.

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
    power = _power(centred, pole)
    level = local_level(power, _NEIGHBOURS) / np.log(2.0)
    ratio = power / np.where(level > 0.0, level, np.inf)
    p = np.minimum(1.0, len(power) * np.exp(-ratio))
    frequency = np.fft.rfftfreq(n - 1, step)[EDGE_BINS:-EDGE_BINS]
    amplitude = (
        2.0 * np.sqrt(power) / np.hanning(n - 1).sum() / flattening_gain(pole, frequency, step)
    )
    least = max(float(np.sqrt(2.0 * _SHARE * np.mean(centred**2))), 4.0 / np.pi * rounding)
    followed = (
        np.zeros_like(power)
        if output is None
        else TRACKING_SHARE**2 * _power(output - output.mean(), pole)
    )
    matters = (
        (p < ALPHA)
        & (amplitude > least)
        & (power > maximum_filter(followed, 2 * MAIN_LOBE_BINS + 1))
    )
    peaks = [k for k in np.flatnonzero(matters) if power[k] == power[max(0, k - 3) : k + 4].max()]
    result = [SpectralLine(float(frequency[k]), float(amplitude[k]), float(p[k])) for k in peaks]
    return sorted(result, key=lambda line: -line.amplitude)


def _power(values: Array, pole: float) -> Array:
    """Periodogram, flattened by a pole, at the frequencies that are judged."""
    flat = values[1:] - pole * values[:-1]
    # at either end the window folds the spectrum onto itself, and what is left is not exponentially distributed
    return np.asarray(np.abs(np.fft.rfft(flat * np.hanning(len(flat))))[EDGE_BINS:-EDGE_BINS] ** 2)
