"""Outliers and level shifts of a residual: changes from one sample to the next, beyond all others.

An outlier is a single sample far from its neighbours; it is counted, and nothing else is judged by
it. A level shift is a sudden change that lasts, where no input steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import ndtr, ndtri

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.discrepancy.residuals.innovations import between_windows, local_level
from orchestration.records.sampling import input_steps

SETTLING_SAMPLES = 4  # samples after a step of an input in which neither is seen

# Outliers
_FAR = 6.0  # standard deviations by which a sample leaves the middle between its neighbours
# of the steps of inputs, above which what is seen just after them is no outlier of a sensor
_OFTEN = 0.15
# times as far as either of its neighbours does: a step leaves two samples equally far, an outlier
# is twice as far
_ALONE = 1.3

# Level shifts
ALPHA = 1e-9  # probability of seeing so sudden a change in noise; a slip that matters is far beyond
# probability of a change of level as large as that in noise that is of the colour of the residual
LASTING = 1e-6
KEPT = 0.5  # share of a sudden change that must be left of it, or it was an outlier
_WINDOW = 16  # samples on either side, at least, from which the level is estimated
# autocorrelation at which noise has forgotten: its level is that of as many samples
_FORGOTTEN = 0.1
_LONGEST = 1 / 20  # of the residual
_NEIGHBOURS = 20  # windows on either side from which the spread there is estimated
_PLACES = 4000  # at which levels are compared, to see how noise does


@dataclass(frozen=True)
class LevelShift:
    """A sudden change of the mean of a residual.

    Attributes
    ----------
    time : float
        Seconds.
    size : float
        In the unit of the residual.
    p_value : float
        Of so large a change of the level anywhere in noise.
    """

    time: float
    size: float
    p_value: float


def find_outliers(residual: Array, inputs: Mapping[str, Array], step: float = 0.0) -> Mask:
    """Find samples far from the middle between their neighbours.

    Far is by the robust deviation there (Hampel's identifier). An outlier of a sensor is one sample
    long, and an autoregression that takes it for an innovation expects it to last.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    inputs : Mapping of str to ndarray, shape (n,)
        At the same samples.
    step : float
        Of the converter, whose rounding alone moves a sample by as much from the middle between its
        neighbours.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    distance = np.zeros(residual.size)
    distance[1:-1] = np.abs(residual[1:-1] - 0.5 * (residual[:-2] + residual[2:]))
    level = local_level(distance)
    spread = 0.0
    if distance.size:
        spread = float(np.median(distance / level)) / float(ndtri(0.75))
    if not spread > 0.0:
        return np.zeros(residual.size, dtype=bool)
    beside = np.maximum(np.roll(distance, 1), np.roll(distance, -1))
    far = (distance > _FAR * spread * level + step) & (distance > _ALONE * beside)
    steps = input_steps(inputs, residual.size)
    moved = np.convolve(steps, np.ones(SETTLING_SAMPLES), "full")[: residual.size] > 0.0
    # what happens again and again just after an input steps may be the model's doing
    return np.asarray(far & ~moved if (far & moved).sum() > _OFTEN * steps.sum() else far)


def interpolate_over(residual: Array, mask: Mask) -> Array:
    """Put some samples of a residual (n,) on straight lines between the others."""
    if not mask.any() or mask.all():
        return residual
    at = np.arange(residual.size)
    return np.asarray(np.where(mask, np.interp(at, at[~mask], residual[~mask]), residual))


def level_shifts(
    residual: Array, time: Array, inputs: Mapping[str, Array], step: float = 0.0
) -> list[LevelShift]:
    """Find steps in a residual where no input steps, after which it stays where it is.

    A sample is compared with the one before it, unless a gap lies between: the difference must be
    far beyond those about it. That alone would be an outlier of one sample, or a large innovation
    of noise with heavy tails, which fades. So half of it must be left in the medians over many
    samples before and after, and these must differ by more than such medians do elsewhere, once the
    sudden differences are taken out (level shifts and outliers are told apart in the same way by
    Chen and Liu, J. Am. Stat. Assoc. 88, 1993). How many samples is how long the residual
    remembers.

    Parameters
    ----------
    residual, time : ndarray, shape (n,)
        Where something was measured.
    inputs : Mapping of str to ndarray, shape (n,)
    step : float
        Of the converter, whose rounding is noise of known width.

    Returns
    -------
    list of LevelShift
        In order of time.
    """
    rounding = step / np.sqrt(6.0)  # of a difference of two samples, each off by step² / 12
    difference = np.diff(residual)
    sudden, candidates = _sudden_changes(difference, time, inputs, rounding)
    if not candidates.size:
        return []
    steady = np.concatenate([[0.0], np.cumsum(np.where(sudden, 0.0, difference))])
    window = _memory(steady)
    if len(residual) < 2 * window + 1:
        return []
    places, restlessness = _restlessness(steady, window)
    shifts = []
    for k in candidates:
        before = residual[max(k + 1 - window, 0) : k + 1]
        after = residual[k + 1 : k + 1 + window]
        if min(len(before), len(after)) < _WINDOW // 2:
            continue
        change = float(np.median(after) - np.median(before))
        noise = np.hypot(np.interp(k, places, restlessness), rounding)
        p_value = _two_sided(abs(change), noise, len(candidates))
        if p_value < LASTING and change * np.sign(difference[k]) > KEPT * abs(difference[k]):
            shifts.append(LevelShift(float(time[k + 1]), float(difference[k]), p_value))
    return shifts


def _sudden_changes(
    difference: Array, time: Array, inputs: Mapping[str, Array], rounding: float
) -> tuple[Mask, Indices]:
    """Find differences (n - 1,) far beyond those about them.

    Returns
    -------
    sudden : ndarray of bool, shape (n - 1,)
        All of them.
    candidates : ndarray of int
        Those that are neither over a gap nor at a step of an input.
    """
    interval = np.diff(time)
    near = interval < 1.5 * np.median(interval)
    spread = np.hypot(_local_spread(np.where(near, difference, 0.0), _NEIGHBOURS), rounding)
    if not spread.any():
        return np.zeros(difference.size, dtype=bool), np.empty(0, dtype=np.intp)
    # a record may show an input a sample early, and what a model makes of a step is least right
    # just after it
    steps = input_steps(inputs, len(time))[1:]
    about = np.convolve(steps, np.ones(SETTLING_SAMPLES + 2), "full")
    moved = about[1 : len(difference) + 1] > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        sudden = 2.0 * len(difference) * ndtr(-np.abs(difference) / spread) < ALPHA
    return sudden, np.flatnonzero(sudden & near & ~moved)


def _two_sided(size: float, deviation: float, tried: int) -> float:
    """Return the probability of so large a normal variable, either way, among so many."""
    if not deviation > 0.0:
        return 0.0
    return min(1.0, 2.0 * tried * float(ndtr(-size / deviation)))


def _memory(values: Array) -> int:
    """Return the samples over which a residual forgets, within what levels of it allow."""
    n = len(values)
    centred = values - values.mean()
    correlation = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n)) ** 2)[: n // 2]
    faded = np.flatnonzero(correlation <= _FORGOTTEN * correlation[0])
    reach = int(faded[0]) if faded.size else n
    return int(np.clip(reach, _WINDOW, max(_WINDOW, n * _LONGEST)))


def _restlessness(values: Array, window: int) -> tuple[Array, Array]:
    """Estimate the standard deviation of the differences of medians over windows.

    Returns
    -------
    places, deviation : ndarray, shape (m,)
        Samples about which it was seen, and the deviation there.
    """
    stride = max(1, len(values) // _PLACES)
    medians = np.median(sliding_window_view(values, window)[::stride], axis=1)
    distance = max(1, round(window / stride))
    changes = medians[distance:] - medians[:-distance]
    if not changes.size:
        return np.zeros(1), np.zeros(1)
    places = np.asarray((np.arange(changes.size) + distance) * float(stride), dtype=np.float64)
    return places, _local_spread(changes, _NEIGHBOURS * distance // 2)


def _local_spread(values: Array, reach: int) -> Array:
    """Return the robust standard deviation about each of values (n,), at least that of all."""
    modulus = np.abs(values - np.median(values)) / float(ndtri(0.75))
    everywhere = float(np.median(modulus)) if modulus.size else 0.0
    pieces = max(1, modulus.size // (2 * reach))
    local = between_windows(modulus, pieces, lambda windows: np.median(windows, axis=1))
    return np.maximum(local, everywhere)
