"""Sampling times: a fitted model decides between the time stamps and an even clock.

A converter samples evenly by its own crystal, and a computer stamps a sample when it gets round to
it; or a computer asks for each sample when it gets round to it, and says truly when. The stamps are
alike. The outputs tell: where they move, a wrong time is an error of measurement times their slope
(errors in variables, of the time).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fmus.kit import UserError
from orchestration.discrepancy.candidates import FittedCandidate, encompassing
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection.input_noise import simulated
from orchestration.discrepancy.selection.search import Search

_LEAST = 1e-4  # of a step, deviation of stamps below which no simulation differs
_FARTHEST = 0.5  # of a step, from where a stamp may be that of a neighbour


def evened(data: Dataset) -> Dataset | None:
    """Return a record by the even clock that its stamps scatter about; None if there is none."""
    time = data.time.copy()
    scatter = 0.0
    for run in data.runs:
        stamps = data.time[run.samples]
        count = np.arange(len(stamps))
        if len(stamps) < 3:
            return None
        even = np.polyval(np.polyfit(count, stamps, 1), count)
        step = (even[-1] - even[0]) / count[-1]
        if np.abs(stamps - even).max() > _FARTHEST * step:
            return None
        time[run.samples] = even
        scatter = max(scatter, float(np.std(stamps - even)) / step)
    return replace(data, time=time) if scatter > _LEAST else None


def by(notes: Iterable[Note], data: Dataset) -> Dataset:
    """Return a record by the clock that notes of a diagnosis say it has."""
    even = any(note.code is NoteCode.EVEN_CLOCK for note in notes)
    return (evened(data) if even else None) or data


def by_fit(search: Search, base: FittedCandidate) -> tuple[Search, FittedCandidate, list[Note]]:
    """Decide by the record whether it was sampled evenly.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
        The base model, fitted by the stamps.

    Returns
    -------
    search, base
        The same, or by the even clock.
    notes : list of Note
        Says so, if it is the even one.
    """
    data = evened(search.data)
    if data is None:
        return search, base, []
    other = replace(search, data=data)
    try:
        (amount,) = encompassing(base, [simulated(search, base, data)])
        if not amount.margin > 0.0:
            return search, base, []
        fitted = other.refit(base)
    except UserError:
        return search, base, []
    margin = base.fit.bic - fitted.fit.bic
    if margin <= 0.0:
        return search, base, []
    jitter = float(np.std((data.time - search.data.time)[data.within]))
    return other, fitted, [Note(NoteCode.EVEN_CLOCK, "", {"jitter": jitter, "margin": margin})]
