"""Times that are not what they seem: days or milliseconds without a unit, coarse stamps."""

from __future__ import annotations

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table
from orchestration.reporting import option

_DATES = {
    "ms": ((6.0e11, 4.2e12),),
    "us": ((6.0e14, 4.2e15),),
    "ns": ((6.0e17, 4.2e18),),
    # a spreadsheet, MATLAB, Julian days: 1980 to 2100
    "d": ((29221.0, 73050.0), (722816.0, 767011.0), (2444240.0, 2488070.0)),
}
"""By unit: ranges of numbers that are dates from about 1990 on, since 1970 or the epoch of days."""
_ROUND = 1e-4
"""Largest relative deviation from two digits of a step that somebody chose; 1 s is 1.1574e-5 d."""
_SHARED = 1.5
"""Rows for each stamp above which the stamps, and not the rows, are coarse."""


def unit_of_dates(time: Array) -> str | None:
    """Return the unit in which numbers are dates and not seconds; None if they are seconds.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Numbers of a column without a unit.

    Returns
    -------
    str or None
        A unit of pint. Numbers in a range of days are seconds if their step has few digits.
    """
    known = time[np.isfinite(time)]
    if not known.size:
        return None
    for unit, ranges in _DATES.items():
        if not any(low <= known.min() and known.max() <= high for low, high in ranges):
            continue
        step = float(known[-1] - known[0]) / max(known.size - 1, 1)  # digits of each are rounded
        is_chosen = abs(step - float(f"{step:.1e}")) <= _ROUND * abs(step)
        return None if unit == "d" and is_chosen else unit
    return None


def require_unit(table: Table, column: Column, time: Array) -> None:
    """Refuse times (n,) without a unit that are probably days or parts of a second since 1970.

    Raises
    ------
    UserError
        With the options that state the unit.
    """
    unit = unit_of_dates(time)
    if unit is None:
        return
    likely, plain = (option("mapping", {column.name: f"time[{one}]"}) for one in (unit, "s"))
    raise refuse(
        table.path,
        f"row {table.rows[0]}, column '{column.name}': is {time[np.isfinite(time)][0]:.12g} a date"
        f" in {unit}, or a time in {column.unit or 's'}? State the unit: {likely} or {plain}",
    )


def require_resolution(table: Table, column: Column, time: Array, discard: float) -> None:
    """Refuse stamps that are coarser than the rows: what is between them is not in the file.

    Parameters
    ----------
    table : Table
    column : Column
        Dates or times of day.
    time : ndarray, shape (n,)
        Seconds.
    discard : float
        Percent of the rows that may be averaged all the same.

    Raises
    ------
    UserError
        With the options that settle it.
    """
    known = time[np.isfinite(time)]
    changes = np.flatnonzero(np.diff(known))
    stamps = changes.size + 1
    if stamps < 2 or known.size < _SHARED * stamps:
        return
    lost = 100.0 * (1.0 - stamps / known.size)
    if lost <= discard:
        return
    # between the first change and the last, as the ends of the record may be within a stamp
    seconds = known[changes[-1] + 1] - known[changes[0] + 1]
    rate = (changes[-1] - changes[0]) / seconds if seconds > 0.0 else 1.0
    raise refuse(
        table.path,
        f"column '{column.name}': {known.size} rows have {stamps} different times, which are"
        f" coarser than the rows. {option('rate', f'{rate:.3g}Hz')} counts the rows, if they are"
        f" that far apart; {option('discard', f'{np.ceil(lost):g}%')} averages those of one time;"
        f" {option('mapping', {'column': 'time'})} names another column",
    )
