"""Decimal marks and separators of thousands: which a file uses, and numbers with points alone."""

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
"""Translation of a number, by its decimal mark, to what Python reads."""


class _Number(NamedTuple):
    """A number with a mark in it, as it is written.

    Attributes
    ----------
    row : int
    text : str
    decimal, group : str
        Mark of decimals and separator of thousands; empty where there is none.
    open : bool
        One mark stands before three digits, which may be either.
    """

    row: int
    text: str
    decimal: str
    group: str
    open: bool


def settle_decimals(table: Table, comma_divides: bool) -> None:
    """Write numbers with decimal points and without separators of thousands, in place.

    Parameters
    ----------
    table : Table
        With text cells; takes a line for what was read otherwise than it is written.
    comma_divides : bool
        True if commas are between the columns, so that one in a number is no decimal comma.

    Raises
    ------
    UserError
        If a file has both decimal commas and points, or a number may mean two things.
    """
    if not any(map(_may_have_separators, table.columns)):
        return
    marked = [(column, _marked(table, column)) for column in table.columns]
    found = [number for _, numbers in marked for number in numbers if number is not None]
    if not found:
        return
    decimal = _decimal_mark(table, found, comma_divides)
    for column, numbers in marked:
        _check_groups(table, column, numbers, decimal)
        column.cells = [
            cell if number is None else cell.translate(_PLAIN[decimal])
            for cell, number in zip(column.cells, numbers, strict=True)
        ]
    _note(table, found, decimal)


def _may_have_separators(column: Column) -> bool:
    """Return whether a column has a mark that is no lone decimal point."""
    joined = "\n".join(column.cells)
    separated = any(mark in joined for mark in f",{_SEPARATORS}")
    return separated or any(cell.count(".") > 1 for cell in column.cells)


def _marked(table: Table, column: Column) -> list[_Number | None]:
    """Return how each cell of a column is written; None for what is no number, or has no mark."""
    return [
        _as_written(int(row), str(cell)) for row, cell in zip(table.rows, column.cells, strict=True)
    ]


def _as_written(row: int, text: str) -> _Number | None:
    found = _NUMBER.fullmatch(text)
    if found is None or not (found["by"] or found["mark"]):
        return None
    whole = found["whole"]
    by = found["by"]
    mark = found["mark"] or ""
    if by is None:
        return _Number(row, text, mark, "", False)
    may_be_group = 1 <= len(whole) <= 3 and mark != by
    if by in ".," and len(found["groups"]) == 4 and not mark:
        if may_be_group and whole[0] != "0" and not found["exponent"]:
            return _Number(row, text, "", by, True)
        return _Number(row, text, by, "", False)
    return _Number(row, text, mark, by, False) if may_be_group else None


def _decimal_mark(table: Table, found: list[_Number], comma_divides: bool) -> str:
    """Return the decimal mark of a file; refuse a file with two."""
    comma = _first(found, decimal=",") or _first(found, group=".", certain=True)
    point = _first(found, decimal=".") or _first(found, group=",", certain=True)
    if comma is None and point is None:  # one mark before three digits is all there is
        comma = None if comma_divides else _first(found, group=",")
        point = _first(found, group=".") or (_first(found, group=",") if comma_divides else None)
    if comma and point:
        raise _two_marks(table, comma, point)
    return "," if comma else "."


def _first(
    found: list[_Number], decimal: str = "", group: str = "", certain: bool = False
) -> _Number | None:
    """Return the first number that is written with a decimal mark, or a separator."""
    return next(
        (
            n
            for n in found
            if (decimal and n.decimal == decimal)
            or (group and n.group == group and not (certain and n.open))
        ),
        None,
    )


def _two_marks(table: Table, comma: _Number, point: _Number) -> UserError:
    return refuse(
        table.path,
        f"row {comma.row} has '{comma.text.strip()}' and row {point.row} has"
        f" '{point.text.strip()}': decimal comma or decimal point? Use one of them throughout",
    )


def _check_groups(
    table: Table, column: Column, numbers: list[_Number | None], decimal: str
) -> None:
    """Refuse a column in which a point before three digits may be of decimals after all."""
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


def _note(table: Table, found: list[_Number], decimal: str) -> None:
    """Note what was read otherwise than it is written."""
    comma = next((n for n in found if decimal == "," and "," in n.text), None)
    if comma is not None:
        table.repairs.append(
            Repair("decimal comma", f"decimal commas read as points (first in row {comma.row})")
        )
    separated = next((n for n in found if n.group and n.group != decimal), None)
    if separated is not None:
        table.repairs.append(
            Repair(
                "thousands",
                f"separators of thousands left out (first in row {separated.row}:"
                f" '{separated.text.strip()}')",
            )
        )
