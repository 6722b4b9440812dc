"""Dates and times of day as seconds since the first row."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.record import Repair, list_rows, refuse
from orchestration.records.tables import MISSING_CELLS, Column, Table
from orchestration.reporting import option

DAY_FIRST = "dd/mm/yyyy"
MONTH_FIRST = "mm/dd/yyyy"
MINUTES = "mm:ss"
FORMS = (DAY_FIRST, MONTH_FIRST, MINUTES)
"""Forms that ``--map 'COLUMN=time[FORM]'`` states where the cells leave it open."""

_DAY = 86400.0
_HOUR = 3600.0
_OVER_MIDNIGHT = 2.0
"""Longest steps elsewhere that the one over midnight may take; a longer one is a clock set back."""
_MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_MONTHS_ELSEWHERE = {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
_DATE = re.compile(
    r"(?P<year>\d{4})(?P<by>[-./])(?P<month>\d{1,2})(?P=by)(?P<day>\d{1,2})"
    r"|(?P<one>\d{1,2})(?P<mark>[-./])(?P<two>\d{1,2})(?P=mark)(?P<last>\d{4}|\d{2})"
    r"|(?P<nth>\d{1,2})[-.\s]+(?P<name>[^\W\d_]{3,9})\.?[-,\s]+(?P<in>\d{4}|\d{2})"
    r"|(?P<called>[^\W\d_]{3,9})\.?\s+(?P<on>\d{1,2}),?\s+(?P<of>\d{4})"
)
_CLOCK = re.compile(
    r"(?:(?P<days>\d{1,5})(?:\s?d(?:ays?)?,?\s+|[-.\s]))?"
    r"(?P<h>\d{1,6}):(?P<m>[0-5]\d)(?::(?P<s>[0-5]\d))?(?:[.,:](?P<fraction>\d+))?"
    r"(?:\s?(?P<half>[AaPp])\.?[Mm]\.?)?"
    r"(?:\s?(?:[Zz]|UTC|GMT|(?P<sign>[+-])(?P<zone_h>\d{2}):?(?P<zone_m>\d{2})?))?"
)


class _Cell(NamedTuple):
    """A date as it is written, and the time of day; either may be absent."""

    day: re.Match[str] | None
    clock: re.Match[str] | None


def is_instant(cell: str) -> bool:
    """Return whether a cell is a date, a time of day, or both."""
    return _split(cell) is not None


def is_date(cell: str) -> bool:
    """Return whether a cell is a date without a time of day."""
    found = _split(cell)
    return found is not None and found.clock is None


def is_time_of_day(cell: str) -> bool:
    """Return whether a cell is a time of day, or a duration, without a date."""
    found = _split(cell)
    return found is not None and found.day is None


def _split(cell: str) -> _Cell | None:
    text = cell.strip()
    if not text[:1].isalnum():
        return None
    day = _DATE.match(text)
    if day is not None and day.end() == len(text):
        return _Cell(day, None)
    rest = text[day.end() :].lstrip(" ,Tt") if day else text
    clock = _CLOCK.fullmatch(rest)
    return None if clock is None else _Cell(day, clock)


def holds_instants(column: Column) -> bool:
    """Return whether the first cell of a column that is not empty is a date or a time of day."""
    return is_instant(first_text(column))


def first_text(column: Column) -> str:
    """Return the first cell of a column that is not empty; empty if it has numbers or nothing."""
    if isinstance(column.cells, np.ndarray):
        return ""
    return next((c for c in column.cells if c.strip().lower() not in MISSING_CELLS), "")


def seconds(table: Table, column: Column, form: str = "") -> Array:
    """Read dates and times of day as seconds since the first row.

    Parameters
    ----------
    table : Table
        Takes a line that says how they were read.
    column : Column
        Text cells.
    form : str
        One of `FORMS`, where the user states it.

    Returns
    -------
    ndarray, shape (n,)
        Seconds; NaN where a cell is empty.

    Raises
    ------
    UserError
        If a cell is of another kind than the first, no calendar has its day, or day and month
        cannot be told apart and it matters.
    """
    cells = _parsed(table, column)
    present = {k: cell for k, cell in enumerate(cells) if cell is not None}
    first, cell = next(iter(present.items()))
    instants = np.full(len(cells), np.nan)
    instants[list(present)] = [_seconds(each, form) for each in present.values()]
    if cell.day is not None:
        read_as, days = _days(table, column, cells, form)
        instants += _DAY * days
    else:
        has_minutes_first = _has_minutes_first(cell, form)
        read_as = MINUTES if has_minutes_first else _hours_form(column, cell)
        _roll_over(table, column, instants, _HOUR if has_minutes_first else _DAY)
    text = str(column.cells[first]).strip()
    table.repairs.append(
        Repair("date", f"column '{column.name}' is read as {read_as}: '{text}' is 0 s")
    )
    return instants - instants[first]


def _hours_form(column: Column, cell: _Cell) -> str:
    """Return how a time of day is read; without seconds also what it might be instead."""
    if cell.clock is not None and cell.clock["s"] is None:
        return f"hh:mm (if it is mm:ss: {_as_time(column, MINUTES)})"
    return "hh:mm:ss"


def _as_time(column: Column, form: str) -> str:
    """Return the option that reads a column as times of a form."""
    return option("mapping", {column.name: f"time[{form}]"})


def _parsed(table: Table, column: Column) -> list[_Cell | None]:
    """Split every cell; all must be of the kind of the first."""
    cells: list[_Cell | None] = []
    first: _Cell | None = None
    for row, text in zip(table.rows, column.cells, strict=True):
        bare = str(text).strip()
        if bare.lower() in MISSING_CELLS:
            cells.append(None)
            continue
        cell = _split(bare)
        first = first or cell
        if cell is None or first is None or _kind(cell) != _kind(first):
            raise refuse(
                table.path,
                f"row {row}, column '{column.name}': '{bare}' is not a date or time as above it,"
                f" '{first_text(column).strip()}'",
            )
        cells.append(cell)
    return cells


def _kind(cell: _Cell) -> tuple[bool, bool]:
    return cell.day is not None, cell.clock is not None


def _has_minutes_first(cell: _Cell, form: str) -> bool:
    """Return whether a time without a third number is minutes and seconds, not hours."""
    clock = cell.clock
    assert clock is not None
    return clock["s"] is None and (form == MINUTES or clock["fraction"] is not None)


def _seconds(cell: _Cell, form: str) -> float:
    """Return the time of day in s; in UTC where a zone is stated."""
    clock = cell.clock
    if clock is None:
        return 0.0
    hours = int(clock["h"])
    minutes = int(clock["m"])
    seconds = float(f"{clock['s'] or 0}.{clock['fraction'] or 0}")
    if _has_minutes_first(cell, form):
        hours, minutes, seconds = 0, hours, minutes + seconds
    if clock["half"]:
        hours = hours % 12 + (12 if clock["half"] in "Pp" else 0)
    zone = int(clock["zone_h"] or 0) * _HOUR + int(clock["zone_m"] or 0) * 60.0
    if clock["sign"] == "-":
        zone = -zone
    return int(clock["days"] or 0) * _DAY + hours * _HOUR + minutes * 60.0 + seconds - zone


def _days(
    table: Table, column: Column, cells: Sequence[_Cell | None], form: str
) -> tuple[str, Array]:
    """Return how the dates of a column are read, and the day of each."""
    texts = [cell.day[0] if cell and cell.day else "" for cell in cells]
    dates = {cell.day[0]: cell.day for cell in cells if cell and cell.day}
    order = _order(table, column, texts, dates, form)
    numbers = {"": np.nan}
    for text, found in dates.items():
        try:
            numbers[text] = float(date(*_year_month_day(found, order)).toordinal())
        except ValueError:
            at = texts.index(text)
            cell = str(column.cells[at]).strip()
            raise refuse(
                table.path,
                f"row {table.rows[at]}, column '{column.name}': '{cell}' is no date of the"
                f" calendar (read as {order})",
            ) from None
    return order, np.array([numbers[text] for text in texts])


def _order(
    table: Table,
    column: Column,
    texts: Sequence[str],
    dates: dict[str, re.Match[str]],
    form: str,
) -> str:
    """Return in which order days, months and years are written."""
    first = next(iter(dates.values()))
    if first["one"] is None:
        return "yyyy-mm-dd" if first["year"] else "dates with the month's name"
    if first["mark"] == ".":
        return "dd.mm.yyyy"
    if form in (DAY_FIRST, MONTH_FIRST):
        return form
    day_first = _first_above_12(dates, "one")
    month_first = _first_above_12(dates, "two")
    if day_first and month_first:
        raise refuse(
            table.path,
            f"column '{column.name}': '{day_first}' (row {table.rows[texts.index(day_first)]}) and"
            f" '{month_first}' (row {table.rows[texts.index(month_first)]}) are not dates of one"
            " form",
        )
    if day_first or month_first:
        return DAY_FIRST if day_first else MONTH_FIRST
    undecided = [found for found in dates.values() if found["one"] != found["two"]]
    if len(dates) == 1:
        return "one day throughout"
    if not undecided:
        return DAY_FIRST
    other = undecided[0]
    choices = " or ".join(_as_time(column, f) for f in (DAY_FIRST, MONTH_FIRST))
    raise refuse(
        table.path,
        f"row {table.rows[texts.index(other[0])]}, column '{column.name}': is '{other[0]}' in"
        f" {_month(other['two'])} or in {_month(other['one'])}? No date in the file tells; say"
        f" which: {choices}",
    )


def _first_above_12(dates: dict[str, re.Match[str]], group: str) -> str:
    return next((text for text, found in dates.items() if int(found[group] or 0) > 12), "")


def _month(number: str) -> str:
    return date(2000, int(number), 1).strftime("%B") if 1 <= int(number) <= 12 else "no month"


def _year_month_day(found: re.Match[str], order: str) -> tuple[int, int, int]:
    if found["year"]:
        return int(found["year"]), int(found["month"]), int(found["day"])
    if found["name"]:
        return _full_year(found["in"]), _month_number(found["name"]), int(found["nth"])
    if found["called"]:
        return int(found["of"]), _month_number(found["called"]), int(found["on"])
    one = int(found["one"])
    two = int(found["two"])
    day, month = (two, one) if order == MONTH_FIRST else (one, two)
    return _full_year(found["last"]), month, day


def _full_year(text: str) -> int:
    """Return a year; of two digits one from 1970 to 2069, as POSIX reads it."""
    year = int(text)
    if len(text) == 4:
        return year
    return 1900 + year if year >= 70 else 2000 + year


def _month_number(name: str) -> int:
    """Return the number of a month by its English or German name; 0, which is none, for others."""
    start = name[:3].casefold()
    if start in _MONTHS:
        return _MONTHS.index(start) + 1
    return _MONTHS_ELSEWHERE.get(start, 0)


def _roll_over(table: Table, column: Column, seconds: Array, period: float) -> None:
    """Let a time of day go on after midnight, in place, and note it."""
    at = np.flatnonzero(np.isfinite(seconds))
    clock = seconds[at]
    steps = np.diff(clock)
    if not (steps < 0.0).any() or clock.max() >= period:
        return
    longest = _OVER_MIDNIGHT * float(steps.max())
    midnights = np.flatnonzero((steps < 0.0) & (steps + period <= longest))
    for k in midnights:
        seconds[at[k + 1] :] += period
    if midnights.size:
        rows = [int(table.rows[at[k + 1]]) for k in midnights]
        word = "midnight" if period == _DAY else "the hour"
        table.repairs.append(
            Repair(
                "midnight",
                f"column '{column.name}' passes {word} before {list_rows(rows)}: its time goes on",
                tuple(rows),
            )
        )


def joined(table: Table, one: Column, other: Column) -> Column:
    """Return dates and times of day of two columns in one; the table takes a line."""
    days, clock = (one, other) if is_date(first_text(one)) else (other, one)
    cells = [
        f"{day} {time}" if day.strip() and time.strip() else ""
        for day, time in zip(map(str, days.cells), map(str, clock.cells), strict=True)
    ]
    table.repairs.append(
        Repair("date", f"columns '{days.name}' and '{clock.name}' are one date and time")
    )
    return Column(days.name, None, cells)
