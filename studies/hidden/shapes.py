"""Families of what may be hidden, at a place of any plant.

Each has several shapes, their sizes drawn at random.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import exp, pi, sin, sqrt

import numpy as np

from studies.hidden import curves
from studies.plants import Change, in_a_row, ladder, late, of_time, play, remembered, static

TWO = 0.4, 1.6  # times of two stores, over their mean
THREE = 0.2, 0.7, 2.5
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
        """Its place, of any size."""
        return self.drawn(np.random.default_rng(0), 1.0, 60.0).place

    def drawn(self, rng: np.random.Generator, strength: float, duration: float) -> Change:
        """Draw sizes."""
        return self.make(Dice(rng, strength, duration))


Shapes = dict[str, Maker]  # of one family, by name
Family = tuple[str, str, Shapes]  # name, right answers (separated by semicolons), shapes


def variations(plant: str, families: Iterable[Family]) -> Iterator[Variation]:
    """Yield every shape of the families of a plant."""
    for family, right, shapes in families:
        names = frozenset(name.strip() for name in right.split(";") if name.strip())
        for shape, make in shapes.items():
            yield Variation(plant, family, shape, names, make)


def sensor(kind: str, output: str, *size: float) -> Family:
    """Return a fault of the sensor of an output, one of `_SENSORS`."""
    effect, shapes = _SENSORS[kind]
    return f"sensor {kind}", f"{effect}({output})", shapes(output, *size)


def dry(place: str, low: float, high: float, width: float, finest: float) -> Shapes:
    """Return dry friction with three shapes of its sign."""
    return {
        "arc tangent": lambda d: static(place, curves.dry_arctan(d.size(low, high), width), finest),
        "root": lambda d: static(place, curves.dry_root(d.size(low, high), width), finest),
        "Stribeck": lambda d: static(place, curves.stribeck(d.size(low, high), width), finest),
    }


def drag(place: str, low: float, high: float, at: float) -> Shapes:
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


def uneven(place: str, low: float, high: float, at: float) -> Shapes:
    """Return forces larger in one direction than in the other."""
    return {
        "rounded": lambda d: static(place, curves.one_way(d.size(low, high), at)),
        "power": lambda d: static(place, curves.one_way_power(d.size(low, high), at)),
    }


def zone(place: str, low: float, high: float) -> Shapes:
    """Return dead zones: rounded, with soft edges, or wider on one side."""
    return {
        "hyperbola": lambda d: static(place, curves.zone_hyperbola(d.size(low, high))),
        "soft": lambda d: static(place, curves.zone_soft(d.size(low, high))),
        "uneven": lambda d: static(place, curves.zone_uneven(d.size(low, high))),
    }


def levelling(place: str, low: float, high: float) -> Shapes:
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


def backlash(place: str, low: float, high: float, time: float) -> Shapes:
    """Return play with rounded or uneven edges that settles in a time."""

    def rounded(d: Dice) -> Change:
        width = d.size(low, high)
        return play(place, lambda e: e + curves.zone_soft(width)(e), time)

    def uneven(d: Dice) -> Change:
        width = d.size(low, high)
        return play(place, lambda e: e + curves.zone_uneven(width)(e), time)

    return {"rounded": rounded, "uneven": uneven}


def lag(place: str, low: float, high: float) -> Shapes:
    """Return two lags in a row, or two in parallel."""

    def spread(d: Dice) -> Change:
        time = d.size(low, high)
        return remembered(place, 1.0, (0.4 * time, 1.6 * time), own=True)

    return {
        "two in a row": lambda d: in_a_row(place, 1.0, d.size(low, high), 2),
        "spread": spread,
    }


def drift(output: str, size: float) -> Shapes:
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


def delayed(output: str, low: float, high: float) -> Shapes:
    """Return a delay of an output by whole samples."""
    return {"whole samples": lambda d: late(output, d.size(low, high))}


def gain(output: str, low: float, high: float) -> Shapes:
    """Return a sensor of another scale, which has one shape only."""

    def constant(d: Dice) -> Change:
        share = d.sign() * d.size(low, high)
        return static(output, lambda y: share * y)

    return {"constant": constant}


def powers(place: str, at: float, **shapes: tuple[float, float, float, float]) -> Shapes:
    """Return powers by name: sizes at `at` and exponents, each between two."""

    def make(low: float, high: float, least: float, most: float) -> Maker:
        return lambda d: static(place, curves.power(d.size(low, high), at, d.plain(least, most)))

    return {name.replace("_", " "): make(*drawn) for name, drawn in shapes.items()}


def hardening(place: str, low: float, high: float, at: float) -> Shapes:
    """Return springs that harden by two formulas."""
    return {
        "sinh": lambda d: static(place, curves.hard_sinh(d.size(low, high), at)),
        "rational": lambda d: static(place, curves.hard_rational(d.size(low, high), at)),
    }


def stop(
    place: str,
    low: float,
    high: float,
    where: tuple[float, float],
    width: float,
    either_side: bool = True,
) -> Shapes:
    """Return one-sided stops, rounded or after Hertz, of a stiffness and at a place."""

    def make(curve: Callable[[float, float, float, float], curves.Curve]) -> Maker:
        return lambda d: static(
            place,
            curve(d.size(low, high), d.plain(*where), width, d.sign() if either_side else 1.0),
        )

    return {"rounded": make(curves.stop_rounded), "Hertz": make(curves.stop_hertz)}


def stores(
    place: str,
    amount: tuple[float, float],
    time: tuple[float, float],
    rest: float = 0.0,
    names: tuple[str, str] = ("two stores", "three stores"),
) -> Shapes:
    """Return two or three stores behind resistances, beside what is there: they take and give."""

    def make(times: tuple[float, ...]) -> Maker:
        def store(d: Dice) -> Change:
            mean = d.plain(*time)
            return remembered(place, d.size(*amount), [mean * t for t in times], rest, ahead=True)

        return store

    return {name: make(times) for name, times in zip(names, (TWO, THREE), strict=True)}


def slow_pair(
    place: str,
    amount: tuple[float, float],
    diffusion: tuple[float, float],
    stretched: tuple[float, float],
) -> Shapes:
    """Return what follows by diffusion, or by a spectrum of times; both times are drawn."""

    def spectrum(d: Dice) -> Change:
        mean = d.plain(*stretched)
        return remembered(place, d.size(*amount), [mean * 10.0**k for k in (-0.6, -0.2, 0.2, 0.6)])

    return {
        "diffusion": lambda d: ladder(place, d.size(*amount), d.plain(*diffusion)),
        "stretched": spectrum,
    }


def charge_transfer(place: str, low: float, high: float) -> Shapes:
    """Return overvoltages of a charge transfer, V at 2 A."""
    return {
        "Butler and Volmer": lambda d: static(
            place, curves.butler_volmer(d.size(low, high), 2.0, d.plain(0.15, 0.5))
        ),
        **powers(place, 2.0, exponent=(low, high, 0.4, 0.6)),
    }


def shifted(place: str, size: float) -> Shapes:
    """Return a constant, which has one shape only; here it wanders by a tenth."""

    def constant(d: Dice) -> Change:
        most = d.sign() * d.size(0.7 * size, 1.5 * size)
        period = d.duration
        return of_time(place, lambda x, t: most * (1.0 + 0.05 * sin(2.0 * pi * t / period)))

    return {"constant": constant}


def outside(place: str, size: float, period: float, per_signal: float) -> Shapes:
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


_SENSORS: dict[str, tuple[str, Callable[..., Shapes]]] = {
    "lag": ("sensor_lag", lag),
    "delay": ("transport_delay", delayed),
    "offset": ("sensor_offset", shifted),
    "drift": ("sensor_drift", drift),
    "gain": ("sensor_gain", gain),
}
