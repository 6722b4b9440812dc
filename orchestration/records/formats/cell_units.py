"""Cells that state their unit: ``12.5 mA``."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fmus.kit import units
from fmus.kit.arrays import Array
from orchestration.records.record import refuse
from orchestration.records.tables import (
    MISSING_CELLS,
    Column,
    Table,
    is_no_value,
    is_unit,
    plain_unit,
)

_WITH_UNIT = re.compile(
    r"\s*(?P<number>[+\u2212-]?\d[\d.,'’]*(?:[eEdD][+-]?\d+)?)\s*(?P<unit>[^\d\s.,].*?)\s*"
)


def strip_units(table: Table) -> None:
    """Take the unit out of the cells of a column, and give it to the column, in place.

    Cells in other units of the same quantity, as of a meter that changes its range, are converted
    to the first one.

    Raises
    ------
    UserError
        If a cell is in a unit of another quantity.
    """
    for column in table.columns:
        first = next((c for c in column.cells if c.strip().lower() not in MISSING_CELLS), "")
        match = _WITH_UNIT.fullmatch(first)
        if match is not None and is_unit(match["unit"]):
            column.unit = plain_unit(match["unit"])
            column.cells = _bare(table, column, column.cells)


def _bare(table: Table, column: Column, cells: Sequence[str] | Array) -> list[str]:
    """Return cells without their units, all in the unit of the column."""
    bare = []
    for row, cell in zip(table.rows, map(str, cells), strict=True):
        match = _WITH_UNIT.fullmatch(cell)
        unit = plain_unit(match["unit"]) if match and is_unit(match["unit"]) else None
        if match is None or unit is None:
            if parse := cell.strip():
                _require_no_value(table, column, row, parse)
            bare.append(cell)
        elif unit == column.unit:
            bare.append(match["number"])
        else:
            bare.append(_converted(table, column, row, match["number"], unit))
    return bare


def _require_no_value(table: Table, column: Column, row: int, cell: str) -> None:
    if not is_no_value(cell):
        raise refuse(
            table.path,
            f"row {row}, column '{column.name}': '{cell}' states no unit, the cells above it are in"
            f" {column.unit}",
        )


def _converted(table: Table, column: Column, row: int, number: str, unit: str) -> str:
    """Return a number in the unit of the column."""
    assert column.unit is not None
    try:
        factor = units.convert(1.0, unit, column.unit)
        return repr(float(number.replace(",", ".")) * factor)
    except ValueError as error:
        raise refuse(table.path, f"row {row}, column '{column.name}': {error}") from error
