"""All plants: laws from textbooks and the thesis.

A plant states its nominal parameters under the names that the model under test gives them, and
where its states start at rest. Names of laws and signals are those of the models under test, so
that an answer can be compared.
"""

from __future__ import annotations

from math import pi, sin
from pathlib import Path

import numpy as np

from fmus.kit.arrays import Array
from studies.plants.book import BOOK
from studies.plants.change import Change
from studies.plants.foot import FINEST_STEP, Foot
from studies.plants.plant import Loop, Plant, Range, Signals
from studies.plants.simulation import Values

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
_FILM_STATES = ("charge", "kelvin_elongation", "maxwell_elongation")
_VOLTAGE_LOOP = Loop("voltage", "current", 0.4, 0.4, 0.7)
_SPRING = 300.0  # N/m of what the coil pulls on
_DAMPER = 1.0  # N*s/m of the same
_OHM = 2.0  # of what the galvanostat drives its current through


class Actuator(Plant):
    """Films as a leaking capacitor behind a resistor; a Burgers body behind their elongation.

    The current divides between the leakage R2, over which the terminal voltage V stands, and the
    films, which take I = (V - Q/C) / R1; with i = I + V / R2 that gives I = (R2 i - Q/C) / (R1 +
    R2). The loop in position moves the current.
    """

    model = "ppy_actuator"
    nominal = _FILM
    own_states = _FILM_STATES
    inputs = {"current": Range("A", 0.0, 1.0), "force": Range("N", 1.5, 1.0)}
    outputs = {"voltage": "V", "displacement": "m"}
    shown_by = ("voltage", "displacement")
    rate = 10.0
    duration = 300.0
    period = 5.0
    coarsest = 0.1
    loops = {
        "voltage": _VOLTAGE_LOOP,
        "position": Loop("displacement", "current", 3000.0, 300.0, 1e-4),
    }

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the circuit, then the chain."""
        k = {"current": u[0], "force": u[1], "load": u[1]}
        k |= {"charge": x[0], "kelvin_elongation": x[1], "maxwell_elongation": x[2]}
        supply = self.law("supply_current", u[0], k, x)
        capacitance = self.law("capacitance", p["C"], k, x)
        film_voltage = self.law("film_voltage", x[0] / capacitance, k, x)
        films = self.law("capacitor_voltage", film_voltage, k, x)
        series = self.law("series_resistance", p["R1"], k, x)
        share = (p["R2"] * supply - films) / (series + p["R2"])
        current = self.law("capacitor_current", share, k, x)
        k["voltage"] = self.law("terminal_voltage", series * current + films, k, x)
        by_charge = self.law("charge_elongation", p["alpha"] * x[0], k, x)
        spring_force = self.law("kelvin_force", p["k2"] * x[1], k, x)
        self.law("kelvin_rate", (u[1] - spring_force) / p["b2"], k, x)
        self.law("maxwell_rate", self.law("flow_force", u[1], k, x) / p["b1"], k, x)
        creep = self.law("creep", x[1] + x[2], k, x)
        spring = self.law("spring_elongation", u[1] / p["k1"], k, x)
        k["displacement"] = by_charge + self.law("chain_elongation", creep + spring, k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return derivatives of charge, creep and flow."""
        return [k["capacitor_current"], k["kelvin_rate"], k["maxwell_rate"]]

    def equivalents(self, p: Values) -> list[dict[str, float]]:
        """Group currents, voltages of the films, resistances, elongations, creep, flow."""
        elongations = (
            "charge_elongation",
            "creep",
            "spring_elongation",
            "chain_elongation",
            "displacement",
            "mechanical_displacement",
            "electrochemical_displacement",
        )
        return [
            {"capacitor_current": 1.0, "supply_current": (p["R1"] + p["R2"]) / p["R2"]},
            {"film_voltage": 1.0, "capacitor_voltage": 1.0},
            {"series_resistance": 1.0, "immediate_resistance": 1.0},
            {"kelvin_rate": 1.0, "kelvin_force": -p["b2"]},
            {"maxwell_rate": 1.0, "flow_force": p["b1"]},
            dict.fromkeys(elongations, 1.0),
        ]


class ActuatorByLength(Plant):
    """The same films held at a length: spring k1 takes what charge, creep and flow leave.

    Always taut, for which ten minutes are too long: what flows leaves the films slack.
    """

    model = "ppy_actuator_length_driven"
    nominal = _FILM
    own_states = _FILM_STATES
    inputs = {"current": Range("A", 0.0, 0.3), "length_change": Range("m", 1.5e-3, 2e-4)}
    outputs = {"voltage": "V", "tension": "N"}
    shown_by = ("voltage", "tension")
    rate = 10.0
    duration = 240.0
    period = 5.0
    timings = ("usual", "one minute")
    loops = {"voltage": Loop("voltage", "current", 0.4, 0.4, 0.2)}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the circuit; the tension drives creep and flow."""
        k = {"current": u[0], "length_change": u[1]}
        k |= {"charge": x[0], "kelvin_elongation": x[1], "maxwell_elongation": x[2]}
        films = x[0] / p["C"]
        current = self.law(
            "capacitor_current", (p["R2"] * u[0] - films) / (p["R1"] + p["R2"]), k, x
        )
        k["voltage"] = p["R1"] * current + films
        stretch = u[1] - p["alpha"] * x[0] - x[1] - x[2]
        tension = self.law("tension", p["k1"] * stretch, k, x)
        self.law("kelvin_rate", (tension - p["k2"] * x[1]) / p["b2"], k, x)
        self.law("maxwell_rate", tension / p["b1"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return derivatives of charge, creep and flow."""
        return [k["capacitor_current"], k["kelvin_rate"], k["maxwell_rate"]]


class Galvanostat(Plant):
    """A limited current behind a lag, into a resistance whose voltage is recorded."""

    model = "galvanostat"
    nominal = {"current_limit": 1.3, "response_time": 0.3}
    own_states = ("lagged_current",)
    inputs = {"current_command": Range("A", 0.0, 1.8), "voltage": Range("V", 0.0, 0.0)}
    outputs = {"current": "A"}
    shown_by = ("lagged_current",)
    settings = {"response_time": 0.3}
    rate = 20.0
    duration = 100.0
    period = 1.5
    timings = ("usual", "one minute")

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the first order behind the limit."""
        k = {"lagged_current": x[0], "voltage": u[1]}
        command = self.law("current_command", u[0], k, x)
        limit = p["current_limit"]
        limited = min(max(command, -limit), limit)
        self.law("current_rate", (limited - x[0]) / p["response_time"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return the derivative of the current."""
        return [k["current_rate"]]

    def static(self, p: Values, u: Array) -> Array:
        """Limit the command, unless a change comes before what limits it."""
        if self.changes:
            return u
        return np.stack([np.clip(u[0], -p["current_limit"], p["current_limit"]), u[1]])

    def reaction(self, p: Values, u: Array, x: Array) -> Array:
        """Apply Ohm's law."""
        return np.array([u[0], _OHM * x[0]])


class VoiceCoil(Plant):
    """A coil pulls a heavy mass on a damped slide against a spring; the loop is open.

    The tension of the spring is recorded.
    """

    model = "voice_coil_dma"
    nominal = {"R": 3.0, "L": 1e-3, "K": 3.9, "m": 0.3, "b_vc": 6.0, "position_cutoff": 100.0}
    own_states = ("coil_current", "position", "velocity", "position_filtered")
    inputs = {"force_reference": Range("N", 2.6, 1.9), "tension": Range("N", 0.0, 0.0)}
    outputs = {"coil_current": "A", "position_measured": "m"}
    shown_by = ("coil_current", "position_filtered")
    settings = {"controller_on": 0.0, "m": 0.3}
    continuous = ("tension",)
    sampled = ("force_reference",)
    rate = 500.0
    duration = 8.0
    period = 0.1
    timings = ("usual",)
    coarsest = 2e-4
    aliases = {
        "friction": "slide_friction + velocity",
        "stop": "slide_friction + position",
        "force_constant": "force_constant x position",
        "resistance": "coil_resistance + coil_current",
    }

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate circuit, slide and filter."""
        current, position, velocity, filtered = x[:4]
        k = {"coil_current": current, "position": position, "velocity": velocity}
        k |= {"position_filtered": filtered, "position_rate": velocity}
        k["position_measured"] = filtered
        k["tension"] = u[1] if self.free else _SPRING * position + _DAMPER * velocity
        fed = self.law("force_reference", u[0], k, x)
        resistance = self.law("coil_resistance", p["R"], k, x)
        constant = self.law("force_constant", p["K"], k, x)
        self.law("current_rate", (fed - resistance * current - constant * velocity) / p["L"], k, x)
        force = self.law("coil_force", constant * current, k, x)
        friction = self.law("slide_friction", p["b_vc"] * velocity, k, x)
        self.law("velocity_rate", (force - friction - k["tension"]) / p["m"], k, x)
        cutoff = 2.0 * pi * p["position_cutoff"]
        self.law("position_filter_rate", cutoff * (position - filtered), k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return derivatives by circuit, definition, momentum and filter."""
        return [k["current_rate"], k["velocity"], k["velocity_rate"], k["position_filter_rate"]]

    def equivalents(self, p: Values) -> list[dict[str, float]]:
        """Group forces on the slide and voltages of the coil."""
        return [
            {"slide_friction": 1.0, "coil_force": -1.0, "velocity_rate": -1.0 / p["m"]},
            {"drive_voltage": 1.0, "current_rate": 1.0 / p["L"]},
        ]

    def reaction(self, p: Values, u: Array, x: Array) -> Array:
        """Return what the load cell shows."""
        return np.array([u[0], _SPRING * x[1] + _DAMPER * x[2]])


class Motor(Plant):
    """A DC motor without inductance: i = (u - K w) / R, J dw/dt = K i - friction - load."""

    model = f"{_MODELS / 'motor.py'}:Motor"
    nominal = {"resistance": 2.0, "constant": 0.05, "inertia": 5e-4, "damping": 1e-4}
    own_states = ("omega",)
    inputs = {"voltage": Range("V", 0.0, 10.0), "load": Range("N*m", 0.0, 0.05)}
    outputs = {"current": "A", "speed": "rad/s"}
    shown_by = ("winding_current", "omega")
    rate = 50.0
    duration = 60.0
    period = 0.6
    timings = ("usual", "one minute", "long")
    loops = {"speed": Loop("speed", "voltage", 0.05, 0.2, 80.0)}
    aliases = {"friction": "friction + omega"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate current, friction and acceleration."""
        k = {"load": u[1], "omega": x[0], "speed": x[0]}
        voltage = self.law("voltage", u[0], k, x)
        induced = p["constant"] * x[0]
        current = self.law("winding_current", (voltage - induced) / p["resistance"], k, x)
        k["current"] = current
        friction = self.law("friction", p["damping"] * x[0], k, x)
        self.law("acceleration", (p["constant"] * current - friction - u[1]) / p["inertia"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Balance the torques."""
        return [k["acceleration"]]

    def equivalents(self, p: Values) -> list[dict[str, float]]:
        """Group the torques."""
        return [{"friction": 1.0, "acceleration": -1.0 / p["inertia"]}]


class Pendulum(Plant):
    """J ddtheta/dt = tau - W sin(theta) - friction."""

    model = f"{_MODELS / 'pendulum.py'}:Pendulum"
    nominal = {"inertia": 0.5, "weight": 5.0, "damping": 0.4}
    own_states = ("angle", "velocity")
    inputs = {"torque": Range("N*m", 0.0, 1.2)}
    outputs = {"position": "rad"}
    shown_by = ("angle",)
    rate = 20.0
    duration = 60.0
    period = 1.5
    timings = ("usual", "one minute")
    loops = {"position": Loop("position", "torque", 0.0, 0.8, 0.3)}
    linear = False
    aliases = {"friction": "friction + velocity", "gravity": "gravity + angle"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate friction, gravity and acceleration."""
        k = {"angle": x[0], "velocity": x[1], "position": x[0], "angle_rate": x[1]}
        torque = self.law("torque", u[0], k, x)
        friction = self.law("friction", p["damping"] * x[1], k, x)
        gravity = self.law("gravity", p["weight"] * sin(x[0]), k, x)
        self.law("acceleration", (torque - gravity - friction) / p["inertia"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Apply Newton's second law."""
        return [k["velocity"], k["acceleration"]]

    def equivalents(self, p: Values) -> list[dict[str, float]]:
        """Group the torques."""
        return [{"friction": 1.0, "gravity": 1.0, "acceleration": -1.0 / p["inertia"]}]


class ThermalNodes(Plant):
    """A heater on a heat capacity, which passes its heat to another, and that to the air."""

    model = f"{_MODELS / 'thermal_nodes.py'}:ThermalNodes"
    nominal = {"C1": 40.0, "C2": 200.0, "R12": 1.5, "R2": 1.0}
    own_states = ("inner", "outer")
    starts = {"inner": 293.0, "outer": 293.0}
    inputs = {"power": Range("W", 8.0, 6.0), "ambient": Range("K", 293.0, 3.0)}
    outputs = {"inner_temperature": "K", "outer_temperature": "K"}
    shown_by = ("inner", "outer")
    rate = 1.0
    duration = 3000.0
    period = 60.0
    timings = ("usual", "long")
    loops = {"temperature": Loop("inner_temperature", "power", 0.5, 0.01, 5.0)}
    coarsest = 0.5
    aliases = {
        "conduction": "conduction + _conduction_drop",
        "loss": "loss + _loss_drop",
        "inner": "_inner_heat + inner",
        "outer": "_outer_heat + outer",
    }

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate flows of heat; what is stored beside the capacities is a flow, too."""
        inner, outer = x[:2]
        k = {"ambient": u[1], "inner": inner, "outer": outer}
        k |= {"inner_temperature": inner, "outer_temperature": outer}
        k |= {"_conduction_drop": inner - outer, "_loss_drop": outer - u[1]}
        power = self.law("power", u[0], k, x)
        conduction = self.law("conduction", (inner - outer) / p["R12"], k, x)
        loss = self.law("loss", (outer - u[1]) / p["R2"], k, x)
        inner_heat = self.law("_inner_heat", 0.0, k, x)
        outer_heat = self.law("_outer_heat", 0.0, k, x)
        self.law("inner_rate", (power - conduction - inner_heat) / p["C1"], k, x)
        self.law("outer_rate", (conduction - loss - outer_heat) / p["C2"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return the heat that comes less the heat that goes."""
        return [k["inner_rate"], k["outer_rate"]]

    def settled(self, p: Values) -> list[float]:
        """Return the temperature of the surroundings."""
        return [293.0, 293.0]

    def equivalents(self, p: Values) -> list[dict[str, float]]:
        """Group what the outer node loses."""
        return [{"loss": 1.0, "outer_rate": -1.0 / p["C2"]}]


class Cell(Plant):
    """An open-circuit voltage, less what a resistance and one RC pair take."""

    model = f"{_MODELS / 'cell.py'}:Cell"
    nominal = {"ocv": 3.3, "R0": 0.03, "R1": 0.02, "tau1": 20.0}
    slight = {"ocv": 0.02}
    own_states = ("relaxed",)
    inputs = {"current": Range("A", 0.0, 2.0)}
    outputs = {"voltage": "V"}
    shown_by = ("voltage",)
    rate = 2.0
    duration = 600.0
    period = 15.0
    loops = {"voltage": Loop("voltage", "current", 0.0, -5.0, 0.05)}
    coarsest = 0.25
    aliases = {"drop": "drop + current"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the voltage that is lost, and the one that remains."""
        k = {"current": u[0], "relaxed": x[0]}
        self.law("relaxed_rate", (u[0] - x[0]) / p["tau1"], k, x)
        drop = self.law("drop", p["R0"] * u[0] + p["R1"] * x[0], k, x)
        self.law("voltage", p["ocv"] - drop, k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return the current through the resistance of the pair."""
        return [k["relaxed_rate"]]

    def settled(self, p: Values) -> list[float]:
        """Return the open-circuit voltage."""
        return [p["ocv"]]

    def equivalents(self, p: Values) -> list[dict[str, float]]:
        """Group the voltages."""
        return [{"drop": 1.0, "voltage": -1.0}]


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
        Foot(finest=FINEST_STEP),
        *BOOK,
    )
}
ON_REQUEST = ("Foot",)  # what takes a minute or more to diagnose is drawn by name only
BY_THE_BOOK = tuple(plant.name for plant in BOOK)  # which have a study of their own
DRAWN = tuple(name for name in PLANTS if name not in (*ON_REQUEST, *BY_THE_BOOK))


def altered(name: str, *changes: Change) -> Plant:
    """Make a plant with changes hidden in it, each at a place of its own."""
    return PLANTS[name].with_hidden(*changes)
