"""Array signals of FMI 3.0 tools, which write all elements of an array into one cell."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table


def split_arrays(table: Table, signals: Collection[str]) -> Table:
    """Split a column of arrays into one per element: ``u`` of ``1 2`` into ``u[1]`` and ``u[2]``.

    Parameters
    ----------
    table : Table
    signals : collection of str
        Names of the model's signals; elements of an array in row-major order.

    Returns
    -------
    Table
        With the other columns as they are.

    Raises
    ------
    UserError
        If the number of values in a cell is not the number of elements of the array.
    """
    columns: list[Column] = []
    for column in table.columns:
        names = [name for name in signals if name.startswith(f"{column.name}[")]
        if names and _holds_arrays(column):
            columns += _split_cells(table, column, names)
        else:
            columns.append(column)
    return replace(table, columns=columns)


def _holds_arrays(column: Column) -> bool:
    """Return whether any cell has several values; a scalar ``u [1]`` may just have the unit 1."""
    if isinstance(column.cells, np.ndarray):
        return False
    return any(len(cell.split()) > 1 for cell in column.cells)


def _split_cells(table: Table, column: Column, names: list[str]) -> list[Column]:
    """Return a column for each element; raise if a cell has not one value for each name."""
    rows = [cell.split() for cell in column.cells]
    for number, words in zip(table.rows, rows, strict=True):
        if len(words) != len(names):
            raise refuse(
                table.path,
                f"row {number}, column '{column.name}': {len(words)} values for the"
                f" {len(names)} elements {names[0]} to {names[-1]}",
            )
    return [
        replace(column, name=name, cells=list(cells), title=name)
        for name, cells in zip(names, zip(*rows, strict=True), strict=True)
    ]
