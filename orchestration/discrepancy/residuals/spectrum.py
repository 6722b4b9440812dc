"""The level of a spectrum about a frequency, by which a line stands out and the noise has its band."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

Array = NDArray[np.float64]


def flattening_pole(residual: Array) -> float:
    """Lag-one autocorrelation: one real pole, which flattens red noise and cannot swallow a line."""
    centred = residual - residual.mean()
    return float(centred[1:] @ centred[:-1]) / (float(centred @ centred) or 1.0)


def flattening_gain(pole: float, frequency: NDArray[np.floating[Any]], step: float) -> Array:
    """Amplitude response of the filter 1 - pole/z, (m,), at frequencies in Hz and a step in seconds."""
    return np.asarray(np.abs(1.0 - pole * np.exp(-2j * np.pi * frequency * step)))


def local_level(power: Array, bins: int) -> Array:
    """Running median of a flattened power spectrum (m,) over so many frequencies: no line moves it."""
    return np.asarray(median_filter(power, min(bins, len(power)), mode="reflect"))
