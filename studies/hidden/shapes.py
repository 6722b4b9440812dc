"""Families of what may be hidden, at a place of any plant.

Each has several shapes, their sizes drawn at random.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import exp, pi, sin, sqrt

import numpy as np

from studies.hidden import curves
from studies.plants import Change, in_a_row, late, of_time, play, remembered, static

OUTSIDE = "outside"  # every family: nothing in the catalogue is right
STRENGTHS = 1.0, 0.3


class Dice:
    """A source of random sizes, scaled by a strength; it knows the length of the record in s."""

    def __init__(self, rng: np.random.Generator, strength: float, duration: float):
        self.strength = strength
        self.duration = duration
        self._rng = rng

    def size(self, low: float, high: float) -> float:
        """Draw a size between two, times the strength."""
        return self.strength * self.plain(low, high)

    def plain(self, low: float, high: float) -> float:
        """Draw a value between two, in the logarithm where both are positive."""
        if low > 0.0:
            return float(np.exp(self._rng.uniform(np.log(low), np.log(high))))
        return float(self._rng.uniform(low, high))

    def sign(self) -> float:
        """Draw plus or minus one."""
        return float(self._rng.choice([-1.0, 1.0]))


Maker = Callable[[Dice], Change]


@dataclass(frozen=True)
class Variation:
    """A shape of a family in a plant, and what it may be called."""

    plant: str
    family: str
    shape: str
    right: frozenset[str]
    make: Maker

    @property
    def place(self) -> str:
        """Where it is, whatever its size."""
        return self.drawn(np.random.default_rng(0), 1.0, 60.0).place

    def drawn(self, rng: np.random.Generator, strength: float, duration: float) -> Change:
        """Draw sizes."""
        return self.make(Dice(rng, strength, duration))


def named(plant: str, family: str, right: str, shapes: dict[str, Maker]) -> Iterator[Variation]:
    """Return the shapes of a family; right answers are separated by semicolons."""
    names = frozenset(name.strip() for name in right.split(";") if name.strip())
    for shape, make in shapes.items():
        yield Variation(plant, family, shape, names, make)


def dry(place: str, low: float, high: float, width: float, finest: float) -> dict[str, Maker]:
    """Return dry friction with three shapes of its sign."""
    return {
        "arc tangent": lambda d: static(place, curves.dry_arctan(d.size(low, high), width), finest),
        "root": lambda d: static(place, curves.dry_root(d.size(low, high), width), finest),
        "Stribeck": lambda d: static(place, curves.stribeck(d.size(low, high), width), finest),
    }


def drag(place: str, low: float, high: float, at: float) -> dict[str, Maker]:
    """Return drag by other powers than two, or one that tapers."""
    return {
        "lower power": lambda d: static(
            place, curves.power(d.size(low, high), at, d.plain(1.7, 1.85))
        ),
        "higher power": lambda d: static(
            place, curves.power(d.size(low, high), at, d.plain(2.15, 2.3))
        ),
        "tapering": lambda d: static(place, curves.tapering_drag(d.size(low, high), at)),
    }


def uneven(place: str, low: float, high: float, at: float) -> dict[str, Maker]:
    """Return forces larger in one direction than in the other."""
    return {
        "rounded": lambda d: static(place, curves.one_way(d.size(low, high), at)),
        "power": lambda d: static(place, curves.one_way_power(d.size(low, high), at)),
    }


def zone(place: str, low: float, high: float) -> dict[str, Maker]:
    """Return dead zones: rounded, with soft edges, or wider on one side."""
    return {
        "hyperbola": lambda d: static(place, curves.zone_hyperbola(d.size(low, high))),
        "soft": lambda d: static(place, curves.zone_soft(d.size(low, high))),
        "uneven": lambda d: static(place, curves.zone_uneven(d.size(low, high))),
    }


def levelling(place: str, low: float, high: float) -> dict[str, Maker]:
    """Return saturations by three formulas."""

    def algebraic(d: Dice) -> Change:
        return static(
            place, curves.level_algebraic(d.plain(low, high), d.strength, d.plain(3.0, 5.0))
        )

    return {
        "algebraic": algebraic,
        "arc tangent": lambda d: static(place, curves.level_arctan(d.plain(low, high), d.strength)),
        "exponential": lambda d: static(
            place, curves.level_exponential(d.plain(low, high), d.strength)
        ),
    }


def backlash(place: str, low: float, high: float, time: float) -> dict[str, Maker]:
    """Return play with rounded or uneven edges that settles in a time."""

    def rounded(d: Dice) -> Change:
        width = d.size(low, high)
        return play(place, lambda e: e + curves.zone_soft(width)(e), time)

    def uneven(d: Dice) -> Change:
        width = d.size(low, high)
        return play(place, lambda e: e + curves.zone_uneven(width)(e), time)

    return {"rounded": rounded, "uneven": uneven}


def lag(place: str, low: float, high: float) -> dict[str, Maker]:
    """Return two lags in a row, or two in parallel."""

    def spread(d: Dice) -> Change:
        time = d.size(low, high)
        return remembered(place, 1.0, (0.4 * time, 1.6 * time), own=True)

    return {
        "two in a row": lambda d: in_a_row(place, 1.0, d.size(low, high), 2),
        "spread": spread,
    }


def drift(output: str, size: float) -> dict[str, Maker]:
    """Return drifts of an output that settle, slow down or grow."""

    def settling(d: Dice) -> Change:
        most = d.sign() * d.size(0.6 * size, 1.6 * size)
        time = d.plain(0.3, 0.6) * d.duration
        return of_time(output, lambda y, t: most * (1.0 - exp(-t / time)))

    def root(d: Dice) -> Change:
        most = d.sign() * d.size(0.6 * size, 1.6 * size)
        return of_time(output, lambda y, t: most * sqrt(t / d.duration))

    def growing(d: Dice) -> Change:
        most = d.sign() * d.size(0.6 * size, 1.6 * size)
        return of_time(output, lambda y, t: most * (t / d.duration) ** 1.7)

    return {"settling": settling, "root": root, "growing": growing}


def delayed(output: str, low: float, high: float) -> dict[str, Maker]:
    """Return a delay of an output by whole samples."""
    return {"whole samples": lambda d: late(output, d.size(low, high))}


def shifted(place: str, size: float) -> dict[str, Maker]:
    """Return a constant, which has one shape only; here it wanders by a tenth."""

    def constant(d: Dice) -> Change:
        most = d.sign() * d.size(0.7 * size, 1.5 * size)
        period = d.duration
        return of_time(place, lambda x, t: most * (1.0 + 0.05 * sin(2.0 * pi * t / period)))

    return {"constant": constant}


def outside(place: str, size: float, period: float, per_signal: float) -> dict[str, Maker]:
    """Return a disturbance that returns, one that jumps, and one that ages the law."""

    def returning(d: Dice) -> Change:
        most = d.size(0.7 * size, 1.5 * size)
        time = d.plain(0.7, 3.0) * period
        return of_time(place, lambda x, t: most * sin(2.0 * pi * t / time))

    def jumping(d: Dice) -> Change:
        most = d.sign() * d.size(0.7 * size, 1.5 * size)
        begin, end = d.plain(0.2, 0.3) * d.duration, d.plain(0.4, 0.55) * d.duration
        return of_time(place, lambda x, t: most if begin < t < end else 0.0)

    def ageing(d: Dice) -> Change:
        most = d.size(0.7, 1.5) * per_signal
        return of_time(place, lambda x, t: most * x * (t / d.duration) ** 2)

    return {"returning": returning, "jumping": jumping, "ageing": ageing}
