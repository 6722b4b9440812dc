"""Tables of sources: read from their form, and reduced to the rows that are used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Mask
from orchestration.records.formats import read_table
from orchestration.records.record import Repair, refuse
from orchestration.records.runs import column_labels
from orchestration.records.source import AS_IT_STANDS, Reading, Source
from orchestration.records.tables import Column, Table
from orchestration.records.times import TIME
from orchestration.reporting import option


def files_of(
    path: Path, tell: Callable[[str], None], reading: Reading = AS_IT_STANDS
) -> list[Path]:
    """Return the files of a folder that have a table, by name; of another path that path.

    Parameters
    ----------
    path : Path
    tell : callable
        Called with a line about each file that is left out; hidden ones are left out silently.
    reading : Reading
        Form of the tables.
    """
    if not path.is_dir():
        return [path]
    files = []
    for file in sorted(path.iterdir()):
        if file.name.startswith(".") or not file.is_file():
            continue
        try:
            read_table(file, reading)
        except UserError as error:
            tell(f"left out, as it has no table: {error}")
        else:
            files.append(file)
    return files


def open_table(source: Source) -> Table:
    """Return the table of a file or of arrays, with the rows and the clock that its reading states.

    Parameters
    ----------
    source : Source

    Returns
    -------
    Table

    Raises
    ------
    UserError
        If it cannot be read, or has none of the rows.
    """
    reading = source.reading
    table = _with_rate(read_table(source.data, reading), reading.rate)
    return _selected(table, reading)


def _with_rate(table: Table, rate: float | None) -> Table:
    """Return a table whose time counts its rows, if their rate in Hz is stated."""
    if rate is None:
        return table
    time = Column(TIME, "s", np.arange(table.rows.size) / rate)
    others = [column for column in table.columns if column.name.casefold() != TIME]
    pace = f"{rate:g} a second" if rate >= 1 else f"one every {1 / rate:g} s"
    message = f"time counts the rows, {pace}, as stated"
    repairs = [*table.repairs, Repair("clock stated", message)]
    return replace(table, columns=[time, *others], repairs=repairs)


def _selected(table: Table, reading: Reading) -> Table:
    """Return a table with the rows of a range and of segments."""
    mask = np.ones(table.rows.size, dtype=bool)
    if reading.rows is not None:
        first, last = reading.rows
        mask &= (table.rows >= first) & (table.rows <= last)
        if not mask.any():
            raise refuse(
                table.path,
                f"{option('rows', f'{first}..{last}')}: the rows are {table.rows[0]} to"
                f" {table.rows[-1]}",
            )
    mask &= _of_segments(table, reading.segment)
    return table if mask.all() else table.keep(mask)


def _of_segments(table: Table, segment: Mapping[str, str]) -> Mask:
    """Return the rows (n,) that have one of the labels stated for each column."""
    mask = np.ones(table.rows.size, dtype=bool)
    for name, stated in segment.items():
        labels = column_labels(table, name, "segment")
        chosen = [label.strip() for label in stated.split(",")]
        known = dict.fromkeys(label for label in labels if label)
        for label in chosen:
            if label not in known:
                listed = ", ".join(list(known)[:20])
                raise refuse(
                    table.path,
                    f"{option('segment', {name: stated})}: no row has {label} (there are {listed})",
                )
        mask &= np.isin(np.array(labels), chosen)
    return mask
