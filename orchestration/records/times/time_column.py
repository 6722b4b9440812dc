"""The time column of a file, found by its name, its unit, or because it has dates."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.units import measure_alike
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table, numbers
from orchestration.records.times.instants import (
    first_text,
    holds_instants,
    is_date,
    is_time_of_day,
    merge_date_and_time,
    seconds,
)
from orchestration.reporting import option

TIME = "time"
_NAMES = frozenset(
    {
        "time",
        "t",
        "xvalue",
        "zeit",
        "testtime",
        "totaltime",
        "elapsedtime",
        "timestamp",
        "zeitstempel",
        "uhrzeit",
        "messzeit",
        "seconds",
        "sekunden",
    }
)
_RISING = 0.4  # least share of steps that rise; rows may be half as far apart as dates resolve


def find_time(table: Table, signals: Container[str], free: Sequence[Column]) -> Column:
    """Return the time column among the columns without a signal.

    Names count more than units, and these more than dates. Of several candidates the one that falls
    least often is taken, because battery testers also write the time of each step, which restarts.

    Parameters
    ----------
    table : Table
        Columns of the file; a choice is added to its repairs.
    signals : container of str
        Signals of the model, which are not the time.
    free : sequence of Column
        Columns that may be the time.

    Returns
    -------
    Column

    Raises
    ------
    UserError
        If there is no time column, or several are called time.
    """
    # an output may be called time, but not the first column
    columns = [c for c in free if c.name not in signals or (c is free[0] and _is_in_time(c))]
    by_name, by_unit, by_date = _candidates(table, columns)
    # by identity, as several columns may have one name
    candidates = {id(column): column for column in (*by_name, *by_unit, *by_date)}
    likely = {id(column) for column in (*by_name, *by_date, table.columns[0])}
    if len(candidates) == 1 and likely & candidates.keys():
        return next(iter(candidates.values()))
    falls = {key: _count_falls(table, column) for key, column in candidates.items()}
    clocks = [key for key in candidates if falls[key] == 0.0 or key in likely]
    if not clocks:
        raise refuse(table.path, _describe_missing_time(table, columns))
    # min() takes the first of equals, so that names count more than units, and these than dates
    time = candidates[min(clocks, key=lambda key: falls[key])]
    others = [c for c in candidates.values() if c is not time and not _are_complementary(c, time)]
    if others:
        listed = ", ".join(f"'{column.name}'" for column in others)
        message = (
            f"time is column '{time.name}', not {listed}; to take another, for example the"
            f" first of these: {option('mapping', {table.map_name(others[0]): 'time'})}"
        )
        table.note("time column", message)
    return time


def _candidates(
    table: Table, columns: Sequence[Column]
) -> tuple[list[Column], list[Column], list[Column]]:
    """Return the columns with the name of a time, those with its unit, and those with dates."""
    exact = [column for column in columns if column.name.casefold() == TIME]
    if len(exact) > 1 and len({column.unit for column in exact}) > 1 and _is_in_time(exact[0]):
        del exact[1:]
    if len(exact) > 1:
        raise refuse(
            table.path,
            f"{len(exact)} columns are called time; keep one, or"
            f" {option('mapping', {'column': 'time'})}",
        )
    by_unit = [column for column in columns if column.unit and _is_in_time(column)]
    usual = [
        column
        for column in columns
        if (column.unit is None and _is_called_time(table, column))
        or (column in by_unit and _plain_name(column) in _NAMES)
    ]
    return [*exact, *usual], by_unit, [column for column in columns if holds_instants(column)]


def _is_called_time(table: Table, column: Column) -> bool:
    """Return whether a column without a unit has the name of a time, not of a temperature T."""
    name = _plain_name(column)
    if name not in _NAMES or len(name) > 1:
        return name in _NAMES
    steps = _steps(table, column)
    return steps is None or _are_of_a_clock(steps)


def _plain_name(column: Column) -> str:
    return "".join(c for c in column.name.casefold() if c.isalnum())


def _is_in_time(column: Column) -> bool:
    try:
        return column.unit is not None and measure_alike(column.unit, "s")
    except UserError:
        return False


def _count_falls(table: Table, column: Column) -> float:
    """Return the number of steps in which a column falls; infinite if it cannot be a clock."""
    steps = _steps(table, column)
    if steps is None or not _are_of_a_clock(steps):
        return float("inf")
    return float((steps < 0.0).sum())


def _steps(table: Table, column: Column) -> Array | None:
    """Return the steps between values of a column; None if it is unreadable."""
    scratch = Table(table.path, table.columns, table.rows)  # collects repairs that nobody reads
    other = complementary_column(column, table.columns)
    merged = column if other is None else merge_date_and_time(scratch, column, other)
    try:
        values = seconds(scratch, merged) if holds_instants(merged) else numbers(scratch, merged)
    except UserError:
        return None
    return np.diff(values[np.isfinite(values)])


def _are_of_a_clock(steps: Array) -> bool:
    """Return whether a share `_RISING` of steps rise at least, and at most half as many fall."""
    rises, falls = (steps > 0.0).sum(), (steps < 0.0).sum()
    return bool(steps.size and rises >= _RISING * steps.size and 2 * falls <= rises)


def _are_complementary(one: Column, other: Column) -> bool:
    """Return whether one column has dates and the other one times of day."""
    first, second = first_text(one), first_text(other)
    return (is_date(first) and is_time_of_day(second)) or (
        is_date(second) and is_time_of_day(first)
    )


def complementary_column(column: Column, others: Sequence[Column]) -> Column | None:
    """Return a column of times of day for one of dates, or the reverse; None if there is none."""
    return next((c for c in others if c is not column and _are_complementary(c, column)), None)


def _describe_missing_time(table: Table, columns: Sequence[Column]) -> str:
    """Return the message that there is no time column, with a column that might be the time."""
    first = table.columns[0]
    rising = next((column for column in columns if _count_falls(table, column) == 0.0), None)
    if len(table.columns) == 1:
        return (
            f"the one column is '{first.name}' [{first.unit or 'no unit'}], and there is no time;"
            " give the rate of the rows, and the name of the column if it is another:"
            f" {option('rate', '100Hz')} {option('mapping', {table.map_name(first): 'current[A]'})}"
        )
    advice = (
        f"to state it: {option('mapping', {table.map_name(rising): 'time[s]'})}"
        if rising
        else "add a column of time, in seconds or as dates, or state the rate of the rows:"
        f" {option('rate', '100Hz')}"
    )
    return (
        f"no time column: the first column is '{first.name}' [{first.unit or 'no unit'}], and none"
        f" is called time; {advice}"
    )
