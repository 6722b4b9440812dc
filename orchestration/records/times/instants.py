"""Dates and times of day as seconds since the first row."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.record import list_rows, refuse
from orchestration.records.tables import MISSING_CELLS, Column, Table
from orchestration.records.times.summer_time import is_zone, local_to_utc
from orchestration.reporting import option

DAY_FIRST = "dd/mm/yyyy"
MONTH_FIRST = "mm/dd/yyyy"
MINUTES = "mm:ss"
FORMS = (DAY_FIRST, MONTH_FIRST, MINUTES)
"""Forms for ``--map 'COLUMN=time[FORM]'`` where the cells are ambiguous."""

_DAY = 86400.0
_HOUR = 3600.0
_OVER_MIDNIGHT = 2.0
"""Largest step over midnight, in longest other steps; a larger one is a clock set back."""
_MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_MONTHS_ELSEWHERE = {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
_DATE = re.compile(
    r"(?P<year>\d{4})(?P<separator>[-./])(?P<month>\d{1,2})(?P=separator)(?P<day>\d{1,2})"
    r"|(?P<first>\d{1,2})(?P<mark>[-./])(?P<second>\d{1,2})(?P=mark)(?P<third>\d{4}|\d{2})"
    r"|(?P<day_ahead>\d{1,2})[-.\s]+(?P<name>[^\W\d_]{3,9})\.?[-,\s]+(?P<year_after>\d{4}|\d{2})"
    r"|(?P<name_ahead>[^\W\d_]{3,9})\.?\s+(?P<day_after>\d{1,2}),?\s+(?P<year_last>\d{4})"
)
_CLOCK = re.compile(
    r"(?:(?P<days>\d{1,5})(?:\s?d(?:ays?)?,?\s+|[-.\s]))?"
    r"(?P<h>\d{1,6}):(?P<m>[0-5]\d)(?::(?P<s>[0-5]\d|60))?(?:[.,:](?P<fraction>\d+))?"
    r"(?:\s?(?P<am_pm>[AaPp])\.?[Mm]\.?)?"
    r"(?P<zone>\s?(?:UTC|GMT)?(?P<sign>[+-])(?P<zone_h>\d{1,2})(?::?(?P<zone_m>\d{2}))?"
    r"|\s?(?:[Zz]|UTC|GMT)|\s(?P<zone_name>[A-Z]{3,4}))?"
)
_ZONES = {
    **{"WET": 0, "WEST": 1, "BST": 1, "CET": 1, "CEST": 2, "MEZ": 1, "MESZ": 2, "EET": 2},
    **{"EEST": 3, "EST": -5, "EDT": -4, "CST": -6, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8},
    **{"PDT": -7, "JST": 9},
}
"""Hours ahead of UTC of zones by their names in files."""


class _Cell(NamedTuple):
    """Matches of the date and the time of day in a cell; one may be missing."""

    day: re.Match[str] | None
    clock: re.Match[str] | None


def is_instant(cell: str) -> bool:
    """Return whether a cell is a date, a time of day, or both."""
    return _match_instant(cell) is not None


def is_date(cell: str) -> bool:
    """Return whether a cell is a date without a time of day."""
    instant = _match_instant(cell)
    return instant is not None and instant.clock is None


def is_time_of_day(cell: str) -> bool:
    """Return whether a cell is a time of day, or a duration, without a date."""
    instant = _match_instant(cell)
    return instant is not None and instant.day is None


def _match_instant(cell: str) -> _Cell | None:
    """Match a cell as a date, a time of day, or both; return None if it is neither."""
    text = cell.strip()
    if not text[:1].isalnum():
        return None
    day = _DATE.match(text)
    if day is not None and day.end() == len(text):
        return _Cell(day, None)
    rest = text[day.end() :].lstrip(" ,Tt") if day else text
    clock = _CLOCK.fullmatch(rest)
    if clock is None or (clock["zone_name"] and clock["zone_name"] not in _ZONES):
        return None
    return _Cell(day, clock)


def holds_instants(column: Column) -> bool:
    """Return whether the first nonempty cell of a column is a date or a time of day."""
    return is_instant(first_text(column))


def first_text(column: Column) -> str:
    """Return the first nonempty text cell of a column; an empty text if there is none."""
    if isinstance(column.cells, np.ndarray):
        return ""
    return next((c for c in column.cells if c.strip().lower() not in MISSING_CELLS), "")


def seconds(table: Table, column: Column, form: str = "") -> Array:
    """Return dates and times of day as seconds since the first row.

    Parameters
    ----------
    table : Table
        The form in which they were read is added to its repairs.
    column : Column
        Text cells.
    form : str
        One of `FORMS`, a time zone such as ``Europe/Berlin``, or both, if the user states it.

    Returns
    -------
    ndarray, shape (n,)
        Seconds; NaN where a cell is empty.

    Raises
    ------
    UserError
        If a cell is of another kind than the first, its date is not in the calendar, day and month
        are ambiguous, or the hour is, at the end of summer time.
    """
    order, zone = _stated(form)
    cells = _parsed(table, column)
    present = {k: cell for k, cell in enumerate(cells) if cell is not None}
    first, cell = next(iter(present.items()))
    instants = np.full(len(cells), np.nan)
    instants[list(present)] = [_seconds(instant, order) for instant in present.values()]
    if cell.day is not None:
        notation, days = _days(table, column, cells, order)
        instants += _DAY * days
        if cell.clock is not None and not cell.clock["zone"]:
            instants = local_to_utc(table, column, instants, zone)
    else:
        has_minutes_first = _has_minutes_first(cell, order)
        notation = MINUTES if has_minutes_first else _hours_form(column, cell)
        _continue_after_midnight(table, column, instants, _HOUR if has_minutes_first else _DAY)
    text = str(column.cells[first]).strip()
    table.note("date", f"column '{column.name}' is read as {notation}: '{text}' is 0 s")
    return instants - instants[first]


def is_form(text: str) -> bool:
    """Return whether a text in the brackets of ``time[...]`` is a form of dates or a time zone."""
    return all(word in FORMS or is_zone(word) for word in text.split())


def _stated(form: str) -> tuple[str, str]:
    """Return the form of dates and the time zone that a user states; empty where there is none."""
    words = form.split()
    order = next((word for word in words if word in FORMS), "")
    return order, next((word for word in words if word not in FORMS), "")


def _hours_form(column: Column, cell: _Cell) -> str:
    """Return the form of a time of day; without seconds also the option for minutes and seconds."""
    if cell.clock is not None and cell.clock["s"] is None:
        return f"hh:mm (if it is mm:ss: {_as_time(column, MINUTES)})"
    return "hh:mm:ss"


def _as_time(column: Column, form: str) -> str:
    """Return the option to read a column as times of a form."""
    return option("mapping", {column.name: f"time[{form}]"})


def _parsed(table: Table, column: Column) -> list[_Cell | None]:
    """Return date and time of day of every cell; raise if one is not of the kind of the first."""
    cells: list[_Cell | None] = []
    first: _Cell | None = None
    for row, text in zip(table.rows, column.cells, strict=True):
        bare = str(text).strip()
        if bare.lower() in MISSING_CELLS:
            cells.append(None)
            continue
        cell = _match_instant(bare)
        first = first or cell
        if cell is None or first is None or _parts(cell) != _parts(first):
            raise refuse(
                table.path,
                f"row {row}, column '{column.name}': '{bare}' is not a date or time as above it,"
                f" '{first_text(column).strip()}'",
            )
        cells.append(cell)
    return cells


def _parts(cell: _Cell) -> tuple[bool, bool, bool]:
    """Return whether a cell has a date, whether a time of day, and whether that states a zone."""
    clock = cell.clock
    return cell.day is not None, clock is not None, clock is not None and bool(clock["zone"])


def _has_minutes_first(cell: _Cell, form: str) -> bool:
    """Return whether a time of two numbers is minutes and seconds, not hours and minutes."""
    clock = cell.clock
    assert clock is not None
    return clock["s"] is None and (form == MINUTES or clock["fraction"] is not None)


def _seconds(cell: _Cell, form: str) -> float:
    """Return the time of day of a cell in s, in UTC if it states a zone."""
    clock = cell.clock
    if clock is None:
        return 0.0
    hours = int(clock["h"])
    minutes = int(clock["m"])
    seconds = float(f"{clock['s'] or 0}.{clock['fraction'] or 0}")
    if _has_minutes_first(cell, form):
        hours, minutes, seconds = 0, hours, minutes + seconds
    if clock["am_pm"]:
        hours = hours % 12 + (12 if clock["am_pm"] in "Pp" else 0)
    zone = int(clock["zone_h"] or 0) * _HOUR + int(clock["zone_m"] or 0) * 60.0
    zone += _ZONES.get(clock["zone_name"], 0) * _HOUR
    if clock["sign"] == "-":
        zone = -zone
    return int(clock["days"] or 0) * _DAY + hours * _HOUR + minutes * 60.0 + seconds - zone


def _days(
    table: Table, column: Column, cells: Sequence[_Cell | None], form: str
) -> tuple[str, Array]:
    """Return the form of the dates of a column, and the ordinal of the day (n,) of each row."""
    texts = [cell.day[0] if cell and cell.day else "" for cell in cells]
    dates = {cell.day[0]: cell.day for cell in cells if cell and cell.day}
    order = _date_order(table, column, texts, dates, form)
    numbers = {"": np.nan}  # of rows without a date
    for text, match in dates.items():
        try:
            numbers[text] = float(date(*_year_month_day(match, order)).toordinal())
        except ValueError:
            k = texts.index(text)
            cell = str(column.cells[k]).strip()
            raise refuse(
                table.path,
                f"row {table.rows[k]}, column '{column.name}': '{cell}' is no date of the"
                f" calendar (read as {order})",
            ) from None
    return order, np.array([numbers[text] for text in texts])


def _date_order(
    table: Table,
    column: Column,
    texts: Sequence[str],
    dates: dict[str, re.Match[str]],
    form: str,
) -> str:
    """Return the order of day, month and year in the dates of a column; raise if it is ambiguous.

    A number above 12 in any row decides between day and month, else the `form` of the user.
    """
    first = next(iter(dates.values()))
    if first["first"] is None:
        return "yyyy-mm-dd" if first["year"] else "dates with the month's name"
    if first["mark"] == ".":
        return "dd.mm.yyyy"
    if form in (DAY_FIRST, MONTH_FIRST):
        return form
    day_first = _first_above_12(dates, "first")
    month_first = _first_above_12(dates, "second")
    if day_first and month_first:
        raise refuse(
            table.path,
            f"column '{column.name}': '{day_first}' (row {table.rows[texts.index(day_first)]}) and"
            f" '{month_first}' (row {table.rows[texts.index(month_first)]}) are not dates of one"
            " form",
        )
    if day_first or month_first:
        return DAY_FIRST if day_first else MONTH_FIRST
    if len(dates) == 1:
        return "one day throughout"
    ambiguous = [match for match in dates.values() if match["first"] != match["second"]]
    if not ambiguous:
        return DAY_FIRST
    other = ambiguous[0]
    choices = " or ".join(_as_time(column, f) for f in (DAY_FIRST, MONTH_FIRST))
    raise refuse(
        table.path,
        f"row {table.rows[texts.index(other[0])]}, column '{column.name}': is '{other[0]}' in"
        f" {_month(other['second'])} or in {_month(other['first'])}? No date in the file decides;"
        f" state it: {choices}",
    )


def _first_above_12(dates: dict[str, re.Match[str]], group: str) -> str:
    """Return the first date in which a number cannot be a month; an empty text if there is none."""
    return next((text for text, match in dates.items() if int(match[group] or 0) > 12), "")


def _month(number: str) -> str:
    return date(2000, int(number), 1).strftime("%B") if 1 <= int(number) <= 12 else "no month"


def _year_month_day(match: re.Match[str], order: str) -> tuple[int, int, int]:
    """Return year, month and day of a date; the month is 0 if its name is unknown."""
    if match["year"]:
        return int(match["year"]), int(match["month"]), int(match["day"])
    if match["name"]:
        return (
            _full_year(match["year_after"]),
            _month_number(match["name"]),
            int(match["day_ahead"]),
        )
    if match["name_ahead"]:
        return int(match["year_last"]), _month_number(match["name_ahead"]), int(match["day_after"])
    first = int(match["first"])
    second = int(match["second"])
    day, month = (second, first) if order == MONTH_FIRST else (first, second)
    return _full_year(match["third"]), month, day


def _full_year(text: str) -> int:
    """Return a year; one of two digits is from 1970 to 2069, as in POSIX."""
    year = int(text)
    if len(text) == 4:
        return year
    return 1900 + year if year >= 70 else 2000 + year


def _month_number(name: str) -> int:
    """Return the number of a month by its English or German name; 0 for other names."""
    start = name[:3].casefold()
    if start in _MONTHS:
        return _MONTHS.index(start) + 1
    return _MONTHS_ELSEWHERE.get(start, 0)


def _continue_after_midnight(table: Table, column: Column, seconds: Array, period: float) -> None:
    """Continue a time of day after each midnight, in place, and add these to the repairs.

    `period` is a day, or the hour of ``mm:ss``, in s. A backward step is a midnight if, with a
    period added, it is at most `_OVER_MIDNIGHT` times the longest forward step.
    """
    known = np.flatnonzero(np.isfinite(seconds))
    clock = seconds[known]
    steps = np.diff(clock)
    if not (steps < 0.0).any() or clock.max() >= period:
        return
    longest = _OVER_MIDNIGHT * float(steps.max())
    midnights = np.flatnonzero((steps < 0.0) & (steps + period <= longest))
    for k in midnights:
        seconds[known[k + 1] :] += period
    if midnights.size:
        rows = [int(table.rows[known[k + 1]]) for k in midnights]
        word = "midnight" if period == _DAY else "the hour"
        table.note(
            "midnight",
            f"column '{column.name}' passes {word} before {list_rows(rows)}: its time goes on",
            rows,
        )


def merge_date_and_time(table: Table, one: Column, other: Column) -> Column:
    """Return one column of the dates and times of day in two, and add that to the repairs."""
    days, clock = (one, other) if is_date(first_text(one)) else (other, one)
    cells = [
        f"{day} {time}" if day.strip() and time.strip() else ""
        for day, time in zip(map(str, days.cells), map(str, clock.cells), strict=True)
    ]
    table.note("date", f"columns '{days.name}' and '{clock.name}' are one date and time")
    return Column(days.name, None, cells)
