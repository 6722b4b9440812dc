"""The stretch of a long record in which causes are searched for.

A search makes hundreds of simulations, and what it looks for shows in some thousands of samples as
well as in a million. They are contiguous: every other sample would miss when a held input steps,
and blocks from all over the record would each begin in a state that nobody knows.
"""

from __future__ import annotations

import numpy as np

from fmus.kit.arrays import Array, Indices
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.screening import outputs_with_enough_samples
from orchestration.discrepancy.note import Note, NoteCode

LONG = 20_000  # samples from which on a search sees a stretch only
_SIZES = 8_000, 16_000, 32_000  # samples of it, the least that moves like the record
_ALIKE = 0.7  # of how much an input moves in all of the record
_USUAL = 0.98  # share of the samples whose errors count in full
_WORSE = 1.5  # times the squared error of a stretch, from which on another is searched
_LONGER = 4  # times a stretch, that is searched next
_PLACES = 4  # for a stretch to begin, in its own length


def searched_stretch(data: Dataset) -> Dataset:
    """Return the part of a record in which causes are searched for.

    It is the earliest of the shortest stretches in which every input moves nearly as much as
    in all of the record, or else the liveliest of the longest.

    Parameters
    ----------
    data : Dataset

    Returns
    -------
    Dataset
        The same where it is short, or where no stretch has enough samples of every output.
    """
    count = len(data.time)
    if count <= LONG:
        return data
    best = data
    most = 0.0
    for size in _SIZES:
        if size >= count:
            break
        firsts = np.arange(0, count - size + 1, size // _PLACES)
        liveliness = _liveliness(data, firsts, size)
        for place in np.argsort(-np.minimum(liveliness, _ALIKE), kind="stable"):
            stretch = data.part(int(firsts[place]), int(firsts[place]) + size)
            if len(outputs_with_enough_samples(stretch)) == len(data.measured):
                break
        else:
            continue
        if liveliness[place] >= most:
            most = float(liveliness[place])
            best = stretch
        if most >= _ALIKE:
            break
    return best


def longer_stretch(data: Dataset, stretch: Dataset) -> Dataset:
    """Return a stretch that begins where another does and is several times as long.

    Parameters
    ----------
    data : Dataset
    stretch : Dataset
        The other one, a part of the data.

    Returns
    -------
    Dataset
        As far as the data reach.
    """
    size = min(_LONGER * len(stretch.time), len(data.time))
    first = min(int(np.searchsorted(data.time, stretch.time[0])), len(data.time) - size)
    return data.part(first, first + size)


def worst_stretch(data: Dataset, stretch: Dataset, errors: Array) -> Dataset:
    """Return the stretch in which errors are largest, if they clearly are larger than in another.

    Parameters
    ----------
    data : Dataset
    stretch : Dataset
        The other one, a part of the data.
    errors : ndarray, shape (n,)
        Squared errors of a model over the data, in any unit.

    Returns
    -------
    Dataset
        The other one, if none is clearly worse.
    """
    size = len(stretch.time)
    begin = int(np.searchsorted(data.time, stretch.time[0]))
    # the largest errors of a moment are no course of a signal
    limited = np.minimum(errors, np.quantile(errors, _USUAL))
    sums = np.concatenate([[0.0], np.cumsum(limited)])
    firsts = np.arange(0, len(data.time) - size + 1, size // _PLACES)
    totals = sums[firsts + size] - sums[firsts]
    for place in np.argsort(-totals, kind="stable"):
        if totals[place] <= _WORSE * (sums[begin + size] - sums[begin]):
            break
        first = int(firsts[place])
        worse = data.part(first, first + size)
        if len(outputs_with_enough_samples(worse)) == len(data.measured):
            return worse
    return stretch


def stretch_notes(data: Dataset, stretch: Dataset) -> list[Note]:
    """Return the note that causes were searched for in a stretch of a record, if they were.

    Parameters
    ----------
    data : Dataset
        What was fitted to.
    stretch : Dataset
        What the search saw of it.
    """
    if len(stretch.time) == len(data.time):
        return []
    facts = {
        "samples": int(stretch.within.sum()),
        "of": int(data.within.sum()),
        "first": float(stretch.time[0]),
        "last": float(stretch.time[-1]),
    }
    return [Note(NoteCode.SEARCHED_IN_PART, "", facts)]


def _liveliness(data: Dataset, firsts: Indices, size: int) -> Array:
    """Return the deviation of the stillest input over that in all of the record, by stretch.

    Parameters
    ----------
    data : Dataset
    firsts : ndarray of int, shape (k,)
        Where stretches begin.
    size : int
        Samples in each.

    Returns
    -------
    ndarray, shape (k,)
        Inputs that do not move at all do not count.
    """
    moving = [values for values in data.inputs.values() if np.ptp(values[data.within]) > 0.0]
    ratios = [
        np.array([np.std(values[first : first + size]) for first in firsts])
        / np.std(values[data.within])
        for values in moving
    ]
    return np.min(ratios, axis=0) if ratios else np.ones(len(firsts))
