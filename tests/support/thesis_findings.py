"""Looking up what ``ppy thesis`` finds."""

from demonstrations.thesis import chapters
from demonstrations.thesis.claim import Claim, Erratum


def claims(number: int) -> list[Claim]:
    """Claims of a row of the errata."""
    found = [c for group in chapters.claims().values() for c in group if c.erratum == number]
    assert found, f"no claim belongs to row {number}"
    return found


def claim(what: str, where: str = "") -> Claim:
    """The one claim about a quantity."""
    (found,) = [
        c
        for group in chapters.claims().values()
        for c in group
        if c.what == what and c.where.startswith(where)
    ]
    return found


def row(number: int) -> Erratum:
    """A row of the errata."""
    (found,) = [e for e in chapters.errata() if e.number == number]
    return found
