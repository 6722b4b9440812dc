"""Where the header and the data of a text file are, whatever stands above them."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice

from orchestration.records.tables import are_units
from orchestration.records.times import is_instant

DELIMITERS = "\t;,"
_NUMBER = re.compile(r"[+-]?(?:\d[\d.,'’ \u00a0\u202f]*|[.,]\d+)(?:[eE][+-]?\d+)?")
_SAMPLED_ROWS = 9
"""Rows at the end of the data that tell how wide it is, and which of its columns have values."""
_TAIL = 500
"""Last lines of a file, of which some are data."""
_SEARCHED_LINES = 20
"""Lines between the header and the first row that is whole; there may be units and damage."""


@dataclass(frozen=True)
class TextLayout:
    """The form of a text file.

    Attributes
    ----------
    delimiter : str
    names : int
        Index of the line that names the columns.
    header : list of str
        Its cells.
    first : int
        Index of the first line of data.
    units : list of str
        Cells of a row of units below the names, if there is one.
    """

    delimiter: str
    names: int
    header: list[str]
    first: int
    units: list[str] = field(default_factory=list)


def is_value(cell: str) -> bool:
    """Return whether a cell is a number in any notation, a date or a time of day."""
    text = cell.strip()
    return _NUMBER.fullmatch(text) is not None or is_instant(text)


def find_layout(lines: Sequence[str]) -> TextLayout | None:
    """Find header and data by the form of the data: rows of one width, values in the same places.

    Parameters
    ----------
    lines : sequence of str
        All lines of the file.

    Returns
    -------
    TextLayout or None
        None if there is no header above rows of at least two values.
    """
    samples = {delimiter: _last_rows(lines, delimiter) for delimiter in DELIMITERS}
    delimiter = max(DELIMITERS, key=lambda one: len(samples[one]))
    sample = samples[delimiter]
    if not sample:
        return None
    width = max(Counter(map(len, sample)).items(), key=lambda item: item[::-1])[0]
    rows = [row for row in sample if len(row) == width]
    places = [k for k in range(width) if 2 * sum(is_value(r[k]) for r in rows) >= len(rows)]
    return _HeaderSearch(lines, delimiter, places).layout()


def _last_rows(lines: Sequence[str], delimiter: str) -> list[list[str]]:
    """Return the cells of the last few lines that have two values or more."""
    rows = (_split(line, delimiter) for line in lines[-_TAIL:][::-1] if delimiter in line)
    return list(islice((r for r in rows if sum(map(is_value, r)) >= 2), _SAMPLED_ROWS))


def _split(line: str, delimiter: str) -> list[str]:
    """Split a line into cells, without empty ones at its end; nothing of a line that is broken."""
    if '"' not in line:
        cells = line.split(delimiter)
    else:
        reader = csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True)
        try:
            cells = next(reader)
        except csv.Error:
            return []
    while cells and not cells[-1].strip():
        cells.pop()
    return cells


@dataclass(frozen=True)
class _HeaderSearch:
    """The search for the header, given the places in a row at which the data have values."""

    lines: Sequence[str]
    delimiter: str
    places: Sequence[int]

    def layout(self) -> TextLayout | None:
        """Return where names, units and data are; None if no row is like a header."""
        whole = self._first_whole_row()
        below = None if whole is None else self._header_above(whole, _SEARCHED_LINES)
        if below is None:
            return None
        above = self._header_above(below, 1)
        if above is not None and are_units(self._at_places(below)):
            header = self._header(above)
            units = [*self._header(below), *[""] * len(header)]
            return TextLayout(self.delimiter, above, header, below + 1, units[: len(header)])
        return TextLayout(self.delimiter, below, self._header(below), below + 1)

    def _at_places(self, index: int) -> list[str]:
        """Return the cells of a line that have values in the data; empty where it has none."""
        cells = _split(_uncommented(self.lines[index]), self.delimiter)
        return [cells[k] if k < len(cells) else "" for k in self.places]

    def _is_whole(self, index: int) -> bool:
        values = sum(map(is_value, self._at_places(index)))
        return values >= 2 and 2 * values >= len(self.places)

    def _first_whole_row(self) -> int | None:
        """Return the index of the first row of data that another one follows."""
        filled = (k for k, line in enumerate(self.lines) if self.delimiter in line)
        before = None
        for index in filled:
            if before is not None and self._is_whole(before) and self._is_whole(index):
                return before
            before = index
        return before if before is not None and self._is_whole(before) else None

    def _header_above(self, index: int, searched: int) -> int | None:
        """Return the index of the closest line above another one that has words, but no value."""
        filled = (k for k in range(index - 1, -1, -1) if self.lines[k].strip())
        for above in islice(filled, searched):
            cells = [cell for cell in self._at_places(above) if cell.strip()]
            if 2 * len(cells) > len(self.places) and not any(map(is_value, cells)):
                return above
        return None

    def _header(self, index: int) -> list[str]:
        line = _uncommented(self.lines[index])
        if '"' not in line:
            return line.split(self.delimiter)
        return next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True))


def _uncommented(line: str) -> str:
    """Return a line without the mark of a comment: some write their header behind one."""
    return line.lstrip(" ").lstrip("#").lstrip(" ") if line.lstrip(" ").startswith("#") else line
