"""Shares in percent."""

from __future__ import annotations

import math

_UNCOUNTED = 1e4  # percent, from which on a share is not written out


def format_percent(share: float, more: int = 0) -> str:
    """Return a share in percent, with one decimal; below 1 % with two digits, from 100 % on whole.

    With `more` digits it has these besides. A simulation that runs away misses a record by any
    number, which tells no more; of a constant signal there is no share.
    """
    value = 100.0 * share
    if math.isnan(value):
        return "–"
    if not value < _UNCOUNTED:
        return f"more than {_UNCOUNTED:.0f} %"
    if value >= 99.95:
        return f"{value:.{more}f} %"
    return f"{value:.{1 + more}f} %" if value >= 1.0 else f"{value:.{2 + more}g} %"
