"""Kinds of decays: how each settles, with a law hidden in it or without."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array

Values = Mapping[str, float]
_STICKING = 1e-3  # of a signal, up to which the sign of a velocity is smooth
_STEFAN_BOLTZMANN = 5.670374419e-8  # W/m^2/K^4


@dataclass(frozen=True)
class Decay:
    """A system that settles by itself.

    Attributes
    ----------
    model : str
        Class in the module `models.decays`.
    nominal : mapping of str to float
        Parameters of the model, of which a specimen differs.
    hidden : float
        Size of the hidden law, SI.
    rates : callable
        Derivatives of states, by time and states, of parameters and the size of what is hidden.
    shown : callable
        The output, of states (s, n) and parameters.
    output : tuple of str
        Name and unit.
    starts : tuple of tuple of float
        Least and most that every state starts at, as a hidden law may be slight at small ones.
    duration : float
        s.
    samples : int
    causes : tuple of str
        Parts of names of effects, any of which is right.
    known : tuple of str
        Parameters that are held, as their scale shows nowhere.
    """

    model: str
    nominal: Values
    hidden: float
    rates: Callable[[Array, Values, float], list[float]]
    shown: Callable[[Array, Values], Array]
    output: tuple[str, str]
    starts: tuple[tuple[float, float], ...]
    duration: float
    samples: int
    causes: tuple[str, ...]
    known: tuple[str, ...] = ()


def _first_state(x: Array, p: Values) -> Array:
    return x[0]


def _pendulum(x: Array, p: Values, dry: float) -> list[float]:
    friction = p["damping"] * x[1] + dry * np.tanh(x[1] / _STICKING)
    return [x[1], -(p["weight"] * np.sin(x[0]) + friction) / p["inertia"]]


def _car(x: Array, p: Values, quadratic: float) -> list[float]:
    resistance = p["rolling"] + p["viscous"] * x[0] + quadratic * x[0] * abs(x[0])
    return [-resistance / p["mass"]]


def _capacitor(x: Array, p: Values, cubic: float) -> list[float]:
    return [-(x[0] / p["resistance"] + cubic * x[0] ** 3) / p["capacitance"]]


def _cooling(x: Array, p: Values, area: float) -> list[float]:
    room = p["room"]
    loss = p["conductance"] * (x[0] - room) + area * _STEFAN_BOLTZMANN * (x[0] ** 4 - room**4)
    return [-loss / p["capacity"]]


def _torsion(x: Array, p: Values, cubic: float) -> list[float]:
    torque = p["stiffness"] * x[0] + cubic * x[0] ** 3 + p["damping"] * x[1]
    return [x[1], -torque / p["inertia"]]


def _recovery(x: Array, p: Values, share: float) -> list[float]:
    return [-x[0] / p["retardation_time"], -x[1] / (8.0 * p["retardation_time"])]


def _recovered(x: Array, p: Values) -> Array:
    return x[0] + x[1] + p["permanent"]


KINDS: dict[str, Decay] = {
    "pendulum": Decay(
        "Pendulum",
        {"inertia": 0.05, "weight": 1.5, "damping": 0.004},
        0.01,
        _pendulum,
        _first_state,
        ("angle", "rad"),
        ((0.8, 1.5), (-0.5, 0.5)),
        20.0,
        1000,
        ("coulomb", "stribeck", "sliding"),
        ("inertia",),
    ),
    "car": Decay(
        "Car",
        {"mass": 1200.0, "rolling": 130.0, "viscous": 6.0},
        0.4,
        _car,
        _first_state,
        ("speed", "m/s"),
        ((28.0, 36.0),),
        90.0,
        900,
        ("drag", "quadratic"),
        ("mass",),
    ),
    "capacitor": Decay(
        "Capacitor",
        {"capacitance": 1e-3, "resistance": 20e3},
        1.5e-6,
        _capacitor,
        _first_state,
        ("voltage", "V"),
        ((8.0, 12.0),),
        40.0,
        800,
        ("leakage", "cubic", "quadratic", "exponential"),
        ("capacitance",),
    ),
    "cooling": Decay(
        "Cooling",
        {"capacity": 900.0, "conductance": 0.5, "room": 293.15},
        0.008,
        _cooling,
        _first_state,
        ("temperature", "K"),
        ((600.0, 800.0),),
        5400.0,
        900,
        ("heat_loss", "quadratic", "cubic", "exponential"),
        ("capacity",),
    ),
    "torsion": Decay(
        "Torsion",
        {"inertia": 2e-3, "stiffness": 0.3, "damping": 4e-4},
        0.06,
        _torsion,
        _first_state,
        ("twist", "rad"),
        ((0.9, 1.4), (-1.0, 1.0)),
        12.0,
        1200,
        ("cubic",),
        ("inertia",),
    ),
    "recovery": Decay(
        "Recovery",
        {"retardation_time": 40.0, "permanent": 0.002},
        0.5,
        _recovery,
        _recovered,
        ("strain", "1"),
        ((0.01, 0.02), (0.0, 0.0)),
        600.0,
        900,
        ("lag", "kelvin", "element", "arm", "node", "lead"),
    ),
}
