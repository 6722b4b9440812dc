"""The clean plants once more, with every law by its name, so that any of them may hang on any signal.

A law is a number; what is hidden in it is added to it or multiplied with it. Names of laws and signals are those that
the models under test have, so that an answer can be compared; the equations are those of the clean plants.
"""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from math import pi, sin
from typing import ClassVar

from tests.support.clean.plants import (
    PLANTS,
    Actuator,
    Cell,
    Motor,
    Pendulum,
    ThermalNodes,
    VoiceCoil,
)
from tests.support.clean.simulation import Values
from tests.support.hidden.change import Change
from tests.support.hidden.plants import Altered, AlteredVoiceCoil
from tests.support.hidden_laws.place import Place

Signals = dict[str, float]
OWN = "without"  # signal: of a law that hangs on itself, what it is without
_SPRING, _DAMPER = 300.0, 1.0  # N/m and N*s/m of what the coil pulls on, as in the clean plant


class Lawful(Altered):
    """A plant whose laws may each hang on any signal."""

    shown_by: ClassVar[tuple[str, ...]]  # signal of each output

    @abstractmethod
    def evaluated(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Inputs, states, and laws with what is hidden in them."""

    @abstractmethod
    def same(self, p: Values) -> list[dict[str, float]]:
        """Laws to which something may be added with the same consequences, and how much of it is added there."""

    @abstractmethod
    def changing(self, k: Signals) -> list[float]:
        """Derivatives of the plant's own states."""

    @cached_property
    def places(self) -> dict[str, list[tuple[Place, str]]]:
        """What is hidden, by law."""
        found: dict[str, list[tuple[Place, str]]] = {}
        for text in self.hidden:
            place = Place.of(text)
            found.setdefault(place.law, []).append((place, text))
        return found

    def law(self, name: str, value: float, k: Signals, x: list[float]) -> float:
        """Put a law among the signals, with what is hidden in it."""
        for place, text in self.places.get(name, ()):
            if place.signal == name:
                k[OWN] = value
            more = self.more(text, value if place.signal == name else k.get(place.signal, 0.0), x)
            value = value + more if place.kind == "add" else value * (1.0 + more)
        k[name] = value
        return value

    def equals(self, law: str, p: Values) -> dict[str, float]:
        """Laws that do the same as this one does when something is added, by how much is added there for 1 here."""
        group = next((g for g in self.same(p) if law in g), {law: 1.0})
        return {name: amount / group[law] for name, amount in group.items()}

    def signals(self, x: list[float], u: list[float]) -> Signals:
        """Changes hang on what `evaluated` tells, for which parameters are needed."""
        return {}

    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Derivatives of the plant's own states."""
        return self.changing(self.evaluated(x, u, p))

    def rates(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Laws, and what changes remember."""
        k = self.evaluated(x, u, p)
        rates = self.changing(k)
        for text, (change, memory) in self.hidden.items():
            if change.rest:
                rates = rates + change.rates(k.get(Place.of(text).signal, 0.0), x[memory])
        return rates

    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Outputs."""
        k = self.evaluated(x, u, p)
        return [k[name] for name in self.shown_by]


class LawfulMotor(Lawful, Motor):
    """i = (u - K w) / R, J dw/dt = K i - friction - load."""

    shown_by = ("winding_current", "omega")

    def evaluated(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Current, friction, acceleration."""
        k = {"voltage": u[0], "load": u[1], "omega": x[0], "speed": x[0]}
        current = self.law("winding_current", (u[0] - p["constant"] * x[0]) / p["resistance"], k, x)
        k["current"] = current
        friction = self.law("friction", p["damping"] * x[0], k, x)
        self.law("acceleration", (p["constant"] * current - friction - u[1]) / p["inertia"], k, x)
        return k

    def changing(self, k: Signals) -> list[float]:
        """Balance of torques."""
        return [k["acceleration"]]

    def same(self, p: Values) -> list[dict[str, float]]:
        """Torques."""
        return [{"friction": 1.0, "acceleration": -1.0 / p["inertia"]}]


class LawfulPendulum(Lawful, Pendulum):
    """J ddtheta/dt = tau - W sin(theta) - friction."""

    shown_by = ("angle",)

    def evaluated(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Friction, gravity, acceleration."""
        k = {"torque": u[0], "angle": x[0], "velocity": x[1], "position": x[0], "angle_rate": x[1]}
        friction = self.law("friction", p["damping"] * x[1], k, x)
        gravity = self.law("gravity", p["weight"] * sin(x[0]), k, x)
        self.law("acceleration", (u[0] - gravity - friction) / p["inertia"], k, x)
        return k

    def changing(self, k: Signals) -> list[float]:
        """Newton's second law."""
        return [k["velocity"], k["acceleration"]]

    def same(self, p: Values) -> list[dict[str, float]]:
        """Torques."""
        return [{"friction": 1.0, "gravity": 1.0, "acceleration": -1.0 / p["inertia"]}]


class LawfulThermalNodes(Lawful, ThermalNodes):
    """Two balances of heat."""

    shown_by = ("inner", "outer")

    def evaluated(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Flows of heat."""
        k = {"power": u[0], "ambient": u[1], "inner": x[0], "outer": x[1]}
        k |= {"inner_temperature": x[0], "outer_temperature": x[1]}
        conduction = self.law("conduction", (x[0] - x[1]) / p["R12"], k, x)
        loss = self.law("loss", (x[1] - u[1]) / p["R2"], k, x)
        self.law("inner_rate", (u[0] - conduction) / p["C1"], k, x)
        self.law("outer_rate", (conduction - loss) / p["C2"], k, x)
        return k

    def changing(self, k: Signals) -> list[float]:
        """Heat that comes less heat that goes."""
        return [k["inner_rate"], k["outer_rate"]]

    def same(self, p: Values) -> list[dict[str, float]]:
        """What the outer node loses."""
        return [{"loss": 1.0, "outer_rate": -1.0 / p["C2"]}]


class LawfulCell(Lawful, Cell):
    """Open-circuit voltage less what is lost."""

    shown_by = ("voltage",)

    def evaluated(self, x: list[float], u: list[float], p: Values) -> Signals:
        """What is lost, and what is left."""
        k = {"current": u[0], "relaxed": x[0]}
        self.law("relaxed_rate", (u[0] - x[0]) / p["tau1"], k, x)
        drop = self.law("drop", p["R0"] * u[0] + p["R1"] * x[0], k, x)
        self.law("voltage", p["ocv"] - drop, k, x)
        return k

    def changing(self, k: Signals) -> list[float]:
        """The pair."""
        return [k["relaxed_rate"]]

    def same(self, p: Values) -> list[dict[str, float]]:
        """Voltages."""
        return [{"drop": 1.0, "voltage": -1.0}]


class LawfulActuator(Lawful, Actuator):
    """Films behind a resistance, with a leakage beside them; a Burgers body behind what the charge elongates."""

    shown_by = ("voltage", "displacement")
    finest = 0.1

    def evaluated(self, x: list[float], u: list[float], p: Values) -> Signals:
        """The circuit, then the chain."""
        k = {"current": u[0], "force": u[1], "load": u[1]}
        k |= {"charge": x[0], "kelvin_elongation": x[1], "maxwell_elongation": x[2]}
        supply = self.law("supply_current", u[0], k, x)
        capacitance = self.law("capacitance", p["C"], k, x)
        films = self.law(
            "capacitor_voltage", self.law("film_voltage", x[0] / capacitance, k, x), k, x
        )
        series = self.law("series_resistance", p["R1"], k, x)
        current = self.law(
            "capacitor_current", (p["R2"] * supply - films) / (series + p["R2"]), k, x
        )
        k["voltage"] = self.law("terminal_voltage", series * current + films, k, x)
        by_charge = self.law("charge_elongation", p["alpha"] * x[0], k, x)
        self.law(
            "kelvin_rate", (u[1] - self.law("kelvin_force", p["k2"] * x[1], k, x)) / p["b2"], k, x
        )
        self.law("maxwell_rate", self.law("flow_force", u[1], k, x) / p["b1"], k, x)
        creep = self.law("creep", x[1] + x[2], k, x)
        spring = self.law("spring_elongation", u[1] / p["k1"], k, x)
        k["displacement"] = by_charge + self.law("chain_elongation", creep + spring, k, x)
        return k

    def changing(self, k: Signals) -> list[float]:
        """Charge, creep and flow."""
        return [k["capacitor_current"], k["kelvin_rate"], k["maxwell_rate"]]

    def same(self, p: Values) -> list[dict[str, float]]:
        """Currents, voltages of the films, resistances, elongations, creep, flow."""
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


class LawfulVoiceCoil(Lawful, VoiceCoil):
    """Coil, slide, spring and filter."""

    shown_by = ("coil_current", "position_filtered")
    finest = AlteredVoiceCoil.finest

    def evaluated(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Circuit, slide, filter."""
        current, position, velocity, filtered = x[:4]
        k = {
            "force_reference": u[0],
            "coil_current": current,
            "position": position,
            "velocity": velocity,
        }
        k |= {
            "position_filtered": filtered,
            "position_rate": velocity,
            "position_measured": filtered,
        }
        k["tension"] = _SPRING * position + _DAMPER * velocity
        resistance = self.law("coil_resistance", p["R"], k, x)
        constant = self.law("force_constant", p["K"], k, x)
        self.law("current_rate", (u[0] - resistance * current - constant * velocity) / p["L"], k, x)
        force = self.law("coil_force", constant * current, k, x)
        friction = self.law("slide_friction", p["b_vc"] * velocity, k, x)
        self.law("velocity_rate", (force - friction - k["tension"]) / p["m"], k, x)
        self.law(
            "position_filter_rate", 2.0 * pi * p["position_cutoff"] * (position - filtered), k, x
        )
        return k

    def changing(self, k: Signals) -> list[float]:
        """Circuit, definition, momentum, filter."""
        return [k["current_rate"], k["velocity"], k["velocity_rate"], k["position_filter_rate"]]

    def same(self, p: Values) -> list[dict[str, float]]:
        """Forces on the slide, voltages of the coil."""
        return [
            {"slide_friction": 1.0, "coil_force": -1.0, "velocity_rate": -1.0 / p["m"]},
            {"drive_voltage": 1.0, "current_rate": 1.0 / p["L"]},
        ]


_EQUATIONS: dict[str, type[Lawful]] = {
    "Motor": LawfulMotor,
    "Pendulum": LawfulPendulum,
    "ThermalNodes": LawfulThermalNodes,
    "Cell": LawfulCell,
    "Actuator": LawfulActuator,
    "VoiceCoil": LawfulVoiceCoil,
}
NAMES = tuple(_EQUATIONS)
STEPS = {"ThermalNodes": 0.5, "Cell": 0.25}  # s, of what is slow


def lawful(name: str, change: Change | None = None) -> Lawful:
    """Make a plant with a change hidden in one of its laws, or with none."""
    equations, clean = _EQUATIONS[name], PLANTS[name]
    hidden, states = {}, [*clean.states]
    if change is not None:
        hidden = {change.place: (change, slice(len(states), len(states) + len(change.rest)))}
        states += [f"memory_{k}" for k in range(len(change.rest))]
    finest = STEPS.get(name, equations.finest)
    about = {
        "hidden": hidden,
        "order": len(clean.states),
        "states": tuple(states),
        "finest": min(finest, change.finest) if change is not None else finest,
    }
    made: Lawful = type(name, (equations,), about)()
    return made
