"""The plants: equations with a hidden law of a certain strength, which is zero in their models."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.kit.arrays import Array

Numbers = Mapping[str, float]
_MODELS = Path(__file__).with_name("models")


@dataclass(frozen=True)
class Plant:
    """A plant with a hidden law.

    Attributes
    ----------
    law : str
        The hidden one, for people.
    model : str
        As a command takes it.
    parameters : Mapping of str to float
        Nominal values, SI.
    inputs, outputs : Mapping of str to str
        Their units, by name.
    ranges : tuple of (float, float)
        Of the inputs.
    states : int
        All start at rest, zero.
    rates, shown : callable
        Rates of the states and values of the outputs, of states, inputs, parameters and the
        strength of the hidden law.
    step, slow : float
        Between samples, and the slowest time constant that matters, s.
    strengths : tuple of float
        Range from which the strength is drawn.
    right : frozenset of (str, str)
        Laws of the model with their signals by which the hidden one is named.
    known : tuple of str
        Parameters that are known.
    """

    law: str
    model: str
    parameters: Numbers
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    ranges: tuple[tuple[float, float], ...]
    states: int
    rates: Callable[[Array, Array, Numbers, float], list[float]]
    shown: Callable[[Array, Array, Numbers, float], list[Array]]
    step: float
    slow: float
    strengths: tuple[float, float]
    right: frozenset[tuple[str, str]]
    known: tuple[str, ...] = ()


def _pairs(laws: str, signals: str) -> frozenset[tuple[str, str]]:
    return frozenset((law, signal) for law in laws.split() for signal in signals.split())


# --- actuator: eqs. 3.1 to 3.9 of the thesis
# --------------------------------------------------------------------------------------------------

_FILM = {"R1": 0.43, "R2": 2.35, "C": 2.7, "alpha": 6.8e-5}
_CHAIN = {"k1": 6300.0, "b1": 1.7e6, "k2": 1.0e4, "b2": 2.0e6}


def _leakage(charge: Array | float, p: Numbers, a: float) -> Array | float:
    return p["R2"] / (1.0 + a * charge**2)


def _charging(charge: Array, current: Array, p: Numbers, leakage: Array | float) -> Array:
    return np.asarray((leakage * current - charge / p["C"]) / (p["R1"] + leakage))


def _actuator_rates(law: str) -> Callable[[Array, Array, Numbers, float], list[float]]:
    def rates(x: Array, u: Array, p: Numbers, a: float) -> list[float]:
        leakage = _leakage(x[0], p, a if law == "leakage" else 0.0)
        stress = u[1] - p["k2"] * x[1]
        creep = stress / p["b2"] * (1.0 + (a * stress**2 if law == "creep" else 0.0))
        flow = u[1] / p["b1"] * (1.0 + (a * u[1] if law == "flow" else 0.0))
        return [float(_charging(x[0], u[0], p, leakage)), creep, flow]

    return rates


def _actuator_shown(law: str) -> Callable[[Array, Array, Numbers, float], list[Array]]:
    def shown(x: Array, u: Array, p: Numbers, a: float) -> list[Array]:
        leakage = _leakage(x[0], p, a if law == "leakage" else 0.0)
        voltage = p["R1"] * _charging(x[0], u[0], p, leakage) + x[0] / p["C"]
        strain = p["alpha"] * x[0] * (1.0 + (a * u[1] if law == "coupling" else 0.0))
        return [voltage, strain + x[1] + x[2] + u[1] / p["k1"]]

    return shown


def _actuator(title: str, law: str, strengths: tuple[float, float], right: frozenset) -> Plant:
    return Plant(
        title,
        "ppy_actuator",
        _FILM | _CHAIN,
        {"current": "A", "force": "N"},
        {"voltage": "V", "displacement": "m"},
        ((-0.5, 0.5), (0.1, 2.5)),
        3,
        _actuator_rates(law),
        _actuator_shown(law),
        step=1.0,
        slow=60.0,
        strengths=strengths,
        right=right,
    )


# --- stage, muscle and cell
# --------------------------------------------------------------------------------------------------


def _stage_rates(law: str) -> Callable[[Array, Array, Numbers, float], list[float]]:
    def rates(x: Array, u: Array, p: Numbers, a: float) -> list[float]:
        command = float(u[0])
        if law == "dead zone":
            command = max(command - a, 0.0) + min(command + 0.3 * a, 0.0)
        drive = p["gain"] * command * (1.0 + (a * x[0] if law == "product" else 0.0))
        side = a * x[2] if law == "hysteresis" else 0.0
        balance = drive - p["stiffness"] * x[0] - side - p["damping"] * x[1]
        changes = (x[1] - abs(x[1]) * x[2]) / 0.08  # Bouc and Wen, of a way of 0.08 m
        return [x[1], balance / p["mass"], changes]

    return rates


def _stage(title: str, law: str, strengths: tuple[float, float], right: frozenset) -> Plant:
    return Plant(
        title,
        f"{_MODELS / 'stage.py'}:Stage",
        {"mass": 0.8, "stiffness": 12.0, "damping": 2.0, "gain": 1.0},
        {"command": "V"},
        {"place": "m"},
        ((-6.0, 6.0),),
        3,
        _stage_rates(law),
        lambda x, u, p, a: [x[0]],
        step=0.03,
        slow=1.0,
        strengths=strengths,
        right=right,
        known=("gain",),
    )


def _muscle_rates(x: Array, u: Array, p: Numbers, a: float) -> list[float]:
    slower = 1.0 + a * (u[0] < x[0])
    filling = (u[0] - x[0]) / (p["filling_time"] * slower)
    return [filling, (p["area"] * x[0] - p["stiffness"] * x[1]) / p["damping"]]


def _cell_rates(x: Array, u: Array, p: Numbers, a: float) -> list[float]:
    heat = p["resistance"] * u[0] ** 2 + a * u[0] * x[0]
    return [u[0], (heat - p["loss_rate"] * x[1]) / p["heat_capacity"]]


def _cell_shown(x: Array, u: Array, p: Numbers, a: float) -> list[Array]:
    return [x[1], p["full_voltage"] - p["slope"] * x[0] - p["resistance"] * u[0]]


_FORCES = "drive elastic friction acceleration"

PLANTS = {
    "leakage": _actuator(
        "R2(Q^2)",
        "leakage",
        (0.05, 0.25),
        _pairs("supply_current capacitor_current", "charge"),
    ),
    "coupling": _actuator(
        "alpha(F)",
        "coupling",
        (0.15, 0.4),
        _pairs("charge_elongation", "force charge"),
    ),
    "flow": _actuator(
        "flow over F^2", "flow", (0.4, 1.5), _pairs("maxwell_rate flow_force", "force")
    ),
    "creep": _actuator(
        "cubic creep",
        "creep",
        (0.4, 1.5),
        _pairs("kelvin_rate kelvin_force", "kelvin_rate"),
    ),
    "direction": Plant(
        "a lag with a direction",
        f"{_MODELS / 'muscle.py'}:Muscle",
        {"filling_time": 1.5, "area": 2.0, "stiffness": 40.0, "damping": 30.0},
        {"command": "bar"},
        {"measured_stroke": "m"},
        ((0.5, 5.0),),
        2,
        _muscle_rates,
        lambda x, u, p, a: [x[1]],
        step=0.12,
        slow=4.0,
        strengths=(0.8, 2.5),
        right=_pairs("filling", "filling command pressure"),
        known=("damping",),
    ),
    "heat": Plant(
        "heat over charge",
        f"{_MODELS / 'warm_cell.py'}:WarmCell",
        {
            "resistance": 0.05,
            "heat_capacity": 40.0,
            "loss_rate": 0.15,
            "full_voltage": 4.1,
            "slope": 1e-4,
        },
        {"current": "A"},
        {"measured_rise": "K", "voltage": "V"},
        ((-2.5, 5.0),),
        2,
        _cell_rates,
        _cell_shown,
        step=4.0,
        slow=250.0,
        strengths=(1e-5, 4e-5),
        right=_pairs("heating loss rise_rate", "charge"),
    ),
    "product": _stage(
        "command times state", "product", (0.4, 1.2), _pairs(_FORCES, "position command")
    ),
    "hysteresis": _stage("hysteresis", "hysteresis", (0.5, 1.5), _pairs(_FORCES, "position")),
    "dead zone": _stage(
        "dead zone with unequal ends", "dead zone", (0.8, 2.0), _pairs("drive", "command")
    ),
}
