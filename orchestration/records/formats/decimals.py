"""Normalisation of numbers: decimal commas become points, separators of thousands are removed."""

from __future__ import annotations

import re
from typing import NamedTuple

from fmus.kit import UserError
from orchestration.records.record import Repair, refuse
from orchestration.records.tables import Column, Table

_SEPARATORS = "'’\u00a0\u202f "
_NUMBER = re.compile(
    r"\s*[+-]?(?P<whole>\d*)"
    r"(?P<groups>(?:(?P<group>[.,'’\u00a0\u202f ])\d{3}(?:(?P=group)\d{3})*)?)"
    r"(?:(?P<decimal>[.,])\d*)?(?P<exponent>[eE][+-]?\d+)?\s*"
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
    is_ambiguous : bool
        True if its one mark, before three digits, may be either of the two: ``1,234``.
    """

    row: int
    text: str
    decimal: str
    group: str
    is_ambiguous: bool


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
    notations = [(column, _parse_column(table, column)) for column in table.columns]
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
    _report_rewriting(table, marked, decimal)


def _may_have_separators(column: Column) -> bool:
    """Return whether a column has a mark other than one decimal point per cell."""
    joined = "\n".join(column.cells)
    separated = any(mark in joined for mark in f",{_SEPARATORS}")
    return separated or any(cell.count(".") > 1 for cell in column.cells)


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


def _decimal_mark(table: Table, numbers: list[_Number], comma_divides: bool) -> str:
    """Return the decimal mark of a file; raise if it has two.

    A separator of thousands is evidence for the other mark. Ambiguous numbers decide only if there
    are no others.
    """
    certain = [number for number in numbers if not number.is_ambiguous]
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
