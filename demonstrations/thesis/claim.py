"""The yield of a chapter: claims (a printed figure beside the recomputed one), errata, figures.

A claim holds if the recomputed value rounds to the printed one. The tolerance is thus the printed
digits and no choice. Most claims are figures or statements that the thesis prints. Some are
inferred: what follows from its print in one place is held against what it has in another.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_PRINTED = re.compile(rf"(?P<relation>[<>≤≥~])?(?P<low>{_NUMBER})(?: to (?P<high>{_NUMBER}))?")
_ROUNDING = 1e-9  # of half a digit: 0.9865 has been rounded to 0.987


@dataclass(frozen=True)
class Claim:
    """A figure or statement and what the computation gives in its place.

    Attributes
    ----------
    where : str
        Table, figure, equation or section.
    what : str
        The quantity.
    published : str
        As printed: ``"0.45"``, ``"<0.1"``, ``"7 to 10"``, ``"~1e2"`` for an order of magnitude, or
        a word.
    reproduced : float or str
        In the same unit.
    unit : str
        Empty for pure numbers and words.
    reason : str
        Why it does not hold, or what it rests on.
    consistent : str
        What holds instead, where that is not the reproduced value: a figure can follow from its
        program and be wrong.
    erratum : int or None
        Row of ``docs/errata.md``.
    allowed : tuple of float or None
        Least and largest value that the rounding of the printed inputs allows.
    inferred : bool
        The thesis does not print ``published`` of this quantity; it follows from what is printed
        elsewhere.
    """

    where: str
    what: str
    published: str
    reproduced: float | str
    unit: str = ""
    reason: str = ""
    consistent: str = ""
    erratum: int | None = None
    allowed: tuple[float, float] | None = None
    inferred: bool = False

    def _parts(self) -> tuple[str, float, float, float]:
        """Relation, lower and upper figure, and half a unit of the last printed digit."""
        match = _PRINTED.fullmatch(self.published)
        if match is None:
            raise ValueError(f"{self.where}, {self.what}: {self.published!r} is no printed figure")
        low, high = match["low"], match["high"] or match["low"]
        return (
            match["relation"] or "",
            float(low),
            float(high),
            max(_half_digit(low), _half_digit(high)),
        )

    @property
    def printed_range(self) -> tuple[float, float]:
        """Values that would have been printed so."""
        relation, low, high, half = self._parts()
        half *= 1.0 + _ROUNDING
        if relation == "~":
            return low / sqrt(10.0), high * sqrt(10.0)
        if relation:
            return (-float("inf"), high) if relation in "<≤" else (low, float("inf"))
        return low - half, high + half

    @property
    def agrees(self) -> bool:
        """True if the recomputed value would have been printed so."""
        if isinstance(self.reproduced, str):
            return self.reproduced == self.published
        low, high = self.printed_range
        strict = self._parts()[0] in ("<", ">")
        return low < self.reproduced < high if strict else low <= self.reproduced <= high

    @property
    def verdict(self) -> str:
        """``holds``, ``within rounding``, ``only as printed`` (see consistent) or ``differs``.

        The rounding is that of the printed inputs.
        """
        if self.agrees:
            return "only as printed" if self.consistent else "holds"
        if self.allowed is not None:
            low, high = self.printed_range
            if self.allowed[0] <= high and low <= self.allowed[1]:
                return "within rounding"
        return "differs"

    @property
    def holds(self) -> bool:
        """True if the printed figure can stand."""
        return self.verdict in ("holds", "within rounding")

    @property
    def difference(self) -> float | None:
        """Relative difference from the printed figure or the nearest end of its range, or None."""
        if isinstance(self.reproduced, str):
            return None
        relation, low, high, _ = self._parts()
        if (relation or low != high) and self.agrees:
            return None
        nearest = min((low, high), key=lambda end: abs(float(self.reproduced) - end))
        return self.reproduced / nearest - 1.0 if nearest else None

    @property
    def reproduced_text(self) -> str:
        """The recomputed value, with one digit more than is printed and at least three."""
        if isinstance(self.reproduced, str):
            return self.reproduced
        figures = (
            re.sub(r"e.*|\D", "", part).lstrip("0") for part in re.findall(_NUMBER, self.published)
        )
        return number(
            self.reproduced, max(3, *(len(f) + 1 for f in figures)), "e" in self.published
        )


@dataclass(frozen=True)
class Erratum:
    """A row of ``docs/errata.md``.

    Attributes
    ----------
    number : int
    where, printed, holds : str
        Markdown; figures in ``holds`` are computed.
    test : str
        File that shows both figures.
    """

    number: int
    where: str
    printed: str
    holds: str
    test: str = "end_to_end/test_errata"


@dataclass(frozen=True)
class Illustration:
    """A figure of the thesis, drawn from the models.

    Attributes
    ----------
    title : str
    caption : str
        What it shows.
    draw : callable
        Makes the picture.
    """

    title: str
    caption: str
    draw: Callable[[], Figure]


Entry = Claim | Erratum


def number(value: float, digits: int = 3, powers: bool = False) -> str:
    """Format a value with so many significant digits: ``3860``; with powers ``3.86e3``."""
    text = f"{value:.{digits - 1}e}" if powers else f"{value:.{digits}g}"
    if "e+" in text and not powers:
        text = f"{float(text):.0f}"
    return text.replace("e+0", "e").replace("e+", "e")


def spread(function: Callable[..., float], printed: Sequence[str]) -> tuple[float, float]:
    """Return least and largest value of a function over unrounded arguments.

    These are what its printed arguments may have been before rounding.

    Parameters
    ----------
    function : callable
        Of as many numbers; monotonic in each over so small a range.
    printed : sequence of str

    Returns
    -------
    tuple of float
    """
    ends = [(float(text) - _half_digit(text), float(text) + _half_digit(text)) for text in printed]
    values = [float(function(*corner)) for corner in itertools.product(*ends)]
    return min(values), max(values)


def _half_digit(number: str) -> float:
    mantissa, _, exponent = number.partition("e")
    return float(0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2])))
