"""Several runs in one file: told apart by a column, or by a clock that restarts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fmus.kit.arrays import Mask
from fmus.kit.errors import UserError, suggestion
from orchestration.records.record import Repair, refuse
from orchestration.records.sampling import Samples, restarts
from orchestration.records.tables import Table, parse_cell
from orchestration.reporting import option

MOST = 1000
"""Runs in one file; a column with more values tells no runs apart."""


def run_marks(table: Table, column: str, mapping: Mapping[str, str]) -> list[str]:
    """Read the column that tells the runs apart.

    Parameters
    ----------
    table : Table
    column : str
    mapping : Mapping of str to str
        Column to signal; such a column is a signal and tells no runs apart.

    Returns
    -------
    list of str
        The label of the run of every row; whole numbers without decimals.

    Raises
    ------
    UserError
        If there is no such column, a row has no value in it, or it has too many values.
    """
    given_as = option("runs", column)
    named = [c for c in table.columns if c.name == column]
    if len(named) != 1:
        what = "no column is" if not named else f"{len(named)} columns are"
        raise refuse(
            table.path,
            f"{given_as}: {what} called {column!r}{suggestion(column, table.names())}",
        )
    if column in mapping:
        raise UserError(
            f"{option('runs', column)}: this column is mapped to the signal {mapping[column]}"
        )
    marks = [_label(cell) for cell in named[0].cells]
    if "" in marks:
        raise refuse(
            table.path,
            f"row {table.rows[marks.index('')]}: no value in column '{column}', which tells the"
            " runs",
        )
    if len(set(marks)) > MOST:
        raise refuse(
            table.path,
            f"column '{column}' has {len(set(marks))} values; it may tell {MOST} runs apart at"
            " most",
        )
    return marks


def _label(cell: str | float) -> str:
    value = parse_cell(cell) if isinstance(cell, str) else float(cell)
    if value is None:
        return str(cell).strip()
    return "" if np.isnan(value) else f"{value:.12g}"


def divided_by(samples: Samples, marks: Sequence[str]) -> list[tuple[str, Samples]]:
    """Divide a file by the label of every row."""
    which = np.array(marks)
    return _parts(samples, {label: which == label for label in dict.fromkeys(marks)})


def divided_at_restarts(samples: Samples) -> list[tuple[str, Samples]]:
    """Divide a file where its clock restarts, and note it; runs are numbered from 1."""
    starts = restarts(samples.time)
    if not starts:
        return [("", samples)]
    rows = tuple(int(samples.rows[k]) for k in starts)
    count = (
        f"the clock restarts {'once' if len(rows) == 1 else f'{len(rows)} times'}, first before row"
        f" {rows[0]}"
    )
    samples.repairs.append(
        Repair("runs", f"{count}: taken as {len(rows) + 1} runs, 1 to {len(rows) + 1}", rows)
    )
    number = np.searchsorted(starts, np.arange(samples.time.size), "right") + 1
    return _parts(samples, {str(k): number == k for k in range(1, len(rows) + 2)})


def _parts(samples: Samples, members: Mapping[str, Mask]) -> list[tuple[str, Samples]]:
    """Split into runs by label; repairs of the whole file are reported with the first."""
    parts: list[tuple[str, Samples]] = []
    for label, mask in members.items():
        part = Samples(
            samples.path,
            samples.time,
            samples.values,
            samples.rows,
            [] if parts else samples.repairs,
        )
        part.keep(mask)
        parts.append((label, part))
    return parts
