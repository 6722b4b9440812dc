"""What a check reports."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
_MOST = 8


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with an FMU, or worth knowing.

    Attributes
    ----------
    line : int
        Line of the FMU contract it belongs to, 1 to 11.
    severity : {"error", "warning", "note"}
        An error breaks FMI 2.0 or keeps hosts from loading the FMU; a warning breaks the contract only; a note is
        worth knowing.
    message : str
        What, where, and what is expected, in one line.
    """

    line: int
    severity: Severity
    message: str


def listed(names: Iterable[str]) -> str:
    """Names in one line; of many only the first few."""
    names = list(names)
    more = len(names) - _MOST
    return ", ".join(names[:_MOST]) + (f" and {more} more" if more > 0 else "")
