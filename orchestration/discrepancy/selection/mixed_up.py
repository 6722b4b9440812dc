"""Columns that are mixed up: two that changed places, or one of the other sign.

A model that misses much of a record may be right and the record wired otherwise. That is tried: the
model is fitted once more with two columns exchanged, and with the sign of one changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import parallel_map
from orchestration.discrepancy.selection.known_fits import KnownFits
from orchestration.discrepancy.selection.search import FAILURES, Search

_LARGE = 0.15  # error over the spread, from which on it is worth a look
_MUCH_NEARER = 0.5  # of that error, up to which it must fall
_MOST = 16  # ways that are tried


def mixed_up_columns(search: Search, base: FittedCandidate) -> list[Note]:
    """Return a note on columns that are mixed up, if the model is much nearer with them put right.

    Parameters
    ----------
    search : Search
        Over the record as it is.
    base : FittedCandidate
        The model without effects, fitted to that.

    Returns
    -------
    list of Note
        One, or none where no way is much nearer.
    """
    present = _error(base)
    if not present > _LARGE or search.budget.spent():
        return []
    ways = list(_ways(search.data))[:_MOST]

    def error_of(way: tuple[tuple[str, ...], Dataset]) -> float:
        again = replace(search, data=way[1], known=KnownFits(), progress=lambda text: None)
        try:
            return _error(again.nominal())
        except FAILURES:
            return np.inf

    errors = parallel_map(error_of, ways)
    if not ways or not min(errors) < _MUCH_NEARER * present:
        return []
    columns, _ = ways[int(np.argmin(errors))]
    code = NoteCode.EXCHANGED if len(columns) > 1 else NoteCode.OTHER_SIGN
    facts = {"columns": " and ".join(columns), "share": present, "instead": min(errors)}
    return [Note(code, "", facts)]


def _ways(data: Dataset) -> Iterator[tuple[tuple[str, ...], Dataset]]:
    """Yield the columns that may be mixed up, and the data with them put right."""
    columns = {**data.inputs, **data.measured}
    for one, other in combinations(columns, 2):
        if one in data.inputs and _complete(columns[one]) and _complete(columns[other]):
            yield (one, other), _with(data, {one: columns[other], other: columns[one]})
    for one in columns:
        yield (one,), _with(data, {one: -columns[one]})


def _complete(column: Array) -> bool:
    return bool(np.isfinite(column).all())


def _with(data: Dataset, columns: dict[str, Array]) -> Dataset:
    """Return data with other values in some columns."""
    inputs = {name: columns.get(name, values) for name, values in data.inputs.items()}
    measured = {name: columns.get(name, values) for name, values in data.measured.items()}
    return replace(data, inputs=inputs, measured=measured)


def _error(fitted: FittedCandidate) -> float:
    """Return the RMS error of the nearest free run over the spread, pooled over outputs."""
    fit = fitted.free_run or fitted.fit
    shares = []
    for output, residual in fit.residual.items():
        measured = fitted.problem.measured[output][fitted.problem.present[output]]
        with np.errstate(over="ignore"):  # a simulation that runs away is far off
            square = float(np.mean(residual**2))
        shares.append(square / max(float(np.var(measured)), np.finfo(float).tiny))
    return float(np.mean(shares)) ** 0.5
