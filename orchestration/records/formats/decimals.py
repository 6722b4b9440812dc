"""Normalisation of numbers: decimal commas become points, separators of thousands are removed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import chain
from typing import NamedTuple

from fmus.kit import UserError
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table
from orchestration.reporting import option

_SEPARATORS = "'’\u00a0\u202f "
_NUMBER = re.compile(
    r"\s*[+\u2212-]?(?P<whole>\d*)"
    r"(?P<groups>(?:(?P<group>[.,'’\u00a0\u202f ])\d{3}(?:(?P=group)\d{3})*)?)"
    r"(?:(?P<decimal>[.,])\d*)?(?P<exponent>[eEdD][+\u2212-]?\d+)?\s*"
)
_OPEN = re.compile(r"\s*[+\u2212-]?[1-9]\d{0,2}\.\d{3}\s*")
_PLAIN = {
    ",": str.maketrans(",", ".", f".{_SEPARATORS}"),
    ".": str.maketrans("", "", f",{_SEPARATORS}"),
}
"""By decimal mark: translation of the text of a number to Python's notation."""


class _Number(NamedTuple):
    """The notation of a number that contains a decimal mark or a separator.

    Attributes
    ----------
    row : int
    text : str
    decimal, group : str
        Decimal mark and separator of thousands; empty where there is none.
    is_ambiguous : bool
        True if its one mark, before three digits, may be either of the two: ``1,234``.
    """

    row: int
    text: str
    decimal: str
    group: str
    is_ambiguous: bool


def normalise_decimals(table: Table, comma_divides: bool, stated: str = "") -> None:
    """Rewrite numbers with decimal points and without separators of thousands, in place.

    Parameters
    ----------
    table : Table
        With text cells; the change is added to its repairs.
    comma_divides : bool
        True if commas separate the columns, so that points in numbers are decimal.
    stated : {"", "comma", "point"}
        The decimal mark, if the user states it.

    Raises
    ------
    UserError
        If a file has both decimal commas and points, or a number is ambiguous.
    """
    if not any(map(_may_have_separators, table.columns)) and (
        comma_divides or not _may_have_thousands_only(table)
    ):
        return
    notations = [(column, _parse_column(table, column)) for column in table.columns]
    marked = [number for _, numbers in notations for number in numbers if number is not None]
    if not marked:
        return
    decimal = _decimal_mark(table, marked, comma_divides, stated)
    for column, numbers in notations:
        if not stated:
            _check_groups(table, column, numbers, decimal)
        column.cells = [
            cell if number is None else cell.translate(_PLAIN[decimal])
            for cell, number in zip(column.cells, numbers, strict=True)
        ]
    _report_rewriting(table, marked, decimal)


def has_decimal_points(
    cells: Iterable[str], others: bytes | memoryview, comma_divides: bool, stated: str
) -> bool:
    """Return whether points are decimal in a table of plain numbers, by some of its cells.

    Parameters
    ----------
    cells : iterable of str
    others : bytes or memoryview
        The other rows.
    comma_divides, stated
        See :func:`normalise_decimals`, which finds it where no cell tells.
    """
    if comma_divides or stated:
        return stated != "comma"
    pointed = [cell for cell in cells if "." in cell]
    return not all(map(_OPEN.fullmatch, pointed)) if pointed else b"." not in bytes(others)


def _may_have_separators(column: Column) -> bool:
    """Return whether a column has a mark other than one decimal point per cell."""
    joined = "\n".join(column.cells)
    separated = any(mark in joined for mark in f",{_SEPARATORS}")
    return separated or any(cell.count(".") > 1 for cell in column.cells)


def _may_have_thousands_only(table: Table) -> bool:
    """Return whether every point of a table is before three digits, as in ``1.230``."""
    texts = (cell for column in table.columns for cell in column.cells if "." in cell)
    first = next(texts, None)
    return first is not None and all(map(_OPEN.fullmatch, chain([first], texts)))


def _parse_column(table: Table, column: Column) -> list[_Number | None]:
    """Return the notation of each cell of a column, see `_parse_number`."""
    return [
        _parse_number(int(row), str(cell))
        for row, cell in zip(table.rows, column.cells, strict=True)
    ]


def _parse_number(row: int, text: str) -> _Number | None:
    """Return decimal mark and separator of a cell; None if it is no number or has neither."""
    match = _NUMBER.fullmatch(text)
    if match is None or not (match["group"] or match["decimal"]):
        return None
    whole = match["whole"]
    group = match["group"]
    decimal = match["decimal"] or ""
    if group is None:
        return _Number(row, text, decimal, "", False)
    may_be_thousands = 1 <= len(whole) <= 3 and decimal != group
    is_only_mark = group in ".," and len(match["groups"]) == 4 and not decimal
    if is_only_mark:
        # nobody writes 0,123 or 1,234e5 for thousands
        if may_be_thousands and whole[0] != "0" and not match["exponent"]:
            return _Number(row, text, "", group, True)
        return _Number(row, text, group, "", False)
    return _Number(row, text, decimal, group, False) if may_be_thousands else None


def _decimal_mark(table: Table, numbers: list[_Number], comma_divides: bool, stated: str) -> str:
    """Return the decimal mark of a file; raise if it has two, or none is certain.

    A separator of thousands is evidence for the other mark.
    """
    certain = [number for number in numbers if not number.is_ambiguous]
    comma = _first_decimal(certain, ",") or _first_separated(certain, ".")
    point = _first_decimal(certain, ".") or _first_separated(certain, ",")
    if comma and point:
        raise _two_marks(table, comma, point)
    against = comma if stated == "point" else point
    if stated and against:
        raise refuse(
            table.path,
            f"row {against.row} has '{against.text.strip()}', and {option('decimal', stated)} is"
            " stated",
        )
    open_number = _first_separated(numbers, ",") or _first_separated(numbers, ".")
    if stated or comma or point or open_number is None:
        return "," if stated == "comma" or comma else "."
    if comma_divides and open_number.group == ".":
        return "."
    raise _open_mark(table, open_number)


def _open_mark(table: Table, number: _Number) -> UserError:
    text = number.text.strip()
    whole = float(text.replace(number.group, ""))
    broken = float(text.replace(number.group, "."))
    marks = ("comma", "point") if number.group == "," else ("point", "comma")
    decimal, grouping = (option("decimal", mark) for mark in marks)
    return refuse(
        table.path,
        f"row {number.row}: is '{text}' {broken:g} or {whole:g}? No number in the file tells; state"
        f" the decimal mark: {decimal} for {broken:g}, {grouping} for {whole:g}",
    )


def _first_decimal(numbers: list[_Number], mark: str) -> _Number | None:
    return next((number for number in numbers if number.decimal == mark), None)


def _first_separated(numbers: list[_Number], separator: str) -> _Number | None:
    return next((number for number in numbers if number.group == separator), None)


def _two_marks(table: Table, comma: _Number, point: _Number) -> UserError:
    return refuse(
        table.path,
        f"row {comma.row} has '{comma.text.strip()}' ({_marks(comma)}) and row {point.row} has"
        f" '{point.text.strip()}' ({_marks(point)}): decimal comma or decimal point? Use one of"
        " them throughout",
    )


def _marks(number: _Number) -> str:
    names = {",": "comma", ".": "point"}
    if number.decimal:
        return f"a decimal {names[number.decimal]}"
    return f"{names[number.group]}s between thousands"


def _check_groups(
    table: Table, column: Column, numbers: list[_Number | None], decimal: str
) -> None:
    """Raise if every cell of a column is like ``1.234`` in a file of decimal commas.

    Its points may be decimal after all: one column may come from another program.
    """
    if decimal != ",":
        return
    grouped = [n for n in numbers if n and n.group == "."]
    if grouped and len(grouped) == len(column.cells) and all(n.is_ambiguous for n in grouped):
        first = grouped[0]
        raise refuse(
            table.path,
            f"row {first.row}, column '{column.name}': '{first.text.strip()}' in a file of decimal"
            " commas: a point between thousands, or of decimals? Write this column without points,"
            " or with decimal commas",
        )


def _report_rewriting(table: Table, numbers: list[_Number], decimal: str) -> None:
    """Add repairs for decimal commas and separators of thousands, with the first of each."""
    comma = next((n for n in numbers if decimal == "," and "," in n.text), None)
    if comma is not None:
        table.note("decimal comma", f"decimal commas read as points (first in row {comma.row})")
    separated = next((n for n in numbers if n.group and n.group != decimal), None)
    if separated is not None:
        table.note(
            "thousands",
            f"separators of thousands left out (first in row {separated.row}:"
            f" '{separated.text.strip()}')",
        )
