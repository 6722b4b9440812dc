"""Elements of which what is hidden is made: functions of signals, some with a memory."""

from __future__ import annotations

import math
from collections.abc import Callable, MutableMapping, Sequence
from dataclasses import dataclass

Signals = MutableMapping[str, float]
Signal = Callable[[Signals], float]


def _no_rates(s: Signals, z: Sequence[float]) -> tuple[float, ...]:
    return ()


def _no_start(s: Signals) -> tuple[float, ...]:
    return ()


@dataclass(frozen=True)
class Element:
    """An addition of size 1.

    Attributes
    ----------
    value : callable
        Of signals and memories.
    rates : callable
        Of the memories, 1/s.
    start : callable
        Of the memories, in equilibrium with the signals.
    most : float
        Largest size that makes sense; 1 where it replaces a signal by another.
    """

    value: Callable[[Signals, Sequence[float]], float]
    rates: Callable[[Signals, Sequence[float]], tuple[float, ...]] = _no_rates
    start: Callable[[Signals], tuple[float, ...]] = _no_start
    most: float = math.inf


def named(name: str, factor: float = 1.0) -> Signal:
    """Return a signal by its name, times a factor."""
    return lambda s: factor * s[name]


def plain(function: Callable[[float], float], of: Signal) -> Element:
    """Return a function of a signal."""
    return Element(lambda s, z: function(of(s)))


def times(function: Callable[[float], float], of: Signal, law: Signal) -> Element:
    """Return a share of a law, as a function of a signal."""
    return Element(lambda s, z: law(s) * function(of(s)))


def dry(of: Signal, width: float) -> Element:
    """Return a smooth sign."""
    return plain(lambda v: math.tanh(v / width), of)


def levels_off(of: Signal, level: float) -> Element:
    """Replace a signal by its hyperbolic tangent."""
    return Element(lambda s, z: level * math.tanh(of(s) / level) - of(s), most=1.0)


def levels_off_late(of: Signal, level: float) -> Element:
    """Replace a signal by one that is straight up to near its level: a rounded corner."""
    return Element(
        lambda s, z: of(s) / (1.0 + abs(of(s) / level) ** 6) ** (1.0 / 6.0) - of(s), most=1.0
    )


def lag(of: Signal, time: float) -> Element:
    """Replace a signal by its first-order lag."""
    return Element(
        lambda s, z: z[0] - of(s), lambda s, z: ((of(s) - z[0]) / time,), lambda s: (of(s),), 1.0
    )


def remembered(of: Signal, time: float) -> Element:
    """Return the first-order lag of a signal."""
    return Element(lambda s, z: z[0], lambda s, z: ((of(s) - z[0]) / time,), lambda s: (of(s),))


def lag_by_direction(of: Signal, up: float, down: float) -> Element:
    """Replace a signal by a lag whose time constant differs up and down."""
    return Element(
        lambda s, z: z[0] - of(s),
        lambda s, z: ((of(s) - z[0]) / (up if of(s) > z[0] else down),),
        lambda s: (of(s),),
        1.0,
    )


def spread_lags(of: Signal, times: Sequence[float]) -> Element:
    """Return the mean of lags of a signal; behind their states may stand those of others."""
    count = len(times)
    return Element(
        lambda s, z: sum(z[:count]) / count,
        lambda s, z: tuple((of(s) - x) / t for x, t in zip(z[:count], times, strict=True)),
        lambda s: (of(s),) * len(times),
    )


def spread_fading(of: Signal, times: Sequence[float]) -> Element:
    """Return a signal less the mean of its lags."""
    lags = spread_lags(of, times)
    return Element(lambda s, z: of(s) - lags.value(s, z), lags.rates, lags.start)


def rate_limit(of: Signal, rate: float, time: float) -> Element:
    """Replace a signal by one that follows no faster than a rate, 1/s."""
    return Element(
        lambda s, z: z[0] - of(s),
        lambda s, z: (max(-rate, min(rate, (of(s) - z[0]) / time)),),
        lambda s: (of(s),),
        1.0,
    )


def play(of: Signal, width: float, time: float) -> Element:
    """Replace a signal by one that it drags along with play; the contact gives within a time."""

    def rates(s: Signals, z: Sequence[float]) -> tuple[float, ...]:
        gap = of(s) - z[0]
        return ((gap - max(-width, min(width, gap))) / time,)

    return Element(lambda s, z: z[0] - of(s), rates, lambda s: (of(s),), 1.0)


def bristle(speed: Signal, way: float, stribeck: float, slow: float) -> Element:
    """Return the friction of LuGre: bristles that give over a way before they slide.

    Canudas de Wit, Olsson, Astrom, Lischinsky: A new model for control of systems with friction,
    IEEE Transactions on Automatic Control 40, 1995.
    """

    def rates(s: Signals, z: Sequence[float]) -> tuple[float, ...]:
        v = speed(s)
        level = 1.0 + stribeck * math.exp(-((v / slow) ** 2))
        return ((v - abs(v) * z[0] / level) / way,)

    return Element(lambda s, z: z[0], rates, lambda s: (0.0,))


def hysteresis(flow: Signal, way: float) -> Element:
    """Return a side between -1 and 1 that changes over an amount that flows."""
    return Element(
        lambda s, z: z[0],
        lambda s, z: ((flow(s) - abs(flow(s)) * z[0]) / way,),
        lambda s: (0.0,),
    )


def heats(law: Signal, flow: Signal, heat: float, time: float) -> Element:
    """Return a share of a law by how warm the square of a flow has made it."""
    return Element(
        lambda s, z: law(s) * z[0],
        lambda s, z: (((flow(s) / heat) ** 2 - z[0]) / time,),
        lambda s: (0.0,),
    )


def late(law: Signal) -> Element:
    """Return a law in the second half of the record and after it."""
    return Element(lambda s, z: law(s) * s["late"])
