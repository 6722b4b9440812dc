"""Outputs that were filtered forwards and backwards, which no plant does.

Such a filter leaves no noise beyond its cut-off, and no delay. A linear model that is fed filtered
inputs shows filtered outputs, so that it is tried whether the model is much nearer with inputs
that went through the same filter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfiltfilt

from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection.misfit import (
    MUCH_NEARER,
    free_run_error,
    nominal_outputs,
    refitted_error,
)
from orchestration.discrepancy.selection.search import Search

_ORDER = 2  # of the filter that is tried; a sharper one is little else in what it leaves
_CUTOFFS = np.geomspace(0.004, 0.5, 43)  # of half the sampling rate
_BEYOND = 5.0  # times the cut-off, from which on a filter leaves nothing,
_NOTHING = 1e-8  # of the power of an output; noise of a good sensor, 1e-3 of its spread, has more
_MISSING = 1e-3  # times the power of the nominal model there, which outputs must have less of
_LEAST = 0.01  # error over the spread, below which a filter does not matter


def filtered_both_ways(search: Search, base: FittedCandidate) -> list[Note]:
    """Return a note if outputs look to have been filtered forwards and backwards.

    Parameters
    ----------
    search : Search
        Over the record as it is.
    base : FittedCandidate
        The model without effects, fitted to that.
    """
    data = search.data
    present = free_run_error(base)
    complete = all(np.isfinite(y).all() for y in data.measured.values())
    if present < _LEAST or data.several or not (data.even and complete) or search.budget.spent():
        return []
    simulated = nominal_outputs(search, data)
    courses = [*simulated.values(), *data.measured.values()]
    moves = bool(simulated) and all(np.ptp(course) > 0.0 for course in courses)
    cutoff = _cutoff(data, simulated) if moves else 0.0
    if not cutoff:
        return []
    inputs = {name: _filtered(u, cutoff) for name, u in data.inputs.items()}
    instead = refitted_error(search, replace(data, inputs=inputs))
    if instead > MUCH_NEARER * present:
        return []
    rate = (len(data.time) - 1) / float(data.time[-1] - data.time[0])
    facts = {"frequency": 0.5 * rate * cutoff, "share": present, "instead": instead}
    return [Note(NoteCode.FILTERED, "", facts)]


def _cutoff(data: Dataset, simulated: Mapping[str, Array]) -> float:
    """Return the cut-off at which filtered outputs of the nominal model are most like the measured.

    Zero where outputs have anything beyond it, or hardly less than the model.
    """

    def likeness(cutoff: float) -> float:
        return sum(
            float(np.corrcoef(y, _filtered(simulated[o], cutoff))[0, 1])
            for o, y in data.measured.items()
        )

    cutoff = max(_CUTOFFS, key=likeness)
    measured = np.array([_beyond(y, cutoff) for y in data.measured.values()])
    modelled = np.array([_beyond(simulated[o], cutoff) for o in data.measured])
    least = np.finfo(float).tiny
    ratio = np.maximum(measured, least) / np.maximum(modelled, least)
    missing = float(np.exp(np.mean(np.log(ratio))))
    return float(cutoff) if measured.max() < _NOTHING and missing < _MISSING else 0.0


def _filtered(values: Array, cutoff: float) -> Array:
    return np.asarray(sosfiltfilt(butter(_ORDER, cutoff, output="sos"), values))


def _beyond(y: Array, cutoff: float) -> float:
    """Return the share of the power of a signal (n,) that lies well beyond a cut-off."""
    line = np.linspace(y[0], y[-1], len(y))
    power = np.abs(np.fft.rfft((y - line) * np.hanning(len(y)))) ** 2
    frequency = np.linspace(0.0, 1.0, len(power))
    return float(power[frequency > min(_BEYOND * cutoff, 0.9)].sum() / power.sum())
