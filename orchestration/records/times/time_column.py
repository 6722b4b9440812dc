"""The column that is the time: by its name, its unit, or because it holds dates."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from fmus.kit import UserError
from fmus.kit.units import measure_alike
from orchestration.records.record import Repair, refuse
from orchestration.records.tables import Column, Table, numbers
from orchestration.records.times.instants import (
    first_text,
    holds_instants,
    is_date,
    is_time_of_day,
    joined,
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
_RISING = 0.4  # share of steps in which a clock rises; dates may be to the second, rows to the half


def find_time(table: Table, signals: Container[str], free: Sequence[Column]) -> Column:
    """Find the time among the columns that are nothing else.

    Names count more than units, and these more than dates. But of several columns the one that
    falls least is taken, and it is noted: testers write the time of each step beside that of all.

    Parameters
    ----------
    table : Table
        The file's columns; takes a line where there was a choice.
    signals : container of str
        The model's signals, which are not the time.
    free : sequence of Column
        The columns that may be the time.

    Returns
    -------
    Column

    Raises
    ------
    UserError
        If there is none, or several are called time.
    """
    able = [column for column in free if column.name not in signals]
    called = [column for column in able if column.name.casefold() == TIME]
    if len(called) > 1:
        raise refuse(
            table.path,
            f"{len(called)} columns are called time; keep one, or"
            f" {option('mapping', {'column': 'time'})}",
        )
    timed = [column for column in able if column.unit and _is_in_time(column)]
    named = [c for c in able if _plain_name(c) in _NAMES and (c.unit is None or c in timed)]
    dated = [column for column in able if holds_instants(column)]
    candidates = list({id(c): c for c in (*called, *named, *timed, *dated)}.values())
    likely = [*called, *named, *(c for c in candidates if c is table.columns[0]), *dated]
    if len(candidates) == 1 and likely:
        return candidates[0]
    falls = {id(column): _falls(table, column) for column in candidates}
    able_to_run = [c for c in candidates if falls[id(c)] == 0.0 or any(c is d for d in likely)]
    if not able_to_run:
        raise refuse(table.path, _no_time(table, able))
    found = min(able_to_run, key=lambda column: falls[id(column)])
    others = [c for c in candidates if c is not found and not _are_halves(c, found)]
    if others:
        listed = ", ".join(f"'{column.name}'" for column in others)
        table.repairs.append(
            Repair(
                "time column",
                f"time is column '{found.name}', not {listed}; to take another, as of these the"
                f" first: {option('mapping', {table.map_name(others[0]): 'time'})}",
            )
        )
    return found


def _plain_name(column: Column) -> str:
    return "".join(c for c in column.name.casefold() if c.isalnum())


def _is_in_time(column: Column) -> bool:
    try:
        return column.unit is not None and measure_alike(column.unit, "s")
    except UserError:
        return False


def _falls(table: Table, column: Column) -> float:
    """Count how often a column falls; infinite if it does not rise often enough to be a clock."""
    scratch = Table(table.path, table.columns, table.rows)
    other = other_half(column, table.columns)
    whole = column if other is None else joined(scratch, column, other)
    try:
        values = seconds(scratch, whole) if holds_instants(whole) else numbers(scratch, whole)
    except UserError:
        return float("inf")
    steps = np.diff(values[np.isfinite(values)])
    if not steps.size or (steps > 0.0).mean() < _RISING:
        return float("inf")
    return float((steps < 0.0).sum())


def _are_halves(one: Column, other: Column) -> bool:
    """Return whether two columns are the date and the time of day of one instant."""
    first, second = first_text(one), first_text(other)
    return (is_date(first) and is_time_of_day(second)) or (
        is_date(second) and is_time_of_day(first)
    )


def other_half(column: Column, others: Sequence[Column]) -> Column | None:
    """Return the column that has the time of day of a column of dates, or the dates of one."""
    return next((c for c in others if c is not column and _are_halves(c, column)), None)


def _no_time(table: Table, able: Sequence[Column]) -> str:
    """Say that there is no time, and which column may be it."""
    first = table.columns[0]
    rising = next((column for column in able if _falls(table, column) == 0.0), None)
    advice = (
        f"to say which it is: {option('mapping', {table.map_name(rising): 'time[s]'})}"
        if rising
        else "add a column of time, in seconds or as dates"
    )
    return (
        f"no time column: the first column is '{first.name}' [{first.unit or 'no unit'}], and none"
        f" is called time; {advice}"
    )
