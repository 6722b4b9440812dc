"""Outliers of a record: single values far from what a model leaves beside them."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import binary_dilation, median_filter

from fmus.kit.arrays import Array, Mask

_NEIGHBOURS = 5  # differences of samples that show its slope
_JUMP = 6.0  # standard deviations of the noise, by which an input jumps beside its slope
_SMALL = 1e-3  # of the spread of an input, below which it has no noise beside its jumps
_FAR = 8.0  # standard deviations of the noise, beyond which a single value is an outlier
_BEND = 5.0  # distances of its neighbours, from which on a value is no bend of a smooth error
_FEW = 0.05  # share of the samples, up to which some are outliers
_TO_DEVIATION = 1.4826  # of the median of moduli, for normal noise


def noise_of(error: Array) -> float:
    """Return the standard deviation of white noise in an error (n,), by its second differences."""
    bends = np.diff(error, 2)
    bends = bends[np.isfinite(bends)]
    if not bends.size:
        return 0.0
    return float(_TO_DEVIATION * np.median(np.abs(bends)) / np.sqrt(6.0))


def jumps_of(values: Array, noise: float | None = None) -> Mask:
    """Return between which samples (n - 1,) an input jumps beside its slope.

    Parameters
    ----------
    values : ndarray, shape (n,)
    noise : float, optional
        Standard deviation of its noise; by default as `noise_of` has it, or a little.
    """
    if noise is None:
        noise = max(noise_of(values), _SMALL * float(np.std(values)))
    rises = np.diff(values)
    slopes = median_filter(rises, _NEIGHBOURS, mode="nearest")
    return np.asarray(np.abs(rises - slopes) > _JUMP * noise)


def outliers_of(errors: Array, inputs: Array) -> Mask:
    """Return which errors (n,) of an output are outliers.

    They are single values far from what a model leaves beside them, but for those near a jump of
    an input, where the model may be a sample late; and none of an output of which many are.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        Measured minus simulated; NaN where nothing was measured.
    inputs : ndarray, shape (n, m)
    """
    outliers: Mask = np.zeros(len(errors), dtype=bool)
    (known,) = np.nonzero(np.isfinite(errors))
    if known.size <= _NEIGHBOURS:
        return outliers
    jumps = np.zeros(len(errors), dtype=bool)
    for values in inputs.T:
        jumps[1:] |= jumps_of(values)
    near = binary_dilation(jumps, iterations=_NEIGHBOURS // 2)
    far = _alone(errors[known]) & ~near[known]
    if far.mean() < _FEW:
        outliers[known[far]] = True
    return outliers


def _alone(errors: Array) -> Mask:
    """Return which errors (n,) are far from the two before and the two after, which are near.

    A bend of a smooth error is as near to these as they are to each other.
    """
    padded = np.pad(errors, _NEIGHBOURS // 2, mode="reflect")
    beside = np.delete(sliding_window_view(padded, _NEIGHBOURS), _NEIGHBOURS // 2, axis=1)
    middle = np.median(beside, axis=1)
    away = np.abs(errors - middle)
    # but for one of them, which may be an outlier too
    apart = np.sort(np.abs(beside - middle[:, np.newaxis]), axis=1)[:, -2]
    return (away > _FAR * _TO_DEVIATION * np.median(away)) & (away > _BEND * apart)
