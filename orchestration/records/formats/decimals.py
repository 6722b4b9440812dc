"""Normalisation of numbers: decimal commas become points, separators of thousands are removed."""

from __future__ import annotations

import re
from typing import NamedTuple

from fmus.kit import UserError
from orchestration.records.record import Repair, refuse
from orchestration.records.tables import Column, Table

_SEPARATORS = "'’\u00a0\u202f "
_NUMBER = re.compile(
    r"\s*[+-]?(?P<whole>\d*)(?P<groups>(?:(?P<by>[.,'’\u00a0\u202f ])\d{3}(?:(?P=by)\d{3})*)?)"
    r"(?:(?P<mark>[.,])(?P<part>\d*))?(?P<exponent>[eE][+-]?\d+)?\s*"
)
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
    open : bool
        True if its one mark, before three digits, may be either of the two.
    """

    row: int
    text: str
    decimal: str
    group: str
    open: bool


def normalise_decimals(table: Table, comma_divides: bool) -> None:
    """Rewrite numbers with decimal points and without separators of thousands, in place.

    Parameters
    ----------
    table : Table
        With text cells; the change is added to its repairs.
    comma_divides : bool
        True if commas separate the columns, so that a comma in a number is not a decimal comma.

    Raises
    ------
    UserError
        If a file has both decimal commas and points, or a number is ambiguous.
    """
    if not any(map(_may_have_separators, table.columns)):
        return
    notations = [(column, _notations(table, column)) for column in table.columns]
    marked = [number for _, numbers in notations for number in numbers if number is not None]
    if not marked:
        return
    decimal = _decimal_mark(table, marked, comma_divides)
    for column, numbers in notations:
        _check_groups(table, column, numbers, decimal)
        column.cells = [
            cell if number is None else cell.translate(_PLAIN[decimal])
            for cell, number in zip(column.cells, numbers, strict=True)
        ]
    _note(table, marked, decimal)


def _may_have_separators(column: Column) -> bool:
    """Return whether a column has a mark other than one decimal point per cell."""
    joined = "\n".join(column.cells)
    separated = any(mark in joined for mark in f",{_SEPARATORS}")
    return separated or any(cell.count(".") > 1 for cell in column.cells)


def _notations(table: Table, column: Column) -> list[_Number | None]:
    """Return the notation of each cell of a column."""
    return [
        _notation(int(row), str(cell)) for row, cell in zip(table.rows, column.cells, strict=True)
    ]


def _notation(row: int, text: str) -> _Number | None:
    """Return the notation of a cell; None if it is no number, or a number without any mark."""
    match = _NUMBER.fullmatch(text)
    if match is None or not (match["by"] or match["mark"]):
        return None
    whole = match["whole"]
    by = match["by"]
    mark = match["mark"] or ""
    if by is None:
        return _Number(row, text, mark, "", False)
    may_be_group = 1 <= len(whole) <= 3 and mark != by
    if by in ".," and len(match["groups"]) == 4 and not mark:
        if may_be_group and whole[0] != "0" and not match["exponent"]:
            return _Number(row, text, "", by, True)
        return _Number(row, text, by, "", False)
    return _Number(row, text, mark, by, False) if may_be_group else None


def _decimal_mark(table: Table, numbers: list[_Number], comma_divides: bool) -> str:
    """Return the decimal mark of a file; raise if it has two."""
    certain = [number for number in numbers if not number.open]
    comma = _first_decimal(certain, ",") or _first_separated(certain, ".")
    point = _first_decimal(certain, ".") or _first_separated(certain, ",")
    if comma is None and point is None:  # then a mark before three digits is a decimal mark
        comma = _first_separated(numbers, ",")
        point = _first_separated(numbers, ".")
        if comma_divides:
            point = point or comma
            comma = None
    if comma and point:
        raise _two_marks(table, comma, point)
    return "," if comma else "."


def _first_decimal(numbers: list[_Number], mark: str) -> _Number | None:
    return next((number for number in numbers if number.decimal == mark), None)


def _first_separated(numbers: list[_Number], separator: str) -> _Number | None:
    return next((number for number in numbers if number.group == separator), None)


def _two_marks(table: Table, comma: _Number, point: _Number) -> UserError:
    return refuse(
        table.path,
        f"row {comma.row} has '{comma.text.strip()}' and row {point.row} has"
        f" '{point.text.strip()}': decimal comma or decimal point? Use one of them throughout",
    )


def _check_groups(
    table: Table, column: Column, numbers: list[_Number | None], decimal: str
) -> None:
    """Raise if all numbers of a column have a point before three digits, which may be decimal."""
    if decimal != ",":
        return
    grouped = [n for n in numbers if n and n.group == "."]
    if grouped and len(grouped) == len(column.cells) and all(n.open for n in grouped):
        first = grouped[0]
        raise refuse(
            table.path,
            f"row {first.row}, column '{column.name}': '{first.text.strip()}' in a file of decimal"
            " commas: a point between thousands, or of decimals? Write this column without points,"
            " or with decimal commas",
        )


def _note(table: Table, numbers: list[_Number], decimal: str) -> None:
    """Add repairs for decimal commas and separators of thousands."""
    comma = next((n for n in numbers if decimal == "," and "," in n.text), None)
    if comma is not None:
        table.repairs.append(
            Repair("decimal comma", f"decimal commas read as points (first in row {comma.row})")
        )
    separated = next((n for n in numbers if n.group and n.group != decimal), None)
    if separated is not None:
        table.repairs.append(
            Repair(
                "thousands",
                f"separators of thousands left out (first in row {separated.row}:"
                f" '{separated.text.strip()}')",
            )
        )
