"""Arrays in one column of a table, all elements in a cell, as tools for FMI 3.0 write them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table


def split_arrays(table: Table, signals: Collection[str]) -> Table:
    """Give the elements of arrays columns of their own: ``u[1]`` and ``u[2]`` to ``u`` of ``1 2``.

    Parameters
    ----------
    table : Table
    signals : collection of str
        Names that are known; those of elements in row-major order.

    Returns
    -------
    Table

    Raises
    ------
    UserError
        If a cell has not as many words as the array has elements.
    """
    columns: list[Column] = []
    for column in table.columns:
        names = [name for name in signals if name.startswith(f"{column.name}[")]
        if names and _has_several(column):
            columns += _elements(table, column, names)
        else:
            columns.append(column)
    return replace(table, columns=columns)


def _has_several(column: Column) -> bool:
    """Return whether a cell holds several values; a header ``u[1]`` may have the unit 1."""
    if isinstance(column.cells, np.ndarray):
        return False
    return any(len(cell.split()) > 1 for cell in column.cells)


def _elements(table: Table, column: Column, names: list[str]) -> list[Column]:
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
