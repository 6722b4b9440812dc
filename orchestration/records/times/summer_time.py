"""Local times without a zone: the hour that comes twice and the one that is left out.

At the end of summer time a local clock goes back by an hour, and at its beginning forward, so that
differences of its times are an hour wrong from then on. The zone tells when that happens.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from functools import cache
from zoneinfo import ZoneInfo

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table
from orchestration.reporting import option

_HOUR = 3600.0
_DAY = 86400.0
_NEAR = 3.0
"""Median steps, besides the hour, within which a step is one of the clock and not a pause."""
_CHANGES = ((0, 2), (1, 3))
"""Hours before and after the step forward, in western Europe and elsewhere."""
_MONTHS = (3, 4, 9, 10)
_SUNDAY = 6


@cache
def is_zone(name: str) -> bool:
    """Return whether a text is the name of a time zone, such as ``Europe/Berlin`` or ``UTC``."""
    try:
        ZoneInfo(name)
    except (ValueError, OSError, LookupError):
        return False
    return True


def local_to_utc(table: Table, column: Column, local: Array, zone: str) -> Array:
    """Return the instants of local times.

    Parameters
    ----------
    table : Table
        The zone is added to its repairs.
    column : Column
        The times, for messages.
    local : ndarray, shape (n,)
        Seconds since the day 0 of `datetime.toordinal`, at the local clock; NaN where missing.
    zone : str
        Name of the time zone; empty if it is not known.

    Returns
    -------
    ndarray, shape (n,)
        Seconds in UTC, or as they are without a zone.

    Raises
    ------
    UserError
        If the clock goes back or forward by an hour as at a change of summer time, and no zone is
        stated.
    """
    known = np.flatnonzero(np.isfinite(local))
    if not zone:
        _refuse_change(table, column, local[known], table.rows[known])
        return local
    result = local.copy()
    result[known] -= _offsets(local[known], ZoneInfo(zone))
    table.note("zone", f"column '{column.name}' is read as local time of {zone}")
    return result


def _refuse_change(table: Table, column: Column, local: Array, rows: np.ndarray) -> None:
    """Raise if local times (n,) step by an hour as at a change of summer time."""
    steps = np.diff(local)
    forward = steps[steps > 0.0]
    if not forward.size:
        return
    near = _NEAR * float(np.median(forward)) + 1.0
    for k in np.flatnonzero((steps < 0.0) | (steps > _HOUR)):
        before, after = _moment(local[k]), _moment(local[k + 1])
        step = float(steps[k])
        is_back = step < 0.0 and 0.0 <= step + _HOUR <= near
        is_forward = (
            0.0 <= step - _HOUR <= near
            and after.weekday() == _SUNDAY
            and after.month in _MONTHS
            and (before.hour, after.hour) in _CHANGES
        )
        if is_back or is_forward:
            way = "back" if is_back else "forward"
            advice = " or ".join(
                option("mapping", {column.name: f"time[{zone}]"})
                for zone in ("Europe/Berlin", "UTC")
            )
            raise refuse(
                table.path,
                f"row {rows[k + 1]}, column '{column.name}': the clock goes {way} by an hour, from"
                f" {before:%H:%M:%S} to {after:%H:%M:%S}, as at a change of summer time; state its"
                f" zone: {advice}, without summer time",
            )


def _moment(local: float) -> datetime:
    """Return the date and time of seconds since the day 0."""
    days, seconds = divmod(local, _DAY)
    return datetime.fromordinal(int(days)) + timedelta(seconds=seconds)


def _offsets(local: Array, zone: ZoneInfo) -> Array:
    """Return the seconds (n,) by which local times are ahead of UTC.

    Of the hour that comes twice, times are in the second pass after the clock went back, and in a
    record that begins within it.
    """
    quarters, index = np.unique(np.floor(local / 900.0), return_inverse=True)
    moments = [_moment(900.0 * quarter) for quarter in quarters]
    first, second = (
        np.array([_ahead(moment, zone, fold) for moment in moments])[index] for fold in (0, 1)
    )
    is_twice = first > second
    enters = is_twice & ~np.concatenate(([False], is_twice[:-1]))
    back = is_twice & ~enters & (np.diff(local, prepend=local[:1]) < 0.0)
    passes = np.cumsum(back)
    is_second = passes > np.maximum.accumulate(np.where(enters, passes, 0))
    if is_twice.size and is_twice[0] and not back.any():
        is_second = is_twice
    return np.where(is_twice & is_second, second, first)


def _ahead(moment: datetime, zone: ZoneInfo, fold: int) -> float:
    offset = moment.replace(tzinfo=zone, fold=fold).utcoffset()
    assert offset is not None  # a zone has one at every moment
    return offset.total_seconds()
