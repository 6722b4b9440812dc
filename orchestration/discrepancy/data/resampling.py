"""Records that were resampled finer than they were measured, by straight lines between samples.

What lies on the lines was not measured: it counts as evidence many times over, and makes an input
that was held go smoothly, which looks like a delay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.note import Note, NoteCode

_FINEST = 50  # samples on a line
_KNOTS = 20  # that it takes to know
_OFF = 1e-6  # of the squared second differences, which may lie beside knots: a file is rounded
_EVEN = 0.1  # scatter of their size over its mean, below which a signal is a triangle by itself


def as_measured(data: Dataset) -> tuple[Dataset, list[Note]]:
    """Return the samples of a record that were measured, where all outputs are lines between them.

    Parameters
    ----------
    data : Dataset

    Returns
    -------
    data : Dataset
        The same where some output is no such lines, has gaps, or where there are several runs.
    notes : list of Note
        On samples that were left out.
    """
    outputs = list(data.measured.values())
    if data.several or not outputs or not all(np.isfinite(y).all() for y in outputs):
        return data, []
    for times in range(_FINEST, 1, -1):
        firsts = {_first_knot(y, times) for y in outputs}
        if len(firsts) == 1 and None not in firsts:
            kept = slice(firsts.pop(), None, times)
            note = Note(NoteCode.RESAMPLED, "", {"times": times, "samples": len(data.time[kept])})
            return _every(data, kept), [note]
    return data, []


def _first_knot(y: Array, times: int) -> int | None:
    """Return the first of the knots of a signal that is lines of so many samples, or None."""
    bends = np.abs(np.diff(y, 2))
    if len(bends) < _KNOTS * times:
        return None
    scale = max(float(bends.max()), np.finfo(float).tiny)
    power = np.bincount(np.arange(len(bends)) % times, (bends / scale) ** 2)
    place = int(np.argmax(power))
    at_knots = bends[place::times]
    beside = power.sum() - power[place]
    if beside > _OFF * power[place] or np.std(at_knots) <= _EVEN * np.mean(at_knots):
        return None
    if np.median(at_knots) <= np.sqrt(_OFF) * scale:  # straight but for a few bends
        return None
    return (place + 1) % times


def _every(data: Dataset, kept: slice) -> Dataset:
    return replace(
        data,
        time=data.time[kept],
        inputs={name: values[kept] for name, values in data.inputs.items()},
        measured={name: values[kept] for name, values in data.measured.items()},
    )
