"""Times whose digits are rounded, of an even clock: their steps are those of the clock."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.tables import Column, Table

_FINE = 0.01  # of a step, to which times must be rounded for their steps to be told from jitter
_EXACT = 1e-9  # of a step, to which steps are equal anyway
_DIGITS = 15  # that a double has
_LARGEST = 1e15  # beyond which digits of a double are not those of a clock
_EPSILON = 4.0 * float(np.finfo(float).eps)


def without_rounding(table: Table, column: Column, numbers: Array, time: Array) -> Array:
    """Return times on an even clock if all agree with one within their digits, else as they are.

    Of the periods with which all agree it has the one with the fewest digits, in seconds or in
    hertz. Rows may be missing.

    Parameters
    ----------
    table : Table
        A change is added to its repairs.
    column : Column
    numbers : ndarray, shape (n,)
        In the unit of the file.
    time : ndarray, shape (n,)
        The same, in seconds.

    Returns
    -------
    ndarray, shape (n,)
    """
    steps = np.diff(time)
    if time.size < 3 or not np.isfinite(time).all() or not (steps > 0.0).all():
        return time
    usual = float(np.median(steps))
    moves = np.rint(steps / usual)
    is_even = np.abs(steps / usual - moves).max() <= _EXACT
    if is_even or not moves.all() or np.abs(numbers).max() > _LARGEST:
        return time
    places = np.append(0.0, np.cumsum(moves))
    rounding = _rounding(numbers) * (time[-1] - time[0]) / (numbers[-1] - numbers[0])
    if rounding.max() > _FINE * usual:
        return time
    moved = time[1:] - time[0]
    either = rounding[1:] + rounding[0]
    shortest = float(((moved - either) / places[1:]).max())
    longest = float(((moved + either) / places[1:]).min())
    if shortest > longest:
        return time
    period = next(p for p in _by_digits(shortest, longest) if shortest <= p <= longest)
    table.note(
        "rounded time",
        f"column '{column.name}' is rounded: its steps are taken as {period:.12g} s, with which"
        " all its times agree",
    )
    return np.asarray(time[0] + period * places)


def _rounding(numbers: Array) -> Array:
    """Return half of the last digit of each number (n,), of equally many digits or decimals."""
    size = np.abs(numbers)
    leading = np.full(len(numbers), -np.inf)  # zero has no first digit
    leading[size > 0.0] = np.floor(np.log10(size[size > 0.0]))
    decimals = np.full(len(numbers), _DIGITS)
    for count in range(_DIGITS, -1, -1):
        scaled = size * 10.0**count
        decimals[np.abs(scaled - np.rint(scaled)) <= _EPSILON * scaled] = count
    digits = min(float((decimals + leading).max()) + 1.0, _DIGITS)
    return np.asarray(0.5 * 10.0 ** np.maximum(-float(decimals.max()), leading + 1.0 - digits))


def _by_digits(shortest: float, longest: float) -> Iterator[float]:
    """Yield periods near the middle of a range, of few digits in seconds or hertz first."""
    middle = 0.5 * (shortest + longest)
    for digits in range(_DIGITS):
        yield float(f"{middle:.{digits}e}")
        yield 1.0 / float(f"{1.0 / middle:.{digits}e}")
    yield middle
