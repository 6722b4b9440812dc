"""Decimal commas: turned into points where used throughout, refused where mixed with points."""

import re

from orchestration.records.record import Repair, refuse
from orchestration.records.table import Table, parse_cell

_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*|\s*[+-]?\d+,\s*")


def replace_decimal_commas(table: Table) -> None:
    """Turn decimal commas into points, in place, where a file uses them throughout.

    Parameters
    ----------
    table : Table
        A table whose delimiter is not the comma.

    Raises
    ------
    UserError
        If one file has both numbers with a comma and numbers with a point: the comma may then group
        thousands.
    """
    comma_at: tuple[int, str] | None = None
    point_at: tuple[int, str] | None = None
    changed = []
    for column in table.columns:
        joined = ";".join(column.cells)
        if point_at is None and "." in joined:
            point_at = next(
                (
                    (int(row), cell)
                    for row, cell in zip(table.rows, column.cells, strict=True)
                    if "." in cell and parse_cell(cell) is not None and "#" not in cell
                ),
                None,
            )
        if "," not in joined:
            continue
        hits = [
            (int(row), cell)
            for row, cell in zip(table.rows, column.cells, strict=True)
            if _DECIMAL_COMMA.fullmatch(cell)
        ]
        if hits:
            comma_at = comma_at or hits[0]
            changed.append(column)
    if comma_at is None:
        return
    if point_at is not None:
        raise refuse(
            table.path,
            f"row {comma_at[0]} has '{comma_at[1].strip()}' and row {point_at[0]} has"
            f" '{point_at[1].strip()}': decimal comma or decimal point? Use one of them throughout",
        )
    for column in changed:
        column.cells = [
            cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell
            for cell in column.cells
        ]
    table.repairs.append(
        Repair("decimal comma", f"decimal commas read as points (first in row {comma_at[0]})")
    )
