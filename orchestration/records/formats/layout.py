"""Layout of a text file: its delimiter, and the lines of its header and data."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise

from orchestration.records.tables import are_units, is_no_value, is_unit
from orchestration.records.times import is_instant

SPACE = " "
"""Delimiter of columns with any number of spaces between them."""
DELIMITERS = "\t;,|" + SPACE
_NUMBER = re.compile(
    r"[+\u2212-]?(?:\d[\d.,'’ \u00a0\u202f]*|[.,]\d+)(?:[eEdD][+\u2212-]?\d+)?(?P<unit>.*)"
)
_COMMENT = re.compile(r"\s*(?:#|%|//)")
_SAMPLED_ROWS = 9
"""Rows at the end of the data from which its width and its columns of values are read."""
TAIL = 500
"""Last lines of a file, which are searched for rows of data."""
_SEARCHED_LINES = 20
"""Lines above the first whole row in which the header is searched; some may be damaged."""
_LEAST_ROWS = 10
_LEAST_SHARE = 0.1
"""Rows of another table in a file, and share of those of the largest; fewer are settings."""


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

    def below(self, offset: int) -> TextLayout:
        """Return the layout of a file with so many lines above."""
        return replace(self, names=self.names + offset, first=self.first + offset)


def is_value(cell: str) -> bool:
    """Return whether a cell is a number in any notation, a date or a time of day."""
    text = cell.strip()
    number = _NUMBER.fullmatch(text)
    return (number is not None and not number["unit"]) or is_instant(text)


def _is_measured(cell: str) -> bool:
    """Return whether a cell is a value, or a number with its unit."""
    number = _NUMBER.fullmatch(cell.strip())
    return is_value(cell) or (number is not None and is_unit(number["unit"].strip()))


def _is_one_value(text: str) -> bool:
    """Return whether a line or a cell is one value, which no delimiter may divide."""
    return is_value(text) and not any(delimiter in text.strip() for delimiter in DELIMITERS)


def find_layout(lines: Sequence[str], columns: Sequence[str] = ()) -> TextLayout | None:
    """Find the header and the data of a text file by the form of the data.

    The delimiter is the one that divides most of the last lines into values, and a header into as
    many cells. Data are rows of their most frequent width, with values in the same places; the
    header is the closest line above them that has words in these places. Lines of one value each
    are one column.

    Parameters
    ----------
    lines : sequence of str
        All lines of the file.
    columns : sequence of str
        Header cells that the user states, of a file without a header.

    Returns
    -------
    TextLayout or None
        None if there is no header above rows of values.
    """
    last = [line for line in lines[-TAIL:] if line.strip()]
    if 2 * sum(map(_is_one_value, last)) > len(last):
        return _find_column(lines, columns)
    for holds in (is_value, _is_measured):
        layout = _find(lines, columns, holds)
        if layout is not None:
            return layout
    return None


def _find_column(lines: Sequence[str], columns: Sequence[str]) -> TextLayout | None:
    """Return the layout of lines of one value; None if a line above them names several columns."""
    layout = _HeaderSearch(lines, SPACE, 1, [0], _is_one_value).layout(columns)
    if layout is not None and not columns and re.search("[\\t;,|]", lines[layout.names]):
        return None
    return layout


def _find(
    lines: Sequence[str], columns: Sequence[str], holds: Callable[[str], bool]
) -> TextLayout | None:
    """Return the layout of lines in which cells hold a value by a predicate; None without one."""
    samples = {delimiter: _last_rows(lines, delimiter, holds) for delimiter in DELIMITERS}
    most = max(map(len, samples.values()))
    candidates = [d for d in DELIMITERS if samples[d] and len(samples[d]) == most]
    layouts = []
    for delimiter in candidates:
        width, places = _form_of(samples[delimiter], holds)
        layout = _HeaderSearch(lines, delimiter, width, places, holds).layout(columns)
        if layout is not None and len(layout.header) == width:
            return layout
        layouts.append(layout)
    return next((layout for layout in layouts if layout is not None), None)


def _form_of(sample: Sequence[list[str]], holds: Callable[[str], bool]) -> tuple[int, list[int]]:
    """Return the most frequent width of rows, and the places in which they have values."""
    counts = Counter(map(len, sample))
    width = max(counts, key=lambda cells: (counts[cells], cells))
    rows = [row for row in sample if len(row) == width]
    values = [sum(holds(row[k]) for row in rows) for k in range(width)]
    return width, [k for k, count in enumerate(values) if 2 * count >= len(rows)]


def find_tables(lines: Sequence[str]) -> list[range]:
    """Find the tables of a text file, each from its header to that of the next one.

    Parameters
    ----------
    lines : sequence of str
        All lines of the file.

    Returns
    -------
    list of range
        Indices of lines; of the whole file if there is one table.
    """
    samples = {delimiter: _last_rows(lines, delimiter, is_value) for delimiter in DELIMITERS}
    delimiter = max(DELIMITERS, key=lambda candidate: len(samples[candidate]))
    headers: dict[tuple[str, ...], int] = {}
    for index, line in enumerate(lines[:-2]):
        if line[:1].isdigit() or delimiter not in line:  # most lines are rows
            continue
        cells = split_header(line, delimiter)
        if _is_header(cells) and _is_row(lines[index + 1 : index + 4], delimiter, len(cells)):
            headers.setdefault(tuple(cells), index)
    starts = [*headers.values(), len(lines)]
    tables = [range(first, end) for first, end in pairwise(starts)]
    largest = max(map(len, tables), default=0)
    large = [t for t in tables if len(t) > max(_LEAST_ROWS, _LEAST_SHARE * largest)]
    return large if len(large) > 1 else [range(len(lines))]


def _is_header(cells: Sequence[str]) -> bool:
    """Return whether cells are words, and no units or values."""
    filled = [cell for cell in cells if cell.strip()]
    return (
        len(filled) >= 2
        and len(filled) == len(cells)
        and not any(map(is_value, filled))
        and not are_units(filled)
    )


def _is_row(below: Sequence[str], delimiter: str, width: int) -> bool:
    """Return whether the first line below a header, but for units, has its width and values."""
    rows = [split(line, delimiter) for line in below if line.strip()]
    rows = [row for row in rows if not are_units(row)]
    return bool(rows) and len(rows[0]) == width and sum(map(is_value, rows[0])) >= 2


def is_aside(line: str, cells: Sequence[str], layout: TextLayout) -> bool:
    """Return whether a line among rows is none: a comment, or words that are not as many cells.

    Between spaces a sentence may have as many words as a row has cells.
    """
    width = len(layout.header)
    filled = [cell for cell in cells if cell.strip()]
    if _COMMENT.match(line):
        return len(cells) != width or not any(map(is_value, filled))
    may_be = len(filled) != width or layout.delimiter == SPACE
    return may_be and not any(is_value(c) or is_no_value(c) for c in filled)


def _last_rows(
    lines: Sequence[str], delimiter: str, holds: Callable[[str], bool]
) -> list[list[str]]:
    """Return the cells of the last lines with at least two values, the last line first."""
    rows = (split(line, delimiter) for line in lines[-TAIL:][::-1] if delimiter in line)
    return list(islice((r for r in rows if sum(map(holds, r)) >= 2), _SAMPLED_ROWS))


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without empty ones at its end; none if its quotes do not match."""
    try:
        cells = split_strictly(line, delimiter)
    except csv.Error:
        return []
    while cells and not cells[-1].strip():
        cells.pop()
    return cells


def split_strictly(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; raise csv.Error if its quotes do not match."""
    if delimiter == SPACE:
        line = re.sub(r"\s+", SPACE, line.strip())
    if '"' not in line:
        return line.split(delimiter)
    return next(csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True))


def split_header(line: str, delimiter: str, width: int = 0) -> list[str]:
    """Return the cells of a header line, of which those between spaces may contain some.

    A space before brackets divides no cells, nor do single spaces if that gives the `width`.
    """
    line = _uncommented(line)
    if delimiter != SPACE or '"' in line:
        return split(line, delimiter)
    text = line.strip()
    for divided in (r"\s+(?![(\[])", r"\s{2,}|\t", r"\s+"):
        cells = re.split(divided, text)
        if not width or len(cells) == width:
            return cells
    return text.split()


@dataclass(frozen=True)
class _HeaderSearch:
    """Search for the header, given the width of rows, and their places of what holds a value."""

    lines: Sequence[str]
    delimiter: str
    width: int
    places: Sequence[int]
    holds: Callable[[str], bool]

    def layout(self, columns: Sequence[str]) -> TextLayout | None:
        """Return the lines of names, units and data; None if no line looks like a header."""
        first = self._first_whole_row()
        if first is not None and columns:
            return TextLayout(self.delimiter, first - 1, list(columns), first)
        below = None if first is None else self._header_above(first, _SEARCHED_LINES)
        if below is None:
            return None
        above = self._header_above(below, 1)
        if above is not None and _is_row_of_units(*map(self._at_places, (above, below))):
            header = self._header(above)
            units = [*self._header(below), *[""] * len(header)]
            return TextLayout(self.delimiter, above, header, below + 1, units[: len(header)])
        return TextLayout(self.delimiter, below, self._header(below), below + 1)

    def _at_places(self, index: int) -> list[str]:
        """Return the cells of a line at the places of the data; empty where the line is shorter."""
        cells = split_header(self.lines[index], self.delimiter, self.width)
        return [cells[k] if k < len(cells) else "" for k in self.places]

    def _is_whole(self, index: int) -> bool:
        """Return whether half of the places of a line, and at least two of several, have values."""
        values = sum(map(self.holds, self._at_places(index)))
        return values >= min(2, self.width) and 2 * values >= len(self.places)

    def _first_whole_row(self) -> int | None:
        """Return the index of the first whole row that another whole row follows."""
        rows = (k for k, line in enumerate(self.lines) if self.width == 1 or self.delimiter in line)
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
            if 2 * len(cells) > len(self.places) and not any(map(self.holds, cells)):
                return above
        return None

    def _header(self, index: int) -> list[str]:
        """Return the cells of a header line."""
        line = _uncommented(self.lines[index])
        if self.delimiter == SPACE:
            return split_header(line, self.delimiter, self.width)
        if '"' not in line:
            return line.split(self.delimiter)
        return next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True))


def _is_row_of_units(names: Sequence[str], cells: Sequence[str]) -> bool:
    """Return whether cells below names are units: all are, or some are and recur, as no name does.

    So units are told that nobody knows, such as ``DEG/S`` and ``PROZENT``.
    """
    recurs = len(set(cells)) < len(cells) and len(set(names)) == len(names)
    return are_units(cells) or (recurs and any(map(is_unit, cells)))


def _uncommented(line: str) -> str:
    """Return a line without a leading ``#``, behind which some programs write their header."""
    return re.sub("^ *(?:#+|%+|//) *", "", line)
