"""Curves of a signal in three formulas each, and what a kind of lack is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import cos, exp, tanh

import numpy as np

from studies.hidden import Dice, curves
from studies.hidden_laws.place import Answer, Curve, Lack, answers, over, over_count
from studies.plants import PLANTS, Place

Maker = Callable[[Dice], Lack]
Shapes = dict[
    str, tuple[frozenset[str], Callable[[Dice], Curve]]
]  # with names of the closed form, if it has one
NONE: frozenset[str] = frozenset()
_STEEPEST = 30.0  # exponent, beyond any that a record visits


@dataclass(frozen=True)
class Kind:
    """A shape of a lack in a plant.

    Attributes
    ----------
    plant, kind, shape : str
    place : Place
    memory : str
        What is remembered of the signal; empty of a curve of the signal as it is.
    right : frozenset of Answer
        Every form that is mathematically the same.
    closed : frozenset of str
        Names of the closed form among those that a search knows, straight parts apart; empty where
        there is none.
    make : callable
        Draws it.
    coefficient : tuple of str and float
        Parameter that a multiplied law is proportional to, and its power; empty where the law is
        added to.
    """

    plant: str
    kind: str
    shape: str
    place: Place
    memory: str
    right: frozenset[Answer]
    closed: frozenset[str]
    make: Maker
    coefficient: tuple[str, float]

    def drawn(self, rng: np.random.Generator, strength: float, duration: float) -> Lack:
        """Draw sizes."""
        return self.make(Dice(rng, strength, duration))


@dataclass(frozen=True)
class Missing:
    """A part that a law of a plant may lack, in several shapes.

    Attributes
    ----------
    kind : str
    place : str
        Law and signal.
    shapes : Shapes or dict of str to callable
        Curves of the signal or of what is remembered of it, or what makes the whole.
    memory : str
        What is remembered of the signal.
    signals : str
        That may be named besides, such as another name of the same one.
    memories : str
        That may be named, if more than one.
    multiplied : str
        Laws of which something added and something multiplied are the same, because the law is a
        function of the same signal, or constant.
    also : str
        Other answers, as `answers` reads them.
    coefficient : tuple of str and float
        Of `Kind`.
    """

    kind: str
    place: str
    shapes: Shapes | dict[str, Maker]
    memory: str = ""
    signals: str = ""
    memories: str = ""
    multiplied: str = ""
    also: str = ""
    coefficient: tuple[str, float] = ("", 1.0)

    def kinds(self, plant: str) -> Iterator[Kind]:
        """Yield every shape."""
        at = Place.of(self.place)
        right = answers(";".join(self._answers(plant, at)))
        for shape, made in self.shapes.items():
            closed, make = (NONE, made) if callable(made) else (made[0], self._maker(made[1]))
            yield Kind(
                plant,
                self.kind,
                shape,
                at,
                self.memory,
                right,
                closed,
                make,
                self.coefficient,
            )

    def _answers(self, plant: str, at: Place) -> Iterator[str]:
        """Yield answers that are right, as `answers` reads them."""
        named = ", ".join(filter(None, (at.signal, self.signals)))
        of = f"{named} [{self.memories or self.memory}]"
        if at.kind == "add":
            yield f"{', '.join(PLANTS[plant].equals(at.law, PLANTS[plant].nominal))} + {of}"
        else:
            yield f"{at.law} x {of}"
        yield self.also
        if self.multiplied:
            yield f"{self.multiplied} * {of}"

    def _maker(self, draw: Callable[[Dice], Curve]) -> Maker:
        """Return what draws a curve of the signal, or of what is counted of it."""
        counted = "time" if Place.of(self.place).signal == "time" else self.memory
        if counted:
            return lambda d: over_count(self.place, draw(d), counted)
        return lambda d: over(self.place, draw(d))


def odd_powers(low: float, high: float, at: float) -> Shapes:
    """Return odd powers, of a brake or a spring."""
    return {
        "power 1.5": (NONE, lambda d: curves.power(d.size(low, high), at, d.plain(1.45, 1.6))),
        "power 2.5": (NONE, lambda d: curves.power(d.size(low, high), at, d.plain(2.4, 2.7))),
        "cube": (frozenset({"cubic"}), lambda d: curves.power(d.size(low, high), at, 3.0)),
    }


def odd_bends(low: float, high: float, at: float) -> Shapes:
    """Return odd curves that harden, go on in a straight line, or have a gap."""
    return {
        "sinh": (NONE, lambda d: curves.hard_sinh(d.size(low, high), at)),
        "square": (
            frozenset({"odd_quadratic"}),
            lambda d: curves.power(d.size(low, high), at, 2.0),
        ),
        "rational": (NONE, lambda d: curves.hard_rational(d.size(low, high), at)),
    }


def levelling(low: float, high: float, share: float) -> Shapes:
    """Return what a law lacks where it levels off, of a share of its slope; levels are drawn."""
    return {
        "tanh": (
            frozenset({"saturating", "levelling"}),
            lambda d: _less(d.strength * share, d.plain(low, high), tanh),
        ),
        "rational": (
            NONE,
            lambda d: _less(d.strength * share, d.plain(low, high), lambda z: z / (1.0 + abs(z))),
        ),
        "root": (
            NONE,
            lambda d: _less(
                d.strength * share, d.plain(low, high), lambda z: z / (1.0 + z * z) ** 0.5
            ),
        ),
    }


def _less(slope: float, level: float, form: Curve) -> Curve:
    return lambda x: slope * (level * form(x / level) - x)


def even(low: float, high: float, at: float) -> Shapes:
    """Return curves that are the same in both directions."""
    return {
        "square": (
            frozenset({"quadratic"}),
            lambda d: _scaled(d.size(low, high), at, lambda z: z * z),
        ),
        "rational": (
            NONE,
            lambda d: _scaled(d.size(low, high), at, lambda z: 2.0 * z * z / (1.0 + z * z)),
        ),
        "power": (NONE, lambda d: _scaled(d.size(low, high), at, lambda z: abs(z) ** 1.5)),
    }


def rising(low: float, high: float, at: float, zero: float = 0.0) -> Shapes:
    """Return curves that are larger on one side than on the other."""
    exponential = frozenset({"exponential"})
    saturating = frozenset({"saturating"})
    known = (
        zero == 0.0
    )  # a search knows forms about zero alone, but for those that are the same about any point
    return {
        "exponential": (
            exponential,
            lambda d: _scaled(d.size(low, high), at, lambda z: exp(min(z, _STEEPEST)) - 1.0, zero),
        ),
        "tanh": (
            saturating if known else NONE,
            lambda d: _scaled(d.size(low, high), at, lambda z: tanh(1.5 * z), zero),
        ),
        "hinge": (
            NONE,
            lambda d: _scaled(d.size(low, high), at, lambda z: curves.softplus(z, 0.15), zero),
        ),
    }


def one_sided(low: float, high: float, at: float) -> Shapes:
    """Return curves of the direction."""
    return {
        "modulus": (frozenset({"asymmetric"}), lambda d: _scaled(d.size(low, high), at, abs)),
        "power": (NONE, lambda d: curves.one_way_power(d.size(low, high), at)),
        "soft": (
            NONE,
            lambda d: _scaled(d.size(low, high), at, lambda z: curves.softplus(z, 0.2) - 0.2),
        ),
    }


def growing(low: float, high: float, at: float) -> Shapes:
    """Return curves that grow with what has been counted from zero on."""
    return {
        "levelling": (
            frozenset({"saturating"}),
            lambda d: _scaled(d.size(low, high), at, lambda z: tanh(2.0 * z)),
        ),
        "exponential": (
            frozenset({"exponential"}),
            lambda d: _scaled(d.size(low, high), at, lambda z: 1.0 - exp(-3.0 * z)),
        ),
        "root": (
            frozenset({"square_root"}),
            lambda d: _scaled(d.size(low, high), at, lambda z: abs(z) ** 0.5),
        ),
    }


def positive(low: float, high: float, at: float) -> Shapes:
    """Return curves of a signal that is never negative."""
    return {
        "power": (NONE, lambda d: _scaled(d.size(low, high), at, lambda z: abs(z) ** 1.6)),
        "square": (
            frozenset({"quadratic", "odd_quadratic"}),
            lambda d: _scaled(d.size(low, high), at, lambda z: z * z),
        ),
        "bell": (
            NONE,
            lambda d: _scaled(
                d.size(low, high), at, lambda z: 0.5 - 0.5 * cos(2.0 * min(abs(z), 1.57))
            ),
        ),
    }


def _scaled(amount: float, at: float, form: Curve, zero: float = 0.0) -> Curve:
    return lambda x: amount * form((x - zero) / at)
