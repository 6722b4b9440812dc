"""Delimited text: CSV in its usual dialects, with the line numbers of an editor."""

from __future__ import annotations

import csv
import re
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.records.formats.cell_units import strip_units
from orchestration.records.formats.decimals import has_decimal_points, normalise_decimals
from orchestration.records.formats.layout import (
    DELIMITERS,
    TAIL,
    TextLayout,
    find_layout,
    find_tables,
    is_aside,
    is_value,
    split_strictly,
)
from orchestration.records.formats.plain import NotPlain, read_plain
from orchestration.records.record import Repair, Repaired, list_rows, refuse
from orchestration.records.source import AS_IT_STANDS, Reading
from orchestration.records.tables import Column, Table
from orchestration.reporting import option

_CONTROL = re.compile("[\x00-\x08\x0b\x0e-\x1f\x7f\x80-\x9f]")
_LINE_END = re.compile(r"\r\n|\n|\r")
_HEAD = re.compile(rb"(?:[^\n]*+\n){%d}" % TAIL)
_FOLDED = 1 << 19
"""Least bytes between the first and the last lines of a file that are folded; fewer are read line
by line in the time that it takes to import pyarrow."""
EXPECTED = "expected a header such as 'time [s],current [A]' and rows of numbers below it"


@dataclass(frozen=True)
class Lines(Repaired):
    """The lines of a text file.

    Attributes
    ----------
    path : Path
        The file, for messages.
    lines : list of str
        Without their ends and without empty ones at the end of the file.
    ended : bool
        Whether the last line has a line end.
    repairs : list of Repair
        Repairs so far, which the table takes over.
    head : int
        Number of lines above those that are folded.
    folded : memoryview
        Lines that are not in `lines`; they must be rows of numbers.
    count : int
        Number of them, once they are read.
    """

    path: Path
    lines: list[str]
    ended: bool
    repairs: list[Repair]
    head: int = 0
    folded: memoryview | None = None
    count: int = 0

    def row(self, index: Any) -> Any:
        """Return the number of the line at an index, as an editor counts; of several alike."""
        return index + 1 + self.count * (index >= self.head)

    def until(self, stop: int) -> Lines:
        """Return the lines before an index; raise NotPlain if some are folded."""
        if self.folded:
            raise NotPlain("several tables")
        return replace(self, lines=self.lines[:stop], ended=self.ended or stop < len(self.lines))

    def split(self, index: int, delimiter: str) -> list[str]:
        """Return the cells of the line at an index, see :func:`split_line`."""
        return split_line(self.path, index + 1, self.lines[index], delimiter)


def decode(path: Path, content: bytes) -> Lines:
    """Decode a text file and split it into lines.

    Parameters
    ----------
    path : Path
        The file, for the message.
    content : bytes
        UTF-8, UTF-16 with a byte order mark, or Windows-1252.

    Returns
    -------
    Lines

    Raises
    ------
    UserError
        If the content is not text.
    """
    repairs = []
    try:
        is_utf16 = content.startswith((b"\xff\xfe", b"\xfe\xff"))
        text = content.decode("utf-16" if is_utf16 else "utf-8-sig")
    except UnicodeDecodeError:
        # a file with NUL is refused below, and a large one is decoded faster as Latin-1
        text = content.decode("latin-1" if b"\x00" in content else "cp1252", errors="replace")
        repairs.append(Repair("encoding", "the file is not UTF-8; it was read as Windows-1252"))
    if _CONTROL.search(text) or "\ufffd" in text:
        raise refuse(
            path, f"this is not a text file, and no binary format that is known; {EXPECTED}"
        )
    lines = _LINE_END.split(text)
    ended = lines[-1].strip() == ""
    while lines and not lines[-1].strip():
        lines.pop()
    return Lines(path, lines, ended, repairs)


def _folded(path: Path, content: bytes) -> Lines | None:
    """Return the lines at both ends of a large file, with those between folded; None of others."""
    head = _HEAD.match(content)
    start = head.end() if head else len(content)
    stop = len(content)
    for _ in range(TAIL + 1):
        stop = content.rfind(b"\n", start, max(start, stop))
    if stop - start < _FOLDED:
        return None
    ends = decode(path, content[:start] + content[stop + 1 :])
    above = len(_LINE_END.findall(content[:start].decode("latin-1")))
    if len(ends.lines) < above + TAIL:
        return None
    return replace(ends, head=above, folded=memoryview(content)[start : stop + 1])


def split_line(path: Path, row: int, line: str, delimiter: str) -> list[str]:
    """Split a line into cells, with regard to double quotes.

    Parameters
    ----------
    path : Path
        The file, for the message.
    row : int
        Line number, for the message.
    line : str
        The line without its end.
    delimiter : str
        One character.

    Returns
    -------
    list of str
        The cells.

    Raises
    ------
    UserError
        If a quote is not closed on the line.
    """
    try:
        return split_strictly(line, delimiter)
    except csv.Error as error:
        raise refuse(path, f"row {row}: the quotes do not match ({error})") from error


def _sniff_delimiter(header: str) -> str | None:
    """Return the delimiter of a header line, outside quotes and brackets; None if there is none."""
    bare = re.sub(r'"[^"]*"|\[[^\]]*\]', "", header)
    return next((delimiter for delimiter in DELIMITERS if delimiter in bare), None)


def read_text(path: Path, content: bytes, reading: Reading = AS_IT_STANDS) -> Table:
    """Read a CSV file; a `Reader`.

    Cells are text, numbers with a decimal point.
    """
    with suppress(UserError):  # read whole it is refused, too, with the right number of the row
        if not reading.texts and (folded := _folded(path, content)):
            return read_lines(folded, reading)
    return read_lines(decode(path, content), reading)


def read_lines(text: Lines, reading: Reading = AS_IT_STANDS) -> Table:
    """Read the table in lines of text: one of several if the user names it.

    Parameters
    ----------
    text : Lines
    reading : Reading
        Names of columns, decimal mark and table, where lines do not tell them.

    Returns
    -------
    Table

    Raises
    ------
    UserError
        If there is no table, several of which none is named, or a row is not of its form.
    """
    text = _turned(text)
    tables = find_tables(text.lines)
    chosen = tables[0]
    if len(tables) > 1:
        names = [", ".join(text.lines[t.start].split())[:60] for t in tables]
        chosen = tables[choose_table(text.path, names, reading.table)]
        text = text.until(chosen.stop)
    layout = find_layout(text.lines[chosen.start :], stated_header(reading.columns))
    layout = layout.below(chosen.start) if layout else _plain_layout(text)
    begin, found = layout.names, "header, which is"
    if reading.columns:
        begin, found = layout.first, "data, of which the first is"
    above = [
        row
        for row, line in enumerate(text.lines[:begin], start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if above:
        text.note("preamble", f"skipped above the {found} row {begin + 1}: {list_rows(above)}")
    return tabulate(text, layout, reading)


def _turned(text: Lines) -> Lines:
    """Return a line for each number of a file that is one line of them: a record has many rows."""
    delimiter = _sniff_delimiter(text.lines[0]) if len(text.lines) == 1 else None
    cells = text.split(0, delimiter) if delimiter else []
    numbers = cells[:-1] if cells and not cells[-1].strip() else cells
    if not numbers or not all(map(is_value, numbers)):
        return text
    text.note("one line", f"the file is one line of {len(numbers)} numbers: taken as a column")
    return replace(text, lines=numbers)


def stated_header(columns: Sequence[str]) -> list[str]:
    """Return header cells for columns that a user names, as ``name`` or ``name=unit``."""
    parts = [column.partition("=") for column in columns]
    return [f"{name.strip()} [{unit.strip()}]" if unit else name.strip() for name, _, unit in parts]


def choose_table(path: Path, names: Sequence[str], stated: str) -> int:
    """Return the index of the table of a file that a user names, or of the only one.

    Raises
    ------
    UserError
        If there are several and none, or no such table, is stated.
    """
    if len(names) == 1 and not stated:
        return 0
    if stated in names:
        return names.index(stated)
    if stated.isdigit() and 1 <= int(stated) <= len(names):
        return int(stated) - 1
    listed = "; ".join(f"{k} ({name})" for k, name in enumerate(names, start=1))
    given = f"{option('table', stated)}: " if stated else ""
    raise refuse(
        path, f"{given}there are {len(names)} tables: {listed}; name one: {option('table', '1')}"
    )


def _plain_layout(text: Lines) -> TextLayout:
    """Return a layout whose header is the first line that is not a comment."""
    lines = text.lines
    start = 0
    while start < len(lines) and (
        not lines[start].strip() or lines[start].lstrip().startswith("#")
    ):
        start += 1
    if start == len(lines):
        raise refuse(text.path, f"the file holds nothing but comments and blank lines; {EXPECTED}")
    delimiter = _sniff_delimiter(lines[start])
    header = text.split(start, delimiter) if delimiter else [lines[start]]
    if all(map(is_value, header)):
        names = [f"column{k}" for k in range(1, len(header) + 1)]
        if len(header) > 1:
            names[0] = "time=s"
        raise refuse(
            text.path,
            f"row {start + 1}: numbers where the header should be; {EXPECTED}, or name the columns:"
            f" {option('columns', names)}",
        )
    if delimiter is None:
        raise refuse(
            text.path,
            f"row {start + 1}: '{lines[start].strip()[:60]}' is not a header of several columns;"
            f" {EXPECTED}",
        )
    return TextLayout(delimiter, start, header, start + 1)


def tabulate(
    text: Lines, layout: TextLayout, reading: Reading = AS_IT_STANDS, optional_last: bool = False
) -> Table:
    """Split the lines below a header into columns.

    Parameters
    ----------
    text : Lines
        All lines of the file.
    layout : TextLayout
        Lines of the header and the data.
    reading : Reading
        With the decimal mark, where numbers do not tell it.
    optional_last : bool
        Whether a row may leave out the last cell (the comment column of LabVIEW text).

    Returns
    -------
    Table
        Columns of text cells with a decimal point.

    Raises
    ------
    UserError
        If a row has the wrong number of cells, or there is no row.
    """
    rows = _Rows([], [], [], [], [])
    for index in range(layout.first, len(text.lines)):
        _add_line(rows, text, layout, index, optional_last)
    if not rows.cells:
        raise refuse(
            text.path,
            f"there is a header (row {layout.names + 1}) but no complete row of data below it",
        )
    contents: Sequence[Sequence[str] | Array] = list(zip(*rows.cells, strict=True))
    if text.folded:
        contents = _unfold(text, layout, reading.decimal, rows)
        text = replace(text, count=len(contents[0]) - len(rows.cells))
    _note_lines(text, rows)
    above = bisect_left(rows.indices, text.head)
    folded = text.head + 1 + np.arange(text.count)
    numbers = np.insert(text.row(np.array(rows.indices)), above, folded)
    table = Table(text.path, _make_columns(layout, contents), numbers, text.repairs)
    if not text.folded:
        strip_units(table)
        normalise_decimals(table, layout.delimiter == ",", reading.decimal)
    return table


def _note_lines(text: Lines, rows: _Rows) -> None:
    """Note the lines among the rows that are none, and a last one without its end."""
    blank, aside, partial = (
        [text.row(index) for index in found] for found in (rows.blank, rows.aside, rows.partial)
    )
    for row in partial:
        text.note("partial line", f"row {row}, the last, is cut off: dropped", (row,))
    if blank:
        text.note("blank lines", f"{len(blank)} blank lines skipped ({list_rows(blank)})", blank)
    if aside:
        first = text.lines[rows.aside[0]].strip()[:40]
        message = f"{len(aside)} lines that are no rows skipped ({list_rows(aside)}): '{first}'"
        text.note("lines aside", message, aside)
    last = len(text.lines) - 1
    if not text.ended and rows.indices[-1] == last:
        message = (
            f"row {text.row(last)}, the last, has no line end: its last number may be cut short;"
            " it was kept"
        )
        text.note("no line end", message, (text.row(last),))


def _unfold(text: Lines, layout: TextLayout, decimal: str, rows: _Rows) -> list[Array | list[str]]:
    """Return the cells of each column, with those of the folded lines in their place.

    Raises
    ------
    NotPlain
        If a cell is no plain number, points may separate thousands, or the header is below.
    """
    mark = layout.delimiter
    folded = text.folded or b""
    if layout.first > text.head or not has_decimal_points(
        chain(*rows.cells), folded, mark == ",", decimal
    ):
        raise NotPlain("rows above the header, or points that may separate thousands")
    lines = [mark.join(cells).encode() for cells in rows.cells]
    place = bisect_left(rows.indices, text.head)
    parts = (b"\n".join(lines[:place]), folded, b"\n".join(lines[place:]))
    columns = read_plain(parts, mark, len(layout.header))
    return [[""] * len(cells) if np.isnan(cells).all() else cells for cells in columns]


class _Rows(NamedTuple):
    """Cells and line indices of rows of a table, and indices of other lines among them."""

    cells: list[list[str]]
    indices: list[int]
    blank: list[int]
    aside: list[int]
    partial: list[int]


def _add_line(
    rows: _Rows, text: Lines, layout: TextLayout, index: int, optional_last: bool
) -> None:
    """Add a line below the header to the rows, or to the lines among them."""
    line = text.lines[index]
    if not line.strip():
        rows.blank.append(index)
        return
    width = len(layout.header)
    cells = _cells(text, index, layout.delimiter, width, optional_last)
    is_last = index == len(text.lines) - 1
    # what begins with a digit is no comment and no header
    if not line[:1].isdigit() and _is_no_row(line, cells, layout):
        rows.aside.append(index)
    elif _is_partial(cells, layout.header, is_last, text.ended):
        rows.partial.append(index)
    elif len(cells) != width:
        raise _wrong_width(text.path, index + 1, len(cells), width, layout.delimiter)
    else:
        rows.cells.append(cells)
        rows.indices.append(index)


def _is_no_row(line: str, cells: Sequence[str], layout: TextLayout) -> bool:
    """Return whether a line is a comment, words below the data, or the header or units again."""
    if is_aside(line, cells, layout):
        return True
    return list(cells) == layout.header or (bool(layout.units) and list(cells) == layout.units)


def _cells(text: Lines, index: int, delimiter: str, width: int, optional_last: bool) -> list[str]:
    """Return the cells of a row of data, without superfluous empty ones at its end."""
    try:
        cells = text.split(index, delimiter)
    except ValueError:
        if index < len(text.lines) - 1 or text.ended:
            raise
        return []  # the file was cut inside a quoted cell
    while len(cells) > width and not cells[-1].strip():
        cells.pop()
    if optional_last and len(cells) == width - 1:
        cells.append("")
    return cells


def _wrong_width(path: Path, row: int, count: int, width: int, delimiter: str) -> UserError:
    hint = ""
    if delimiter == "," and count > width:
        hint = " (a decimal comma needs ';' between the columns)"
    elif count == 1:
        stated = f"{option('columns', 'current=A')} {option('rate', '1Hz')}"
        hint = f" (rows of one column need its name and their rate: {stated})"
    return refuse(path, f"row {row}: {count} cells where the header has {width}{hint}")


def _is_partial(cells: Sequence[str], header: Sequence[str], is_last: bool, ended: bool) -> bool:
    """Return whether a line is incomplete because the file was cut off while it was written."""
    if not is_last:
        return False
    if len(cells) < len(header):
        return True
    if ended or len(cells) > len(header) or not header[-1].strip():
        return False
    last = cells[-1].strip()
    starts_number = re.fullmatch(r"[+-]?(\d*\.?\d*([eE][+-]?)?)?", last) is not None
    return starts_number and not is_value(last)


def _make_columns(layout: TextLayout, contents: Iterable[Sequence[str] | Array]) -> list[Column]:
    """Return the columns of their cells, without those that have neither name nor content."""
    columns = []
    units = layout.units or [""] * len(layout.header)
    for cell, below, cells in zip(layout.header, units, contents, strict=True):
        column = Column.read(cell.strip(), cells, below)
        has_numbers = isinstance(cells, np.ndarray)
        if column.name or column.unit or has_numbers or any(map(str.strip, cells)):
            columns.append(column)
    return columns
