"""Findings: what a check of an FMU reports."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
_MOST_LISTED = 8


@dataclass(frozen=True)
class Finding:
    """One fault of an FMU, or a remark on it.

    Attributes
    ----------
    line : int
        Line of the FMU contract that it is about, 1 to 11.
    severity : {"error", "warning", "note"}
        An error breaks FMI 2.0 or keeps hosts from loading the FMU; a warning breaks the contract
        only; a note is worth knowing.
    message : str
        The fault, its place, and what is expected instead, in one line.
    """

    line: int
    severity: Severity
    message: str


def listed(names: Iterable[str]) -> str:
    """Return names in one line; of many only the first few."""
    names = list(names)
    more = len(names) - _MOST_LISTED
    return ", ".join(names[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
