"""Level shifts of a residual: sudden changes that last, where no input steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.stats import norm

from orchestration.records.input_steps import input_steps

Array = NDArray[np.float64]
ALPHA = 1e-9  # probability of seeing so sudden a change in noise; a slip that matters is far beyond
LASTING = 1e-6  # probability of a change of level as large as that in noise that is of the colour of the residual
KEPT = 0.5  # share of a sudden change that must be left of it, or it was an outlier
SETTLING_SAMPLES = 4  # samples after a step of an input in which no jump is seen
_WINDOW = 16  # samples on either side, at least, that tell the level
_FORGOTTEN = (
    0.1  # autocorrelation at which noise has forgotten: its level is that of as many samples
)
_LONGEST = 1 / 20  # of the residual
_NEIGHBOURS = 20  # windows on either side that tell how restless the residual is there
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


def level_shifts(
    residual: Array, time: Array, inputs: Mapping[str, Array], step: float = 0.0
) -> list[LevelShift]:
    """Steps in a residual where no input steps, after which it stays where it is.

    A sample is held against the one before it, unless a gap lies between: the difference must be far beyond those about
    it. That alone would be an outlier of one sample, or a large innovation of noise with heavy tails, which fades. So
    half of it must be left in the medians over many samples before and after, and these must differ by more than such
    medians do elsewhere, once the sudden differences are taken out (level shifts and outliers are told apart alike by
    Chen and Liu, J. Am. Stat. Assoc. 88, 1993). How many samples is how long the residual remembers.

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
    difference, apart = np.diff(residual), np.diff(time)
    near = apart < 1.5 * np.median(apart)
    rounding = step / np.sqrt(
        6.0
    )  # of a difference of two samples, each off by a twelfth of its square
    spread = np.hypot(_local_spread(np.where(near, difference, 0.0), _NEIGHBOURS), rounding)
    if not spread.any():
        return []
    # a record may show an input a sample early, and what a model makes of a step is least right just after it
    moved = (
        np.convolve(input_steps(inputs, len(time))[1:], np.ones(SETTLING_SAMPLES + 2), "full")[
            1 : len(difference) + 1
        ]
        > 0.0
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        sudden = 2.0 * len(difference) * norm.sf(np.abs(difference) / spread) < ALPHA
    candidates = np.flatnonzero(sudden & near & ~moved)
    if not candidates.size:
        return []
    calm = np.concatenate([[0.0], np.cumsum(np.where(sudden, 0.0, difference))])
    window = _memory(calm)
    if len(residual) < 2 * window + 1:
        return []
    elsewhere, restless = _restlessness(calm, window)
    shifts = []
    for k in candidates:
        before, after = residual[max(k + 1 - window, 0) : k + 1], residual[k + 1 : k + 1 + window]
        if min(len(before), len(after)) < _WINDOW // 2:
            continue
        change = float(np.median(after) - np.median(before))
        noise = np.hypot(np.interp(k, elsewhere, restless), rounding)
        p = (
            min(1.0, 2.0 * len(candidates) * float(norm.sf(abs(change) / noise)))
            if noise > 0.0
            else 0.0
        )
        if p < LASTING and change * np.sign(difference[k]) > KEPT * abs(difference[k]):
            shifts.append(LevelShift(float(time[k + 1]), float(difference[k]), p))
    return shifts


def _memory(values: Array) -> int:
    """Samples over which a residual forgets, within what can be told of levels of it."""
    centred, n = values - values.mean(), len(values)
    correlation = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n)) ** 2)[: n // 2]
    faded = np.flatnonzero(correlation <= _FORGOTTEN * correlation[0])
    reach = int(faded[0]) if faded.size else n
    return int(np.clip(reach, _WINDOW, max(_WINDOW, n * _LONGEST)))


def _restlessness(values: Array, window: int) -> tuple[Array, Array]:
    """Standard deviation of the differences of medians over windows, and the samples about which it was seen."""
    stride = max(1, len(values) // _PLACES)
    medians = np.median(sliding_window_view(values, window)[::stride], axis=1)
    apart = max(1, round(window / stride))
    changes = medians[apart:] - medians[:-apart]
    if not changes.size:
        return np.zeros(1), np.zeros(1)
    places = np.asarray((np.arange(changes.size) + apart) * float(stride), dtype=np.float64)
    return places, _local_spread(changes, _NEIGHBOURS * apart // 2)


def _local_spread(values: Array, reach: int) -> Array:
    """Robust standard deviation of values (n,) about zero, as large as anywhere on average and as it is about each."""
    modulus = np.abs(values - np.median(values)) / float(norm.ppf(0.75))
    everywhere = float(np.median(modulus)) if modulus.size else 0.0
    pieces = max(1, modulus.size // (2 * reach))
    edges = np.linspace(0, modulus.size, pieces + 1).astype(np.intp)
    local = [float(np.median(modulus[a:b])) for a, b in pairwise(edges)]
    middles = 0.5 * (edges[:-1] + edges[1:] - 1)
    return np.maximum(np.interp(np.arange(modulus.size), middles, local), everywhere)
