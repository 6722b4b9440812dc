"""Overview of a file before it is used: its columns, their units, the clock and its gaps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.records.mapping import Match
from orchestration.records.proposal import Proposal, propose
from orchestration.records.reading import time_in_seconds
from orchestration.records.sampling import Samples, evenly_sampled, keep_span, repair_clock
from orchestration.records.selection import open_table
from orchestration.records.source import Reading, Source
from orchestration.records.tables import Column, Table, numbers, unit_in_name
from orchestration.records.times import (
    TIME,
    complementary_column,
    find_time,
    first_text,
    holds_instants,
    merge_date_and_time,
)


@dataclass(frozen=True)
class ColumnOverview:
    """One column of a file.

    Attributes
    ----------
    name : str
        Name for ``--map``.
    unit : str
        Empty where the file states none.
    guess : str
        Unit that the name suggests where the file states none; empty if it suggests none.
    content : str
        ``numbers``, ``dates``, ``text`` or ``nothing``.
    smallest, largest : float
        In the unit of the file; NaN without numbers.
    missing : int
        Cells without a value.
    example : str
        The first cell that is not empty, of dates and text; else empty.
    """

    name: str
    unit: str
    guess: str
    content: str
    smallest: float
    largest: float
    missing: int
    example: str


@dataclass(frozen=True)
class ClockOverview:
    """The time of a file.

    Attributes
    ----------
    column : str
    samples : int
    start, duration, step : float
        Seconds; the step is the median.
    is_even : bool
        False where steps differ too much for an autoregression over samples.
    """

    column: str
    samples: int
    start: float
    duration: float
    step: float
    is_even: bool


@dataclass(frozen=True)
class FileOverview:
    """Contents of a file.

    Attributes
    ----------
    path : Path
    rows : int
    columns : list of ColumnOverview
    clock : ClockOverview or None
        None where the time cannot be used; `notes` say why.
    notes : list of str
        Repairs and notices, such as gaps.
    """

    path: Path
    rows: int
    columns: list[ColumnOverview]
    clock: ClockOverview | None
    notes: list[str]

    def proposal(self, signals: Mapping[str, str]) -> Proposal:
        """Return the probable mapping of columns to signals of a model.

        Parameters
        ----------
        signals : Mapping of str to str
            Unit by signal.

        Returns
        -------
        Proposal
        """
        time = self.clock.column if self.clock else ""
        usable = [c for c in self.columns if c.content == "numbers" and c.name != time]
        return propose({c.name: (c.unit, c.guess) for c in usable}, signals)

    def to_dict(self) -> dict[str, Any]:
        """Return a dictionary for JSON, with None for NaN."""
        return {
            "file": str(self.path),
            "rows": self.rows,
            "time": vars(self.clock) if self.clock else None,
            "columns": [_finite(vars(column)) for column in self.columns],
            "notes": self.notes,
        }


def _finite(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with None for NaN, which alone differs from itself."""
    return {k: None if v != v else v for k, v in values.items()}


def read_overview(path: str | Path | Source) -> FileOverview:
    """Return an overview of a file: its columns, their units and its clock.

    Parameters
    ----------
    path : str, Path or Source

    Returns
    -------
    FileOverview

    Raises
    ------
    UserError
        If it is of no known format. A clock that cannot be used is reported in `notes`.
    """
    source = Source.of(path)
    table = open_table(source)
    clock = None
    refusal = []
    try:
        clock = _clock(table, source.reading)
    except UserError as error:
        refusal = [str(error).removeprefix(f"{table.path}: ")]
    columns = [_column_overview(table, column) for column in table.columns]
    notes = [*(repair.message for repair in table.repairs), *refusal]
    return FileOverview(table.path, table.rows.size, columns, clock, notes)


def _clock(table: Table, reading: Reading) -> ClockOverview:
    """Return the clock of a file; raise if it has none that can be used."""
    column = find_time(table, (), table.columns)
    other = complementary_column(column, table.columns) if holds_instants(column) else None
    time_column = merge_date_and_time(table, column, other) if other else column
    time = time_in_seconds(table, Match(time_column, TIME, None), reading.discard)
    samples = Samples(table.path, time, _values(table, (column, other)), table.rows, table.repairs)
    keep_span(samples, reading.begin, reading.end)
    repair_clock(samples, reading.discard)
    clock = samples.time
    return ClockOverview(
        column=table.map_name(column),
        samples=clock.size,
        start=float(clock[0]),
        duration=float(clock[-1] - clock[0]),
        step=float(np.median(np.diff(clock))),
        is_even=evenly_sampled(clock),
    )


def _values(table: Table, times: Sequence[Column | None]) -> dict[str, Array]:
    """Return the numbers of the columns that are no times, by name."""
    values = {}
    for column in table.columns:
        if all(column is not time for time in times):
            content, cells = _content(table, column)
            if content == "numbers":
                values[column.name] = cells
    return values


def _column_overview(table: Table, column: Column) -> ColumnOverview:
    """Return the overview of a column."""
    content, values = _content(table, column)
    known = values[np.isfinite(values)]
    return ColumnOverview(
        name=table.map_name(column),
        unit=column.unit or "",
        guess="" if column.unit else unit_in_name(column.name),
        content=content,
        smallest=float(known.min()) if known.size else float("nan"),
        largest=float(known.max()) if known.size else float("nan"),
        missing=_count_missing(column, values, content),
        example=first_text(column).strip() if content in ("dates", "text") else "",
    )


def _content(table: Table, column: Column) -> tuple[str, Array]:
    """Return the content of a column, see `ColumnOverview`, and its numbers; empty for others."""
    none = np.zeros(0)
    if holds_instants(column):
        return "dates", none
    try:
        values = numbers(table, column)
    except UserError:
        return "text", none
    return ("numbers", values) if np.isfinite(values).any() else ("nothing", none)


def _count_missing(column: Column, values: Array, content: str) -> int:
    """Return the number of cells without a value: NaN among numbers, else empty cells."""
    if content == "numbers":
        return int((~np.isfinite(values)).sum())
    return sum(not str(cell).strip() for cell in column.cells)
