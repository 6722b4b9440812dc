"""Layout of a text file: its delimiter, and the lines of its header and data."""

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
"""Rows at the end of the data from which its width and its columns of values are read."""
_TAIL = 500
"""Last lines of a file, which are searched for rows of data."""
_SEARCHED_LINES = 20
"""Lines above the first whole row in which the header is searched; some may be damaged."""


@dataclass(frozen=True)
class TextLayout:
    """The layout of a text file.

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
    """Find the header and the data of a text file by the form of the data.

    The delimiter is the one that divides most of the last lines into values. Data are rows of their
    most frequent width, with values in the same places; the header is the closest line above them
    that has words in these places.

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
    delimiter = max(DELIMITERS, key=lambda candidate: len(samples[candidate]))
    sample = samples[delimiter]
    if not sample:
        return None
    counts = Counter(map(len, sample))
    width = max(counts, key=lambda cells: (counts[cells], cells))
    rows = [row for row in sample if len(row) == width]
    values = [sum(is_value(row[k]) for row in rows) for k in range(width)]
    places = [k for k, count in enumerate(values) if 2 * count >= len(rows)]
    return _HeaderSearch(lines, delimiter, places).layout()


def _last_rows(lines: Sequence[str], delimiter: str) -> list[list[str]]:
    """Return the cells of the last lines with at least two values, the last line first."""
    rows = (_split(line, delimiter) for line in lines[-_TAIL:][::-1] if delimiter in line)
    return list(islice((r for r in rows if sum(map(is_value, r)) >= 2), _SAMPLED_ROWS))


def _split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without empty ones at its end; none if its quotes do not match."""
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
    """Search for the header, given the cells of a row in which the data have values."""

    lines: Sequence[str]
    delimiter: str
    places: Sequence[int]

    def layout(self) -> TextLayout | None:
        """Return the lines of names, units and data; None if no line looks like a header."""
        first = self._first_whole_row()
        below = None if first is None else self._header_above(first, _SEARCHED_LINES)
        if below is None:
            return None
        above = self._header_above(below, 1)
        if above is not None and are_units(self._at_places(below)):
            header = self._header(above)
            units = [*self._header(below), *[""] * len(header)]
            return TextLayout(self.delimiter, above, header, below + 1, units[: len(header)])
        return TextLayout(self.delimiter, below, self._header(below), below + 1)

    def _at_places(self, index: int) -> list[str]:
        """Return the cells of a line at the places of the data; empty where the line is shorter."""
        cells = _split(_uncommented(self.lines[index]), self.delimiter)
        return [cells[k] if k < len(cells) else "" for k in self.places]

    def _is_whole(self, index: int) -> bool:
        """Return whether at least two, and half, of the places of a line have values."""
        values = sum(map(is_value, self._at_places(index)))
        return values >= 2 and 2 * values >= len(self.places)

    def _first_whole_row(self) -> int | None:
        """Return the index of the first whole row that another whole row follows."""
        rows = (k for k, line in enumerate(self.lines) if self.delimiter in line)
        before = None
        for index in rows:
            if before is not None and self._is_whole(before) and self._is_whole(index):
                return before
            before = index
        return before if before is not None and self._is_whole(before) else None

    def _header_above(self, index: int, searched: int) -> int | None:
        """Return the index of the closest line above another one with words and no value."""
        filled = (k for k in range(index - 1, -1, -1) if self.lines[k].strip())
        for above in islice(filled, searched):
            cells = [cell for cell in self._at_places(above) if cell.strip()]
            if 2 * len(cells) > len(self.places) and not any(map(is_value, cells)):
                return above
        return None

    def _header(self, index: int) -> list[str]:
        """Return the cells of a header line."""
        line = _uncommented(self.lines[index])
        if '"' not in line:
            return line.split(self.delimiter)
        return next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True))


def _uncommented(line: str) -> str:
    """Return a line without a leading ``#``, behind which some programs write their header."""
    return re.sub("^ *#+ *", "", line)
