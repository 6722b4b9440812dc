"""Spreadsheets of Office and OpenDocument, each sheet a table of text."""

from __future__ import annotations

import io
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

from fmus.kit.extras import optional
from orchestration.records.formats.text import Lines, choose_table, read_lines
from orchestration.records.record import damaged, refuse
from orchestration.records.source import AS_IT_STANDS, Reading
from orchestration.records.tables import Table

_SPACES = str.maketrans("\t\r\n", "   ")


def read_spreadsheet(path: Path, content: bytes, reading: Reading = AS_IT_STANDS) -> Table:
    """Read a sheet of a spreadsheet; a `Reader`.

    Cells become text, numbers with all their digits and dates in ISO 8601, in which header, units
    and other lines are found as in any text; rows have the numbers that the spreadsheet shows. Of
    several sheets with data the user names one. A damaged file is refused; without python-calamine
    any file is.
    """
    with optional():
        from python_calamine import CalamineWorkbook
    with damaged(path, "spreadsheet"):
        book = CalamineWorkbook.from_filelike(io.BytesIO(content))
        sheets = {
            name: book.get_sheet_by_name(name).to_python(skip_empty_area=False)
            for name in book.sheet_names
        }
    filled = {name: rows for name, rows in sheets.items() if len(rows) > 1}
    if not filled:
        raise refuse(path, "no sheet holds a table")
    names = list(filled)
    rows = filled[names[choose_table(path, names, reading.table)]]
    # midnight is a date without a time
    timed = {k for row in rows for k, cell in enumerate(row) if isinstance(cell, datetime)}
    lines = ["\t".join(_text(cell, k in timed) for k, cell in enumerate(row)) for row in rows]
    while lines and not lines[-1].strip():
        lines.pop()
    decimal = Reading(columns=reading.columns, decimal=reading.decimal or "point")
    return read_lines(Lines(path, lines, True, []), decimal)


def _text(cell: Any, is_timed: bool) -> str:
    """Return a cell as text, durations in s; in a column of instants a date is its midnight."""
    if isinstance(cell, datetime):
        return cell.isoformat(sep=" ", timespec="microseconds")
    if isinstance(cell, date | time):
        return f"{cell.isoformat()} 00:00:00" if is_timed else cell.isoformat()
    if isinstance(cell, timedelta):
        return f"{cell.total_seconds()!r}"
    if isinstance(cell, bool):
        return str(cell).lower()
    if isinstance(cell, float):
        return f"{int(cell)}" if cell.is_integer() and abs(cell) < 2**53 else repr(cell)
    return str(cell).translate(_SPACES)
