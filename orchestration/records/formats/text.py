"""Delimited text: CSV in its usual dialects, with the line numbers of an editor."""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.kit import UserError
from orchestration.records.formats.decimals import normalise_decimals
from orchestration.records.formats.layout import DELIMITERS, TextLayout, find_layout
from orchestration.records.record import Repair, list_rows, refuse
from orchestration.records.tables import Column, Table, parse_cell, plain_unit, read_header_cell

_CONTROL = re.compile("[\x00-\x08\x0b\x0e-\x1f\x7f\x80-\x9f]")
_LINE_END = re.compile(r"\r\n|\n|\r")
EXPECTED = "expected a header such as 'time [s],current [A]' and rows of numbers below it"


@dataclass(frozen=True)
class Lines:
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
    """

    path: Path
    lines: list[str]
    ended: bool
    repairs: list[Repair]

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
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True))
    except csv.Error as error:
        raise refuse(path, f"row {row}: the quotes do not match ({error})") from error


def _sniff_delimiter(header: str) -> str | None:
    """Return the delimiter of a header line, outside quotes and brackets; None if there is none."""
    bare = re.sub(r'"[^"]*"|\[[^\]]*\]', "", header)
    return next((delimiter for delimiter in DELIMITERS if delimiter in bare), None)


def read_text(path: Path, content: bytes) -> Table:
    """Read a CSV file; a `Reader`.

    Cells are text, numbers with a decimal point.
    """
    text = decode(path, content)
    layout = find_layout(text.lines) or _plain_layout(text)
    above = [
        row
        for row, line in enumerate(text.lines[: layout.names], start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if above:
        message = f"skipped above the header, which is row {layout.names + 1}: {list_rows(above)}"
        text.repairs.append(Repair("preamble", message))
    return tabulate(text, layout)


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
    if delimiter is None:
        raise refuse(
            text.path,
            f"row {start + 1}: '{lines[start].strip()[:60]}' is not a header of several columns;"
            f" {EXPECTED}",
        )
    header = text.split(start, delimiter)
    if all(parse_cell(cell) is not None for cell in header):
        raise refuse(text.path, f"row {start + 1}: numbers where the header should be; {EXPECTED}")
    return TextLayout(delimiter, start, header, start + 1)


def tabulate(text: Lines, layout: TextLayout, optional_last: bool = False) -> Table:
    """Split the lines below a header into columns.

    Parameters
    ----------
    text : Lines
        All lines of the file.
    layout : TextLayout
        Lines of the header and the data.
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
    header = layout.header
    delimiter = layout.delimiter
    records: list[list[str]] = []
    rows: list[int] = []
    blank: list[int] = []
    for index in range(layout.first, len(text.lines)):
        row = index + 1
        if not text.lines[index].strip():
            blank.append(row)
            continue
        cells = _cells(text, index, delimiter, len(header), optional_last)
        if _is_partial(cells, header, index == len(text.lines) - 1, text.ended):
            message = f"row {row}, the last, is cut off: dropped"
            text.repairs.append(Repair("partial line", message, (row,)))
            continue
        if len(cells) != len(header):
            raise _wrong_width(text.path, row, len(cells), len(header), delimiter)
        records.append(cells)
        rows.append(row)
    if not records:
        raise refuse(
            text.path,
            f"there is a header (row {layout.names + 1}) but no complete row of data below it",
        )
    if blank:
        message = f"{len(blank)} blank lines skipped ({list_rows(blank)})"
        text.repairs.append(Repair("blank lines", message, tuple(blank)))
    if not text.ended and rows[-1] == len(text.lines):
        message = (
            f"row {rows[-1]}, the last, has no line end: its last number may be cut short; it was"
            " kept"
        )
        text.repairs.append(Repair("no line end", message, (rows[-1],)))
    columns = _make_columns(layout, records)
    table = Table(text.path, columns, np.array(rows, dtype=np.int64), text.repairs)
    normalise_decimals(table, delimiter == ",")
    return table


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
    return refuse(path, f"row {row}: {count} cells where the header has {width}{hint}")


def _is_partial(cells: list[str], header: list[str], is_last: bool, ended: bool) -> bool:
    """Return whether a line is incomplete because the file was cut off while it was written."""
    if not is_last:
        return False
    if len(cells) < len(header):
        return True
    if ended or len(cells) > len(header) or not header[-1].strip():
        return False
    last = cells[-1].strip()
    starts_number = re.fullmatch(r"[+-]?(\d*\.?\d*([eE][+-]?)?)?", last) is not None
    is_number = last != "" and parse_cell(last.replace(",", ".")) is not None
    return starts_number and not is_number


def _make_columns(layout: TextLayout, records: list[list[str]]) -> list[Column]:
    """Return the columns of rows of cells, without those that have neither name nor content."""
    columns = []
    units = layout.units or [""] * len(layout.header)
    for cell, below, cells in zip(layout.header, units, zip(*records, strict=True), strict=True):
        name, unit = read_header_cell(cell)
        unit = unit or plain_unit(below)
        if name or unit or any(text.strip() for text in cells):
            columns.append(Column(name, unit, cells, cell.strip()))
    return columns
