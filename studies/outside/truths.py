"""Kinds of truth that the models lack, with the laws and signals that are right as its cause.

Half of them are inside of what a search of laws looks for, as a function of a signal or of one
memory of it, half are outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from studies.outside import elements as of
from studies.outside.elements import Element, named
from studies.outside.plants import Plant

Draw = Callable[[float, float], float]


@dataclass(frozen=True)
class Kind:
    """A kind of truth at a place of a plant.

    Attributes
    ----------
    name : str
    place : str
        Law that is added to.
    signals : tuple of str
        That are right; an empty one is a constant.
    inside : bool
        Whether one term of a search is able to be it.
    make : callable
        Draws the element.
    own : bool
        Whether its own law alone is right, and not all that act alike.
    also : tuple of (str, str)
        Further pairs of law and signal that are right.
    """

    name: str
    place: str
    signals: tuple[str, ...]
    inside: bool
    make: Callable[[Draw], Element]
    own: bool = False
    also: tuple[tuple[str, str], ...] = ()

    def right(self, plant: Plant) -> list[tuple[str, str]]:
        """Return the pairs of law and signal that are right."""
        laws = {self.place} if self.own else plant.alike(self.place)
        return [*((law, s) for law in sorted(laws) for s in self.signals), *self.also]


def drawer(rng: np.random.Generator) -> Draw:
    """Return a function that draws between two numbers, equally in the logarithm."""
    return lambda low, high: float(math.exp(rng.uniform(math.log(low), math.log(high))))


def _bump(at: float, width: float) -> Callable[[float], float]:
    return lambda v: math.exp(-(((v - at) / width) ** 2))


_FORCE, _POSITION, _SPEED = named("force"), named("position"), named("velocity")
_ELASTIC = lambda s: s["stiffness"] * s["position"]  # noqa: E731
_VISCOUS = lambda s: s["damping"] * s["velocity"]  # noqa: E731

_SPRING = (
    Kind("dry friction", "friction", ("velocity",), True, lambda d: of.dry(_SPEED, d(0.02, 0.2))),
    Kind("drag", "friction", ("velocity",), True, lambda d: of.plain(lambda v: v * abs(v), _SPEED)),
    Kind(
        "cubic spring",
        "elastic",
        ("position",),
        True,
        lambda d: of.plain(lambda x: x**3, _POSITION),
    ),
    Kind("constant force", "push", ("",), True, lambda d: of.plain(lambda f: 1.0, _FORCE)),
    Kind("late force", "push", ("force",), True, lambda d: of.lag(_FORCE, d(0.08, 0.5))),
    Kind(
        "force levels off", "push", ("force",), True, lambda d: of.levels_off(_FORCE, d(4.0, 9.0))
    ),
    Kind(
        "friction over position",
        "friction",
        ("position",),
        True,
        lambda d: of.times(lambda x: x * x, _POSITION, _VISCOUS),
        True,
    ),
    Kind(
        "bristles",
        "friction",
        ("velocity", "position"),
        False,
        lambda d: of.bristle(_SPEED, d(0.02, 0.15), d(0.2, 1.0), d(0.1, 0.5)),
    ),
    Kind(
        "play", "elastic", ("position",), False, lambda d: of.play(_POSITION, d(0.03, 0.15), 0.03)
    ),
    Kind(
        "spread relaxation",
        "elastic",
        ("position", "velocity"),
        False,
        lambda d: of.spread_fading(_POSITION, (0.2, 0.8, d(2.0, 5.0))),
    ),
    Kind(
        "rate limit",
        "push",
        ("force",),
        False,
        lambda d: of.rate_limit(_FORCE, d(15.0, 60.0), 0.03),
    ),
    Kind(
        "lag by direction",
        "push",
        ("force",),
        False,
        lambda d: of.lag_by_direction(_FORCE, d(0.05, 0.2), d(0.3, 0.8)),
    ),
    Kind(
        "rounded corner",
        "push",
        ("force",),
        False,
        lambda d: of.levels_off_late(_FORCE, d(3.5, 7.0)),
    ),
    Kind("changed spring", "elastic", ("time",), False, lambda d: of.late(_ELASTIC)),
    Kind("changed friction", "friction", ("time",), False, lambda d: of.late(_VISCOUS)),
)

_CURRENT = named("current")
_USED = named("drawn", 1.0 / 7200.0)
_OHMIC = lambda s: s["R0"] * s["current"]  # noqa: E731

_CELL = (
    Kind(
        "curve of the voltage",
        "open_voltage",
        ("drawn",),
        True,
        lambda d: of.plain(_bump(d(0.1, 0.5), d(0.08, 0.2)), _USED),
        True,
        (("open_voltage", "open_voltage"),),  # which is a function of the charge alone
    ),
    Kind(
        "knee of the voltage",
        "open_voltage",
        ("drawn",),
        True,
        (
            lambda d: (
                lambda at: of.plain(lambda q: -math.log1p(math.exp((q - at) / 0.05)), _USED)
            )(d(0.3, 0.6))
        ),
        True,
        (("open_voltage", "open_voltage"),),  # which is a function of the charge alone
    ),
    Kind(
        "square of the current",
        "ohmic",
        ("current",),
        True,
        lambda d: of.plain(lambda i: i * abs(i), _CURRENT),
    ),
    Kind(
        "kinetics level off",
        "ohmic",
        ("current",),
        True,
        lambda d: (lambda at: of.plain(lambda i: math.asinh(i / at), _CURRENT))(d(0.1, 0.8)),
    ),
    Kind(
        "resistance over charge",
        "ohmic",
        ("drawn",),
        True,
        lambda d: of.times(lambda q: q, _USED, _OHMIC),
        True,
    ),
    Kind(
        "second pair",
        "ohmic",
        ("current",),
        True,
        lambda d: of.remembered(_CURRENT, d(250.0, 700.0)),
    ),
    Kind(
        "resistance over squared charge",
        "ohmic",
        ("drawn",),
        False,
        lambda d: of.times(lambda q: q * q, _USED, _OHMIC),
        True,
    ),
    Kind(
        "current by a curve of charge",
        "ohmic",
        ("drawn",),
        False,
        lambda d: of.times(_bump(d(0.15, 0.6), d(0.1, 0.25)), _USED, _OHMIC),
        True,
    ),
    Kind(
        "diffusion",
        "ohmic",
        ("current", "relaxed"),
        False,
        lambda d: of.spread_lags(_CURRENT, (20.0, 150.0, d(500.0, 900.0))),
        also=(("relaxed_rate", "current"), ("relaxed_rate", "relaxed")),  # a spread of its times
    ),
    Kind(
        "hysteresis",
        "open_voltage",
        ("drawn", "current"),
        False,
        lambda d: of.hysteresis(_CURRENT, d(80.0, 400.0)),
    ),
    Kind(
        "lag by direction",
        "ohmic",
        ("current",),
        False,
        lambda d: (
            lambda lag: Element(lambda s, z: s["current"] + lag.value(s, z), lag.rates, lag.start)
        )(of.lag_by_direction(_CURRENT, d(100.0, 250.0), d(400.0, 900.0))),
    ),
    Kind("changed resistance", "ohmic", ("time",), False, lambda d: of.late(_OHMIC)),
    Kind(
        "warm resistance",
        "ohmic",
        ("current",),
        False,
        lambda d: of.heats(_OHMIC, _CURRENT, 3.0, d(200.0, 600.0)),
    ),
)

_POWER, _FAN, _WARM = named("power"), named("fan"), named("warm")
_LOSS = lambda s: s["still"] * s["warm"]  # noqa: E731
_COOLING = lambda s: s["blown"] * s["fan"] * s["warm"]  # noqa: E731


def _in_cooling(made: Element) -> Element:
    """Let a change of the fan act through the temperature."""
    return Element(
        lambda s, z: s["blown"] * s["warm"] * made.value(s, z), made.rates, made.start, made.most
    )


_HEATED = (
    Kind(
        "free convection",
        "loss",
        ("warm",),
        True,
        lambda d: of.plain(lambda w: w * math.sqrt(abs(w)), _WARM),
    ),
    Kind("radiation", "loss", ("warm",), True, lambda d: of.plain(lambda w: w**3, _WARM)),
    Kind("constant heat", "heating", ("",), True, lambda d: of.plain(lambda p: 1.0, _POWER)),
    Kind("late heat", "heating", ("power",), True, lambda d: of.lag(_POWER, d(15.0, 60.0))),
    Kind(
        "heater by temperature",
        "heating",
        ("warm",),
        True,
        lambda d: of.times(lambda w: w / 20.0, _WARM, _POWER),
        True,
    ),
    Kind(
        "curve of the fan",
        "cooling",
        ("fan",),
        True,
        lambda d: _in_cooling(of.plain(lambda f: math.sqrt(max(f, 0.0)) - f, _FAN)),
        True,
    ),
    Kind(
        "heater levels off",
        "heating",
        ("power",),
        True,
        lambda d: of.levels_off(_POWER, d(10.0, 25.0)),
    ),
    Kind(
        "second store",
        "loss",
        ("warm", "shown"),
        False,
        lambda d: of.spread_fading(_WARM, (40.0, d(150.0, 500.0))),
    ),
    Kind(
        "fan lags by direction",
        "cooling",
        ("fan",),
        False,
        lambda d: _in_cooling(of.lag_by_direction(_FAN, d(5.0, 20.0), d(50.0, 150.0))),
        True,
    ),
    Kind(
        "product of inputs",
        "heating",
        ("fan",),
        False,
        lambda d: of.times(lambda f: f, _FAN, _POWER),
        True,
    ),
    Kind(
        "rate limit of the fan",
        "cooling",
        ("fan",),
        False,
        lambda d: _in_cooling(of.rate_limit(_FAN, d(0.004, 0.015), 3.0)),
        True,
    ),
    Kind(
        "rounded corner",
        "heating",
        ("power",),
        False,
        lambda d: of.levels_off_late(_POWER, d(8.0, 15.0)),
    ),
    Kind("opened lid", "loss", ("time",), False, lambda d: of.late(_LOSS)),
    Kind("worn fan", "cooling", ("time",), False, lambda d: of.late(_COOLING)),
)

_PUMP, _VALVE, _UPPER = named("pump"), named("valve"), named("upper")
_INFLOW = lambda s: s["delivery"] * s["pump"]  # noqa: E731
_PASSED = lambda s: s["passage"] * s["valve"] * math.sqrt(max(s["upper"], 1e-4))  # noqa: E731


def _in_flow(made: Element, name: str) -> Element:
    """Let a change of an input act through its flow."""
    if name == "pump":
        gain = lambda s: s["delivery"]  # noqa: E731
    else:
        gain = lambda s: s["passage"] * math.sqrt(max(s["upper"], 1e-4))  # noqa: E731
    return Element(lambda s, z: gain(s) * made.value(s, z), made.rates, made.start, made.most)


_TANK = (
    Kind("leak", "inflow", ("",), True, lambda d: of.plain(lambda p: -1e-3, _PUMP)),
    Kind(
        "square of the pump",
        "inflow",
        ("pump",),
        True,
        lambda d: of.plain(lambda p: 1e-3 * p * p, _PUMP),
    ),
    Kind(
        "pump against the level",
        "inflow",
        ("upper",),
        True,
        lambda d: of.times(lambda h: -h, _UPPER, _INFLOW),
    ),
    Kind(
        "late pump",
        "inflow",
        ("pump",),
        True,
        lambda d: _in_flow(of.lag(_PUMP, d(8.0, 30.0)), "pump"),
    ),
    Kind(
        "late valve",
        "passed",
        ("valve",),
        True,
        lambda d: _in_flow(of.lag(_VALVE, d(8.0, 30.0)), "valve"),
        True,
    ),
    Kind(
        "curve of the valve",
        "passed",
        ("valve",),
        True,
        lambda d: _in_flow(of.plain(lambda w: w * w, _VALVE), "valve"),
        True,
    ),
    Kind(
        "outlet by level",
        "outflow",
        ("lower",),
        True,
        lambda d: of.plain(lambda h: 1e-3 * h * h, named("lower")),
    ),
    Kind(
        "play of the valve",
        "passed",
        ("valve",),
        False,
        lambda d: _in_flow(of.play(_VALVE, d(0.06, 0.15), 1.5), "valve"),
        True,
    ),
    Kind(
        "rate limit of the valve",
        "passed",
        ("valve",),
        False,
        lambda d: _in_flow(of.rate_limit(_VALVE, d(0.003, 0.012), 1.5), "valve"),
        True,
    ),
    Kind(
        "pump lags by direction",
        "inflow",
        ("pump",),
        False,
        lambda d: _in_flow(of.lag_by_direction(_PUMP, d(4.0, 12.0), d(25.0, 60.0)), "pump"),
    ),
    Kind(
        "overflow",
        "inflow",
        ("upper",),
        False,
        lambda d: (
            lambda at: of.plain(lambda h: -1e-3 * math.log1p(math.exp((h - at) / 0.02)), _UPPER)
        )(d(0.5, 0.75)),
    ),
    Kind(
        "product of inputs",
        "inflow",
        ("valve",),
        False,
        lambda d: of.times(lambda w: w, _VALVE, _INFLOW),
        True,
    ),
    Kind("clogged passage", "passed", ("time",), False, lambda d: of.late(_PASSED)),
)

_VOLTS, _AMPS, _OMEGA = named("voltage"), named("current"), named("speed")
_TORQUE = lambda s: s["constant"] * s["current"]  # noqa: E731
_WINDING = lambda s: s["resistance"] * s["current"]  # noqa: E731
_RUBBING = lambda s: s["damping"] * s["speed"]  # noqa: E731

_MOTOR = (
    Kind("dry friction", "friction", ("speed",), True, lambda d: of.dry(_OMEGA, d(0.5, 5.0))),
    Kind(
        "fan as load",
        "friction",
        ("speed",),
        True,
        lambda d: of.plain(lambda w: 1e-4 * w * abs(w), _OMEGA),
    ),
    Kind("constant load", "torque", ("",), True, lambda d: of.plain(lambda i: 0.1, _AMPS)),
    Kind("late voltage", "supply", ("voltage",), True, lambda d: of.lag(_VOLTS, d(0.01, 0.05))),
    Kind(
        "torque levels off",
        "torque",
        ("current",),
        True,
        lambda d: of.levels_off(lambda s: _TORQUE(s), d(0.15, 0.5)),
    ),
    Kind("brushes", "ohmic", ("current",), True, lambda d: of.dry(_AMPS, d(0.1, 0.6))),
    Kind(
        "cubic drag",
        "friction",
        ("speed",),
        True,
        lambda d: of.plain(lambda w: 1e-6 * w**3, _OMEGA),
    ),
    Kind(
        "bristles",
        "friction",
        ("speed",),
        False,
        lambda d: of.bristle(_OMEGA, d(0.3, 2.0), d(0.3, 1.0), d(2.0, 10.0)),
    ),
    Kind(
        "warm winding",
        "ohmic",
        ("current",),
        False,
        lambda d: of.heats(_WINDING, _AMPS, 4.0, d(0.5, 2.0)),
    ),
    Kind(
        "eddy currents",
        "torque",
        ("current",),
        False,
        lambda d: of.spread_fading(_AMPS, (0.02, 0.06, d(0.15, 0.3))),
        also=(("friction", "speed"), ("speed_rate", "speed")),  # an acceleration that fades
    ),
    Kind(
        "rate limit",
        "supply",
        ("voltage",),
        False,
        lambda d: of.rate_limit(_VOLTS, d(60.0, 300.0), 0.008),
    ),
    Kind(
        "voltage by speed",
        "torque",
        ("speed", "voltage"),
        False,
        lambda d: of.times(lambda w: w / 100.0, _OMEGA, lambda s: 0.01 * s["voltage"]),
    ),
    Kind(
        "rounded corner",
        "torque",
        ("current",),
        False,
        lambda d: of.levels_off_late(lambda s: _TORQUE(s), d(0.15, 0.4)),
    ),
    Kind("changed friction", "friction", ("time",), False, lambda d: of.late(_RUBBING)),
    Kind("changed winding", "ohmic", ("time",), False, lambda d: of.late(_WINDING)),
)

KINDS: dict[str, tuple[Kind, ...]] = {
    "spring": _SPRING,
    "cell": _CELL,
    "heated": _HEATED,
    "tank": _TANK,
    "motor": _MOTOR,
}
