"""Curves of one signal, as textbooks have them; none is a formula of the effects' catalogue."""

from __future__ import annotations

from collections.abc import Callable
from math import asinh, atan, copysign, exp, log1p, pi, sinh, sqrt

Curve = Callable[[float], float]


def softplus(x: float, width: float) -> float:
    """Return a hinge that is rounded within a width."""
    z = x / width
    return width * (z if z > 40.0 else log1p(exp(z)) if z > -40.0 else 0.0)


def dry_arctan(force: float, width: float) -> Curve:
    """Return dry friction, its sign by an arc tangent."""
    return lambda v: force * 2.0 / pi * atan(v / width)


def dry_root(force: float, width: float) -> Curve:
    """Return dry friction, its sign by a root."""
    return lambda v: force * v / sqrt(v * v + width * width)


def stribeck(force: float, width: float) -> Curve:
    """Return friction that is larger when it breaks away, after Stribeck; the sign by a ratio."""
    return lambda v: force * (1.0 + 0.4 * exp(-abs(v) / (10.0 * width))) * v / (abs(v) + width)


def power(force: float, at: float, exponent: float) -> Curve:
    """Return drag with any exponent."""
    return lambda v: copysign(force * (abs(v) / at) ** exponent, v)


def tapering_drag(force: float, at: float) -> Curve:
    """Return drag that is quadratic at first, then less so."""
    return lambda v: force * 1.5 * (v / at) * abs(v / at) / (1.0 + 0.5 * abs(v / at))


def one_way(force: float, at: float) -> Curve:
    """Return a force larger in one direction than in the other, with a rounded bend."""
    return lambda v: force * (softplus(v / at, 0.1) - softplus(-v / at, 0.1) * 0.3)


def one_way_power(force: float, at: float) -> Curve:
    """Return a force with a power of 1.3, the same in both directions."""
    return lambda v: force * abs(v / at) ** 1.3


def hard_sinh(force: float, at: float) -> Curve:
    """Return a spring that hardens as a hyperbolic sine."""
    return lambda x: force * (sinh(2.5 * x / at) - 2.5 * x / at) / (sinh(2.5) - 2.5)


def hard_rational(force: float, at: float) -> Curve:
    """Return a spring that hardens and then goes on in a straight line."""
    return lambda x: force * 2.0 * (x / at) ** 3 / (1.0 + (x / at) ** 2)


def stop_rounded(stiffness: float, where: float, width: float, sign: float = 1.0) -> Curve:
    """Return a one-sided spring with a rounded edge."""
    return lambda x: sign * stiffness * softplus(sign * x - where, width)


def stop_hertz(stiffness: float, where: float, width: float, sign: float = 1.0) -> Curve:
    """Return a one-sided spring as a ball on a plane, after Hertz."""
    return lambda x: sign * stiffness * max(sign * x - where, 0.0) ** 1.5 / sqrt(10.0 * width)


def zone_hyperbola(width: float) -> Curve:
    """Return what a dead zone takes away, rounded as a hyperbola."""
    return lambda u: -width * u / sqrt(u * u + width * width)


def zone_soft(width: float) -> Curve:
    """Return what a dead zone with two soft edges takes away."""
    return lambda u: softplus(u - width, 0.2 * width) - softplus(-u - width, 0.2 * width) - u


def zone_uneven(width: float) -> Curve:
    """Return what a dead zone with soft edges takes away, wider on one side."""
    return lambda u: (
        softplus(u - 1.4 * width, 0.2 * width) - softplus(-u - 0.6 * width, 0.2 * width) - u
    )


def level_algebraic(level: float, strength: float, sharpness: float) -> Curve:
    """Return what saturation takes away, algebraic with any exponent but two."""
    return lambda u: (
        strength * u * ((1.0 + abs(u / level) ** sharpness) ** (-1.0 / sharpness) - 1.0)
    )


def level_arctan(level: float, strength: float) -> Curve:
    """Return what saturation by an arc tangent takes away."""
    return lambda u: strength * (level * 2.0 / pi * atan(0.5 * pi * u / level) - u)


def level_exponential(level: float, strength: float) -> Curve:
    """Return what saturation by an exponential takes away."""
    return lambda u: strength * (copysign(level * (1.0 - exp(-abs(u) / level)), u) - u)


def butler_volmer(drop: float, at: float, onset: float) -> Curve:
    """Return the overvoltage of a charge transfer: an inverse hyperbolic sine."""
    return lambda i: drop * asinh(i / onset) / asinh(at / onset)
