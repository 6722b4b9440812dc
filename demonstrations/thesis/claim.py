"""Results of a chapter: claims (a printed and a computed figure), errata, figures.

A claim holds if the computed value rounds to the printed one, so that the tolerance follows from
the printed digits. Most claims are figures or statements in the thesis. Some are inferred: a
consequence of one printed place is compared with another place.
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
    """A printed figure or statement, with the computed one.

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
        Reason why it does not hold, or assumption of the computation.
    consistent : str
        Correct value, if that is not the reproduced one: a figure can follow from its program and
        be wrong.
    erratum : int or None
        Row of ``docs/errata.md``.
    allowed : tuple of float or None
        Least and largest value that the rounding of the printed inputs allows.
    inferred : bool
        True if the thesis does not print ``published`` for this quantity, but it follows from
        another place.
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
        """Return relation, lower and upper figure, and half a unit of the last printed digit."""
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
        """Range of the values that round to the printed figure."""
        relation, low, high, half = self._parts()
        half *= 1.0 + _ROUNDING
        if relation == "~":
            return low / sqrt(10.0), high * sqrt(10.0)
        if relation:
            return (-float("inf"), high) if relation in "<≤" else (low, float("inf"))
        return low - half, high + half

    @property
    def agrees(self) -> bool:
        """True if the computed value rounds to the printed figure."""
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
        """True if the printed figure is correct."""
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
        """Computed value with one digit more than the printed figure, and at least three."""
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
    """Row of ``docs/errata.md``.

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
    """Figure of the thesis, drawn from the models.

    Attributes
    ----------
    title : str
    caption : str
        Description below the figure.
    draw : callable
        Returns the picture.
    """

    title: str
    caption: str
    draw: Callable[[], Figure]


Entry = Claim | Erratum


def number(value: float, digits: int = 3, powers: bool = False) -> str:
    """Return a value with a number of significant digits: ``3860``, or with powers ``3.86e3``."""
    text = f"{value:.{digits - 1}e}" if powers else f"{value:.{digits}g}"
    if "e+" in text and not powers:
        text = f"{float(text):.0f}"
    return text.replace("e+0", "e").replace("e+", "e")


def spread(function: Callable[..., float], printed: Sequence[str]) -> tuple[float, float]:
    """Return the range of a function over all arguments that round to the printed ones.

    Parameters
    ----------
    function : callable
        Function of as many numbers, monotonic in each over such a small range.
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
