"""Five plants as plain functions, with places where a law may be different.

``rates(x, u, p, add)`` and ``outputs(x, u, p, add)`` are floats of states, inputs, parameters and
what is added at each place; a place has the name of the law of the model in ``models``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

Numbers = Mapping[str, float]
Floats = Sequence[float]
Function = Callable[[Floats, Floats, Numbers, Numbers], tuple[float, ...]]

_MODELS = Path(__file__).with_name("models")


@dataclass(frozen=True)
class Controller:
    """Proportional and integral controller, sampled, of one output by the first input.

    Attributes
    ----------
    output : int
    gain : float
        Of the error.
    integral : float
        Of its integral, 1/s.
    limit : float
        Of the input in both directions.
    low, high : float
        Of the reference.
    """

    output: int
    gain: float
    integral: float
    limit: float
    low: float
    high: float


@dataclass(frozen=True)
class Plant:
    """A plant that a model describes but for what is hidden.

    Attributes
    ----------
    name : str
        Of its model, in ``models``.
    states, inputs, outputs : tuple of str
    parameters : Mapping of str to float
        Nominal values, SI.
    rates, outputs_of : callable
    start : tuple of float
        States at rest.
    ranges : tuple of (float, float)
        Of the inputs.
    step : float
        Between samples, s.
    samples : int
    substeps : int
        Of a simulation, between samples.
    slow : float
        Its slowest time constant, s, by which stimuli are made.
    balances : tuple of frozenset of str
        Laws that an addition to does the same to the outputs but for its size.
    known : tuple of str
        Parameters that are known.
    controller : Controller or None
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: Numbers
    rates: Function
    outputs_of: Function
    start: tuple[float, ...]
    ranges: tuple[tuple[float, float], ...]
    step: float
    samples: int
    substeps: int
    slow: float
    balances: tuple[frozenset[str], ...]
    known: tuple[str, ...] = ()
    controller: Controller | None = None

    @property
    def model(self) -> str:
        """The model, as a command takes it."""
        return f"{_MODELS / self.name}.py:{self.name.capitalize()}"

    @property
    def text(self) -> str:
        """The file of the model."""
        return (_MODELS / f"{self.name}.py").read_text(encoding="utf-8")

    def alike(self, law: str) -> frozenset[str]:
        """Return the laws that act as one does."""
        return next(balance for balance in self.balances if law in balance)


def _spring(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    position, velocity = x
    push = u[0] + add["push"]
    elastic = p["stiffness"] * position + add["elastic"]
    friction = p["damping"] * velocity + add["friction"]
    return velocity, (push - elastic - friction) / p["mass"]


def _position(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    return (x[0],)


def _cell(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    return u[0], (u[0] - x[1]) / p["tau1"] + add["relaxed_rate"]


def _voltage(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    used = x[0] / 7200.0
    open_voltage = p["full"] - p["slope"] * used - p["bow"] * used**2 + add["open_voltage"]
    ohmic = p["R0"] * u[0] + add["ohmic"]
    return (open_voltage - ohmic - p["R1"] * x[1] - add["polarisation"],)


def _heated(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    warm, shown = x
    heating = u[0] + add["heating"]
    loss = p["still"] * warm + add["loss"]
    cooling = p["blown"] * u[1] * warm + add["cooling"]
    return (heating - loss - cooling) / p["capacity"], (warm - shown) / p["sensor_time"]


def _shown(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    return (x[1],)


def _tank(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    inflow = p["delivery"] * u[0] + add["inflow"]
    passed = p["passage"] * u[1] * math.sqrt(max(x[0], 1e-4)) + add["passed"]
    outflow = p["outlet"] * math.sqrt(max(x[1], 1e-4)) + add["outflow"]
    return (inflow - passed) / p["first_area"], (passed - outflow) / p["second_area"]


def _both(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    return x[0], x[1]


def _motor(x: Floats, u: Floats, p: Numbers, add: Numbers) -> tuple[float, ...]:
    current, speed = x
    supply = u[0] + add["supply"]
    ohmic = p["resistance"] * current + add["ohmic"]
    torque = p["constant"] * current + add["torque"]
    friction = p["damping"] * speed + add["friction"]
    electric = (supply - ohmic - p["constant"] * speed) / p["inductance"]
    return electric, (torque - friction) / p["inertia"]


PLANTS = (
    Plant(
        "spring",
        ("position", "velocity"),
        ("force",),
        ("place",),
        {"mass": 1.0, "stiffness": 20.0, "damping": 1.5},
        _spring,
        _position,
        (0.0, 0.0),
        ((-10.0, 10.0),),
        step=0.02,
        samples=1200,
        substeps=4,
        slow=1.4,
        balances=(frozenset({"push", "elastic", "friction", "acceleration"}),),
    ),
    Plant(
        "cell",
        ("drawn", "relaxed"),
        ("current",),
        ("voltage",),
        {"full": 4.1, "slope": 0.5, "bow": 0.2, "R0": 0.04, "R1": 0.02, "tau1": 60.0},
        _cell,
        _voltage,
        (0.0, 0.0),
        ((-2.5, 5.0),),
        step=4.0,
        samples=900,
        substeps=2,
        slow=120.0,
        balances=(
            frozenset({"open_voltage", "ohmic", "polarisation"}),
            frozenset({"relaxed_rate"}),
        ),
    ),
    Plant(
        "heated",
        ("warm", "shown"),
        ("power", "fan"),
        ("rise",),
        {"capacity": 60.0, "still": 0.3, "blown": 0.6, "sensor_time": 8.0},
        _heated,
        _shown,
        (0.0, 0.0),
        ((0.0, 20.0), (0.0, 1.0)),
        step=2.0,
        samples=900,
        substeps=2,
        slow=100.0,
        balances=(frozenset({"heating", "loss", "cooling", "warm_rate"}),),
    ),
    Plant(
        "tank",
        ("upper", "lower"),
        ("pump", "valve"),
        ("upper_level", "lower_level"),
        {
            "first_area": 0.05,
            "second_area": 0.04,
            "delivery": 0.002,
            "passage": 0.0025,
            "outlet": 0.0013,
        },
        _tank,
        _both,
        (0.6, 0.6),
        ((0.3, 0.8), (0.35, 0.9)),
        step=1.0,
        samples=900,
        substeps=2,
        slow=60.0,
        balances=(
            frozenset({"inflow", "upper_rate"}),
            frozenset({"passed"}),
            frozenset({"outflow", "lower_rate"}),
        ),
        known=("first_area",),
    ),
    Plant(
        "motor",
        ("current", "speed"),
        ("voltage",),
        ("measured_current", "measured_speed"),
        {
            "resistance": 1.2,
            "inductance": 0.03,
            "constant": 0.08,
            "inertia": 0.002,
            "damping": 0.002,
        },
        _motor,
        _both,
        (0.0, 0.0),
        ((-12.0, 12.0),),
        step=0.005,
        samples=1200,
        substeps=2,
        slow=0.3,
        balances=(
            frozenset({"supply", "ohmic", "induced", "current_rate"}),
            frozenset({"torque", "friction", "speed_rate"}),
        ),
        controller=Controller(1, 0.15, 1.5, 24.0, -80.0, 80.0),
    ),
)
