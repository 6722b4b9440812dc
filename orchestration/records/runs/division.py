"""Division of a file into runs: by a column of labels, or where the clock restarts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fmus.kit.arrays import Mask
from fmus.kit.errors import UserError, suggestion
from orchestration.records.record import refuse
from orchestration.records.sampling import Samples, restarts
from orchestration.records.tables import Table, parse_cell
from orchestration.reporting import option

MOST = 1000
"""Most runs in a file; a column with more values is not one of labels."""


def run_labels(table: Table, column: str, mapping: Mapping[str, str]) -> list[str]:
    """Return the label of the run of every row, from a column.

    Parameters
    ----------
    table : Table
    column : str
    mapping : Mapping of str to str
        Signal by column; such a column cannot have the labels.

    Returns
    -------
    list of str, length n
        Whole numbers are written without decimals.

    Raises
    ------
    UserError
        If there is no such column, it is mapped to a signal, a row has no value in it, or it has
        more than `MOST` values.
    """
    labels = column_labels(table, column, "runs")
    if column in mapping:
        entry = option("runs", column)
        raise UserError(f"{entry}: this column is mapped to the signal {mapping[column]}")
    if "" in labels:
        raise refuse(
            table.path,
            f"row {table.rows[labels.index('')]}: no value in column '{column}', which labels the"
            " runs",
        )
    runs = len(set(labels))
    if runs > MOST:
        raise refuse(table.path, f"column '{column}' labels {runs} runs (allowed: at most {MOST})")
    return labels


def column_labels(table: Table, column: str, argument: str) -> list[str]:
    """Return the label of every row from a column.

    Parameters
    ----------
    table : Table
    column : str
    argument : str
        Name of the option that names the column.

    Returns
    -------
    list of str, length n
        Whole numbers are written without decimals; empty where there is no value.

    Raises
    ------
    UserError
        If there is not one such column.
    """
    matches = [c for c in table.columns if c.name == column]
    if len(matches) != 1:
        count = f"{len(matches)} columns are" if matches else "no column is"
        raise refuse(
            table.path,
            f"{option(argument, column)}: {count} called {column!r}"
            f"{suggestion(column, table.names())}",
        )
    return [_label(cell) for cell in matches[0].cells]


def _label(cell: str | float) -> str:
    """Return a cell as a label; empty for a missing value."""
    value = parse_cell(cell) if isinstance(cell, str) else float(cell)
    if value is None:
        return str(cell).strip()
    return "" if np.isnan(value) else f"{value:.12g}"


def divide_by_label(samples: Samples, labels: Sequence[str]) -> list[tuple[str, Samples]]:
    """Return the label and the samples of each run, in the order of the file.

    A clock that restarts among the rows of a label begins another run: ``A-1``, ``A-2``.
    """
    row_labels = np.array(labels)
    runs = _select_runs(samples, {x: row_labels == x for x in dict.fromkeys(labels)})
    return [
        (f"{label}-{part}" if part else label, own)
        for label, run in runs
        for part, own in divide_at_restarts(run)
    ]


def divide_at_restarts(samples: Samples) -> list[tuple[str, Samples]]:
    """Return label and samples of the runs between restarts of the clock, labelled from 1.

    A single run has an empty label.
    """
    starts = restarts(samples.time)
    if not starts:
        return [("", samples)]
    rows = tuple(int(samples.rows[k]) for k in starts)
    count = len(rows) + 1
    times = "once" if len(rows) == 1 else f"{len(rows)} times"
    message = (
        f"the clock restarts {times}, first before row {rows[0]}: taken as {count} runs, 1 to"
        f" {count}"
    )
    samples.note("runs", message, rows)
    number = np.searchsorted(starts, np.arange(samples.time.size), "right") + 1
    return _select_runs(samples, {str(k): number == k for k in range(1, count + 1)})


def _select_runs(samples: Samples, masks: Mapping[str, Mask]) -> list[tuple[str, Samples]]:
    """Return label and samples of each run, selected by masks; repairs go to the first run."""
    runs: list[tuple[str, Samples]] = []
    for label, mask in masks.items():
        run = Samples(
            samples.path,
            samples.time,
            samples.values,
            samples.rows,
            [] if runs else samples.repairs,
            samples.scales,
        )
        run.keep(mask)
        runs.append((label, run))
    return runs
