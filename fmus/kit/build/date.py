"""The date that an FMU says it was generated on, which no clock sets: the same sources give the same bytes."""

from __future__ import annotations

import datetime
import os

from fmus.kit.errors import UserError

_RELEASED = "2026-11-20T00:00:00Z"  # of this version, as in CHANGELOG.md
_VARIABLE = "SOURCE_DATE_EPOCH"
_LATEST = 253402300799  # s, the end of the year 9999


def generation_date() -> str:
    """Write the date and time for ``generationDateAndTime``.

    Returns
    -------
    str
        In UTC: ``SOURCE_DATE_EPOCH`` of the environment (seconds since 1970), or else the date of this version.

    Raises
    ------
    UserError
        If ``SOURCE_DATE_EPOCH`` is no such number.
    """
    given = os.environ.get(_VARIABLE, "")
    if not given:
        return _RELEASED
    if not (given.isascii() and given.isdigit() and int(given[:20]) <= _LATEST):
        raise UserError(
            f"{_VARIABLE} = {given[:40]!r}: seconds since 1970 are wanted, a whole number from 0 to {_LATEST}"
        )
    return datetime.datetime.fromtimestamp(int(given), datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
