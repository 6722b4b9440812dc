"""The clock of outputs beside that of inputs, where two loggers recorded them.

Outputs that were stamped by a clock that goes faster or slower, or that is ahead, are those of the
model at other times: the nominal model, simulated under the inputs, correlates with them best where
their clock is put right.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

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

_LARGE = 0.05  # error over the spread, from which on a clock is worth a look
_ENOUGH = 4_000  # samples, to tell a clock by
_RATES = np.linspace(0.9, 1.1, 161)  # of clocks; a crystal is nearer to one, a typing error is not
_FARTHEST = 0.25  # of the record, by which outputs may be ahead or behind
_ALIKE = 0.02  # of correlation, within which the shift nearest to none is taken
_LEAST = 0.5  # correlation below which outputs have too little of the model to tell a clock by
_EARLY = 1.5  # samples; what an input does between two of them makes as much as one
# of what correlation leaves unexplained by a shift, below which another rate must leave; how much
# of the rest is of parameters that are not nominal, a refit tells
_BETTER = 0.8
_COMPLETE = 0.9  # share of the samples of an output that must be there


@dataclass(frozen=True)
class OutputClock:
    """A clock of outputs.

    Attributes
    ----------
    rate : float
        Seconds of it in a second of the inputs' clock.
    ahead : float
        Seconds of the inputs' clock by which outputs are ahead at the start.
    correlation : float
        Of the outputs, put right, with those of the nominal model.
    """

    rate: float
    ahead: float
    correlation: float

    @property
    def is_late(self) -> bool:
        """True if outputs are just late, which is no fault: sensors and plants delay."""
        return self.rate == 1.0 and self.ahead <= 0.0

    def put_right(self, data: Dataset) -> Dataset:
        """Return data with outputs at the times of inputs, and gaps where none were recorded."""
        start = float(data.time[0])
        read = start + self.rate * (data.time - start - self.ahead)
        outside = (read < start) | (read > data.time[-1])
        measured = {}
        for output, y in data.measured.items():
            there = np.isfinite(y)
            values = np.interp(read, data.time[there], y[there])
            measured[output] = np.where(outside, np.nan, values)
        return replace(data, measured=measured)


def by_another_clock(search: Search, base: FittedCandidate) -> list[Note]:
    """Return a note if outputs look to have another clock than inputs, one at most.

    Parameters
    ----------
    search : Search
        Over the record as it is.
    base : FittedCandidate
        The model without effects, fitted to that.
    """
    present = free_run_error(base)
    if present < _LARGE or search.budget.spent():
        return []
    data = search.data
    if len(data.time) > _ENOUGH:
        data = data.part(0, _ENOUGH)
    clocks = output_clocks(data, nominal_outputs(search, data))
    errors = [refitted_error(search, clock.put_right(data)) for clock in clocks]
    least = present
    notes = []
    for clock, error in zip(clocks, errors, strict=True):
        if error < MUCH_NEARER * least and not clock.is_late:
            code = NoteCode.RUNS_AHEAD if clock.rate == 1.0 else NoteCode.OTHER_CLOCK
            facts = {
                "columns": " and ".join(data.measured),
                "rate": clock.rate - 1.0,
                "ahead": clock.ahead,
                "share": present,
                "instead": error,
            }
            notes = [Note(code, "", facts)]
        least = min(least, error)
    return notes


def output_clocks(data: Dataset, simulated: Mapping[str, Array]) -> list[OutputClock]:
    """Return the clocks that outputs may have, if they are others than that of inputs.

    Parameters
    ----------
    data : Dataset
    simulated : Mapping of str to ndarray, shape (n,)
        Outputs of the nominal model.

    Returns
    -------
    list of OutputClock
        The one of the same rate first, then the one of another rate, if it explains more. None
        where samples are not even or many are missing, or where outputs have little of the model.
    """
    complete = all(np.isfinite(y).mean() > _COMPLETE for y in data.measured.values())
    if data.several or not (simulated and data.even and complete):
        return []
    shifted = _best_shift(data, simulated, 1.0)
    others = [_best_shift(data, simulated, float(rate)) for rate in _RATES]
    best = max(others, key=lambda clock: clock.correlation)
    if best.correlation < _LEAST:
        return []
    is_better = 1.0 - best.correlation**2 < _BETTER * (1.0 - shifted.correlation**2)
    clocks = [shifted, best] if is_better else [shifted]
    step = float(data.time[1] - data.time[0])
    return clocks if is_better or abs(shifted.ahead) > _EARLY * step else []


def _best_shift(data: Dataset, simulated: Mapping[str, Array], rate: float) -> OutputClock:
    """Return the clock of a rate whose shift correlates best, or nearly so and is smallest."""
    count = len(data.time)
    step = float(data.time[-1] - data.time[0]) / (count - 1)
    clock = OutputClock(rate, 0.0, 0.0).put_right(data)
    measured = clock.measured
    correlation = np.mean([_correlation(measured[o], simulated[o]) for o in measured], axis=0)
    farthest = int(_FARTHEST * count)
    shifts = np.arange(-farthest, farthest + 1)
    values = correlation[shifts]
    near = np.flatnonzero(values >= np.max(values) - _ALIKE)
    nearest = near[np.argmin(np.abs(shifts[near]))]
    peak = _peak(values, int(nearest))
    return OutputClock(rate, -step * float(shifts[peak]), float(values[peak]))


def _peak(values: Array, at: int) -> int:
    """Return the top of the hill at a place."""
    while 0 < at < len(values) - 1:
        higher = max(at - 1, at + 1, key=lambda k: values[k])
        if values[higher] <= values[at]:
            break
        at = higher
    return at


def _correlation(y: Array, simulated: Array) -> Array:
    """Return the correlation of an output with a simulated one, by how many samples it is late.

    Parameters
    ----------
    y : ndarray, shape (n,)
        NaN is a gap.
    simulated : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (2 n,)
        Where it is early, from the end.
    """
    there = np.isfinite(y)
    centred = np.where(there, y - np.mean(y[there]), 0.0)
    own = simulated - np.mean(simulated)
    covariance = _sums(centred, own)
    power = _sums(centred**2, np.ones_like(own)) * _sums(there.astype(float), own**2)
    least = np.finfo(float).eps * float(np.max(power)) + np.finfo(float).tiny
    return covariance / np.sqrt(np.maximum(power, least))


def _sums(late: Array, early: Array) -> Array:
    """Return the sums of products of two signals (n,), by samples that the first is late."""
    count = 2 * len(late)
    spectrum = np.fft.rfft(late, count) * np.conj(np.fft.rfft(early, count))
    return np.fft.irfft(spectrum, count)
