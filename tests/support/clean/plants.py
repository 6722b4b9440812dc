"""What records are drawn of: equations from textbooks and the thesis, written as state matrices.

A plant states its nominal parameters under the names that the model under test gives them, and where its states start
at rest; `spread` says how far, in the logarithm, a specimen may be from nominal.
"""

from __future__ import annotations

from math import pi, sin
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.support.clean.foot import Foot
from tests.support.clean.plant import Loop, Plant, Range
from tests.support.clean.simulation import Matrices, Values

Array = NDArray[np.float64]
_MODELS = Path(__file__).with_name("models")


_FILM = {
    "R1": 0.43,
    "R2": 2.35,
    "C": 2.7,
    "alpha": 6.8e-5,
    "k1": 6300.0,
    "b1": 1.7e6,
    "k2": 1.0e4,
    "b2": 2.0e6,
}
_VOLTAGE_LOOP = Loop("voltage", "current", 0.4, 0.4, 0.7)


class Actuator(Plant):
    """Films as a leaking capacitor behind a resistor; a Burgers body in series with what the charge elongates.

    The current divides between the leakage R2, over which the terminal voltage V stands, and the films, which take
    I = (V - Q/C) / R1; with i = I + V / R2 that gives I = (R2 i - Q/C) / (R1 + R2). The loop in position moves the
    current.
    """

    model = "ppy_actuator"
    nominal = _FILM
    states = ("charge", "kelvin_elongation", "maxwell_elongation")
    inputs = {"current": Range("A", 0.0, 1.0), "force": Range("N", 1.5, 1.0)}
    outputs = {"voltage": "V", "displacement": "m"}
    rate, duration, period = 10.0, 300.0, 5.0
    loops = {
        "voltage": _VOLTAGE_LOOP,
        "position": Loop("displacement", "current", 3000.0, 300.0, 1e-4),
    }

    def matrices(self, p: Values) -> Matrices:
        """Charge, creep and flow."""
        both = p["R1"] + p["R2"]
        a = np.diag([-1.0 / (both * p["C"]), -p["k2"] / p["b2"], 0.0])
        b = np.array([[p["R2"] / both, 0.0], [0.0, 1.0 / p["b2"]], [0.0, 1.0 / p["b1"]]])
        share = p["R2"] / both
        c = np.array([[share / p["C"], 0.0, 0.0], [p["alpha"], 1.0, 1.0]])
        return a, b, c, np.array([[share * p["R1"], 0.0], [0.0, 1.0 / p["k1"]]])


class ActuatorByLength(Plant):
    """The same films, held at a length: the spring k1 takes what charge, creep and flow leave of it.

    Always taut, for which ten minutes are too long: what flows leaves the films slack.
    """

    model = "ppy_actuator_length_driven"
    nominal = _FILM
    states = Actuator.states
    inputs = {"current": Range("A", 0.0, 0.3), "length_change": Range("m", 1.5e-3, 2e-4)}
    outputs = {"voltage": "V", "tension": "N"}
    rate, duration, period = 10.0, 240.0, 5.0
    timings = ("usual", "one minute")
    loops = {"voltage": Loop("voltage", "current", 0.4, 0.4, 0.2)}

    def matrices(self, p: Values) -> Matrices:
        """The tension k1 (L - alpha Q - x_k - x_m) drives creep and flow."""
        both = p["R1"] + p["R2"]
        share = p["R2"] / both
        pull = -p["k1"] * np.array([p["alpha"], 1.0, 1.0])
        a = np.array(
            [
                [-1.0 / (both * p["C"]), 0.0, 0.0],
                (pull - np.array([0.0, p["k2"], 0.0])) / p["b2"],
                pull / p["b1"],
            ]
        )
        b = np.array([[share, 0.0], [0.0, p["k1"] / p["b2"]], [0.0, p["k1"] / p["b1"]]])
        return (
            a,
            b,
            np.array([[share / p["C"], 0.0, 0.0], pull]),
            np.diag([share * p["R1"], p["k1"]]),
        )


class Galvanostat(Plant):
    """A limited current behind a lag, into a resistance of 2 ohm whose voltage is recorded."""

    model = "galvanostat"
    nominal = {"current_limit": 1.3, "response_time": 0.3}
    states = ("lagged_current",)
    inputs = {"current_command": Range("A", 0.0, 1.8), "voltage": Range("V", 0.0, 0.0)}
    outputs = {"current": "A"}
    settings = {"response_time": 0.3}
    rate, duration, period = 20.0, 100.0, 1.5
    timings = ("usual", "one minute")

    def matrices(self, p: Values) -> Matrices:
        """First order."""
        lag = 1.0 / p["response_time"]
        return np.array([[-lag]]), np.array([[lag, 0.0]]), np.array([[1.0]]), np.zeros((1, 2))

    def static(self, p: Values, u: Array) -> Array:
        """Limit the command."""
        return np.stack([np.clip(u[0], -p["current_limit"], p["current_limit"]), u[1]])

    def reaction(self, p: Values, u: Array, x: Array) -> Array:
        """Ohm's law."""
        return np.array([u[0], 2.0 * x[0]])


_SAMPLE = 300.0, 1.0  # N/m and N*s/m of what the coil pulls on


class VoiceCoil(Plant):
    """A coil pulls a heavy mass on a damped slide against a spring, whose tension is recorded; the loop is open."""

    model = "voice_coil_dma"
    nominal = {"R": 3.0, "L": 1e-3, "K": 3.9, "m": 0.3, "b_vc": 6.0, "position_cutoff": 100.0}
    states = ("coil_current", "position", "velocity", "position_filtered")
    inputs = {"force_reference": Range("N", 2.6, 1.9), "tension": Range("N", 0.0, 0.0)}
    outputs = {"coil_current": "A", "position_measured": "m"}
    settings = {"controller_on": 0.0, "m": 0.3}
    continuous, sampled = ("tension",), ("force_reference",)
    rate, duration, period = 500.0, 8.0, 0.1
    timings = ("usual",)

    def matrices(self, p: Values) -> Matrices:
        """Coil, slide and first-order filter."""
        cut = 2.0 * pi * p["position_cutoff"]
        a = np.array(
            [
                [-p["R"] / p["L"], 0.0, -p["K"] / p["L"], 0.0],
                [0.0, 0.0, 1.0, 0.0],
                [p["K"] / p["m"], 0.0, -p["b_vc"] / p["m"], 0.0],
                [0.0, cut, 0.0, -cut],
            ]
        )
        b = np.array([[1.0 / p["L"], 0.0], [0.0, 0.0], [0.0, -1.0 / p["m"]], [0.0, 0.0]])
        return a, b, np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]), np.zeros((2, 2))

    def drawn(self, p: Values) -> Matrices:
        """The tension is a force of position and velocity, and no input."""
        a, b, c, d = self.matrices(p)
        a = a + np.outer(b[:, 1], [0.0, *_SAMPLE, 0.0])
        return a, b * np.array([1.0, 0.0]), c, d

    def reaction(self, p: Values, u: Array, x: Array) -> Array:
        """What the load cell shows."""
        return np.array([u[0], _SAMPLE[0] * x[1] + _SAMPLE[1] * x[2]])


class Motor(Plant):
    """A DC motor without inductance: i = (u - K w) / R, J dw/dt = K i - d w - load."""

    model = f"{_MODELS / 'motor.py'}:Motor"
    nominal = {"resistance": 2.0, "constant": 0.05, "inertia": 5e-4, "damping": 1e-4}
    states = ("omega",)
    inputs = {"voltage": Range("V", 0.0, 10.0), "load": Range("N*m", 0.0, 0.05)}
    outputs = {"current": "A", "speed": "rad/s"}
    rate, duration, period = 50.0, 60.0, 0.6
    timings = ("usual", "one minute", "long")
    loops = {"speed": Loop("speed", "voltage", 0.05, 0.2, 80.0)}

    def matrices(self, p: Values) -> Matrices:
        """First order in the speed."""
        k, r, j = p["constant"], p["resistance"], p["inertia"]
        a = np.array([[-(k * k / r + p["damping"]) / j]])
        b = np.array([[k / (r * j), -1.0 / j]])
        return a, b, np.array([[-k / r], [1.0]]), np.array([[1.0 / r, 0.0], [0.0, 0.0]])


class Pendulum(Plant):
    """J ddtheta/dt = tau - W sin(theta) - d dtheta/dt."""

    model = f"{_MODELS / 'pendulum.py'}:Pendulum"
    nominal = {"inertia": 0.5, "weight": 5.0, "damping": 0.4}
    states = ("angle", "velocity")
    inputs = {"torque": Range("N*m", 0.0, 1.2)}
    outputs = {"position": "rad"}
    rate, duration, period = 20.0, 60.0, 1.5
    timings = ("usual", "one minute")
    loops = {"position": Loop("position", "torque", 0.0, 0.8, 0.3)}

    def matrices(self, p: Values) -> None:
        """There are none."""

    def rates(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Newton's second law."""
        return [x[1], (u[0] - p["weight"] * sin(x[0]) - p["damping"] * x[1]) / p["inertia"]]

    def shown(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """The angle."""
        return [x[0]]


class ThermalNodes(Plant):
    """A heater on one heat capacity, which passes its heat to another, and that to the surroundings."""

    model = f"{_MODELS / 'thermal_nodes.py'}:ThermalNodes"
    nominal = {"C1": 40.0, "C2": 200.0, "R12": 1.5, "R2": 1.0}
    states = ("inner", "outer")
    starts = {"inner": 293.0, "outer": 293.0}
    inputs = {"power": Range("W", 8.0, 6.0), "ambient": Range("K", 293.0, 3.0)}
    outputs = {"inner_temperature": "K", "outer_temperature": "K"}
    rate, duration, period = 1.0, 3000.0, 60.0
    timings = ("usual", "long")
    loops = {"temperature": Loop("inner_temperature", "power", 0.5, 0.01, 5.0)}

    def matrices(self, p: Values) -> Matrices:
        """Two balances of heat."""
        c1, c2, between, out = p["C1"], p["C2"], 1.0 / p["R12"], 1.0 / p["R2"]
        a = np.array([[-between / c1, between / c1], [between / c2, -(between + out) / c2]])
        return a, np.array([[1.0 / c1, 0.0], [0.0, out / c2]]), np.eye(2), np.zeros((2, 2))


class Cell(Plant):
    """An open-circuit voltage, less what a resistance and one RC pair take."""

    model = f"{_MODELS / 'cell.py'}:Cell"
    nominal = {"ocv": 3.3, "R0": 0.03, "R1": 0.02, "tau1": 20.0}
    slight = {"ocv": 0.02}
    states = ("relaxed",)
    inputs = {"current": Range("A", 0.0, 2.0)}
    outputs = {"voltage": "V"}
    rate, duration, period = 2.0, 600.0, 15.0
    loops = {"voltage": Loop("voltage", "current", 0.0, -5.0, 0.05)}

    def matrices(self, p: Values) -> Matrices:
        """Current through the resistance of the pair."""
        a, b = np.array([[-1.0 / p["tau1"]]]), np.array([[1.0 / p["tau1"]]])
        return a, b, np.array([[-p["R1"]]]), np.array([[-p["R0"]]])

    def bias(self, p: Values) -> Array:
        """Open circuit."""
        return np.array([p["ocv"]])


PLANTS: dict[str, Plant] = {
    plant.name: plant
    for plant in (
        Actuator(),
        ActuatorByLength(),
        Galvanostat(),
        VoiceCoil(),
        Motor(),
        Pendulum(),
        ThermalNodes(),
        Cell(),
        Foot(),
    )
}
ON_REQUEST = ("Foot",)  # what takes a minute or more to diagnose is drawn by name only
DRAWN = tuple(name for name in PLANTS if name not in ON_REQUEST)
