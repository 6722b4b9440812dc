"""Shares in percent."""

from __future__ import annotations

import math

_UNCOUNTED = 1e4  # percent, from which on a share is not written out


def format_percent(share: float) -> str:
    """Return a share as text in percent: one decimal, below 1 % two digits, from 100 % on none.

    The text is a dash for NaN, the share of a constant signal, and a bound from `_UNCOUNTED`
    percent on, as of a simulation that diverges.
    """
    value = 100.0 * share
    if math.isnan(value):
        return "–"
    if not value < _UNCOUNTED:
        return f"more than {_UNCOUNTED:.0f} %"
    if value >= 99.95:
        return f"{value:.0f} %"
    return f"{value:.1f} %" if value >= 1.0 else f"{value:.2g} %"
