"""Claims and errata of a part of the thesis, by name or number."""

from functools import cache
from types import ModuleType

from demonstrations.thesis.claim import Claim, Erratum


@cache
def _entries(part: ModuleType) -> tuple[Claim | Erratum, ...]:
    return tuple(part.entries())


def claims(part: ModuleType, number: int) -> list[Claim]:
    """Claims of a row of the errata."""
    of_row = [c for c in _entries(part) if isinstance(c, Claim) and c.erratum == number]
    assert of_row, f"no claim belongs to row {number}"
    return of_row


def claim(part: ModuleType, what: str, where: str = "") -> Claim:
    """The one claim about a quantity."""
    (one,) = [
        c
        for c in _entries(part)
        if isinstance(c, Claim) and c.what == what and c.where.startswith(where)
    ]
    return one


def row(part: ModuleType, number: int) -> Erratum:
    """A row of the errata."""
    (one,) = [e for e in _entries(part) if isinstance(e, Erratum) and e.number == number]
    return one
