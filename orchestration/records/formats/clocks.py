"""Channels with clocks of their own, put on one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table

_SAME = 1e-6
"""Share of the shortest step within which two instants are one."""


def insert_clock(table: Table, step: float, source: str, start: float | None = None) -> None:
    """Insert a time that counts the rows of a table as its first column, and note its source.

    Raises
    ------
    UserError
        If the step, in s, is not above 0.
    """
    if not step > 0.0:
        reason = f"{source}: the increment of time is {step:g} s (allowed: above 0)"
        raise refuse(table.path, reason)
    origin = "" if start is None else f"{start:g} s + "
    time = (start or 0.0) + step * np.arange(table.rows.size, dtype=np.float64)
    table.columns.insert(0, Column("time", "s", time))
    table.note("clock from header", f"time is {origin}k × {step:g} s, from {source}")


def on_one_clock(columns: Sequence[Column], times: Sequence[Array]) -> list[Column]:
    """Return a column of time, and columns with a value or NaN at every instant of any.

    Parameters
    ----------
    columns : sequence of Column
        Numbers; column k has shape (n_k,).
    times : sequence of ndarray, shape (n_k,)
        Seconds, increasing.

    Returns
    -------
    list of Column
        The time first, in s.
    """
    shortest = min((float(np.diff(t).min()) for t in times if t.size > 1), default=1.0)
    tick = _SAME * shortest if shortest > 0.0 else 1.0
    ticks = [np.round(time / tick) for time in times]
    instants, first = np.unique(np.concatenate(ticks), return_index=True)
    time = np.concatenate(times)[first]
    result = [Column("time", "s", time)]
    for column, own in zip(columns, ticks, strict=True):
        cells = np.full(time.size, np.nan)
        cells[np.searchsorted(instants, own)] = column.cells
        result.append(Column(column.name, column.unit, cells, column.title))
    return result
