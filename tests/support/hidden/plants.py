"""The clean plants once more, as equations that something can be hidden in."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from math import pi, sin
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tests.support.clean.foot import PLANTAR, Foot, measured, moving, posterior, turning
from tests.support.clean.plant import Plant
from tests.support.clean.plants import (
    DRAWN,
    PLANTS,
    Cell,
    Galvanostat,
    Motor,
    Pendulum,
    ThermalNodes,
    VoiceCoil,
)
from tests.support.clean.simulation import Values
from tests.support.hidden.change import Change

Array = NDArray[np.float64]
_SPRING, _DAMPER = 300.0, 1.0  # N/m and N*s/m of what the coil pulls on, as in the clean plant


class Altered(Plant):
    """A plant with changes at some of its places; what they remember comes behind the plant's own states."""

    hidden: ClassVar[
        Mapping[str, tuple[Change, slice]]
    ] = {}  # by place, with the states that it remembers by
    order: ClassVar[int]  # of the clean plant

    @abstractmethod
    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Derivatives of the plant's own states."""

    @abstractmethod
    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Outputs before their sensors."""

    @abstractmethod
    def signals(self, x: list[float], u: list[float]) -> dict[str, float]:
        """What a change is a function of, by place, outputs apart."""

    def settled(self, p: Values) -> list[float]:
        """Outputs before anything happened, from which a sensor starts: what it reads is counted from there."""
        return [0.0] * len(self.outputs)

    def more(self, place: str, signal: float, x: list[float]) -> float:
        """What is hidden at a place adds."""
        if place not in self.hidden:
            return 0.0
        change, memory = self.hidden[place]
        return change.more(signal, x[memory])

    def matrices(self, p: Values) -> None:
        """There are none."""

    def drawn(self, p: Values) -> None:
        """There are none."""

    def static(self, p: Values, u: Array) -> Array:
        """A change may come before what limits an input."""
        return u

    def rest(self) -> Array:
        """The plant's own states, then what changes remember."""
        own = [self.starts.get(n, 0.0) for n in self.states[: self.order]]
        return np.array(
            [*own, *(rest for change, _ in self.hidden.values() for rest in change.rest)]
        )

    def rates(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Laws, and what changes remember."""
        rates = self.laws(x, u, p)
        for place, (change, memory) in self.hidden.items():
            if not change.rest:
                continue
            if place in self.outputs:
                k = list(self.outputs).index(place)
                signal = self.readings(x, u, p)[k] - self.settled(p)[k]
            else:
                signal = self.signals(x, u)[place]
            rates = rates + change.rates(signal, x[memory])
        return rates

    def shown(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """What sensors make of the outputs."""
        read = zip(self.outputs, self.readings(x, u, p), self.settled(p), strict=True)
        return [y + self.more(o, y - settled, x) for o, y, settled in read]

    def recorded(self, y: Array, step: float) -> Array:
        """Late, where the logger is."""
        late = {place: round(change.delay / step) for place, (change, _) in self.hidden.items()}
        rows = [
            np.r_[np.full(samples, row[0]), row[:-samples]] if (samples := late.get(o, 0)) else row
            for o, row in zip(self.outputs, y, strict=True)
        ]
        return np.array(rows)


class AlteredMotor(Altered, Motor):
    """i = (u - K w) / R, J dw/dt = K i - friction - load."""

    def signals(self, x: list[float], u: list[float]) -> dict[str, float]:
        """Of friction the speed."""
        return {"voltage": u[0], "friction": x[0]}

    def _current(self, x: list[float], u: list[float], p: Values) -> float:
        return (u[0] + self.more("voltage", u[0], x) - p["constant"] * x[0]) / p["resistance"]

    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Balance of torques."""
        friction = p["damping"] * x[0] + self.more("friction", x[0], x)
        return [(p["constant"] * self._current(x, u, p) - friction - u[1]) / p["inertia"]]

    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Current and speed."""
        return [self._current(x, u, p), x[0]]


class AlteredPendulum(Altered, Pendulum):
    """J ddtheta/dt = tau - W sin(theta) - friction."""

    def signals(self, x: list[float], u: list[float]) -> dict[str, float]:
        """Of friction the velocity, of gravity the angle."""
        return {"torque": u[0], "friction": x[1], "gravity": x[0]}

    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Newton's second law."""
        torque = u[0] + self.more("torque", u[0], x)
        friction = p["damping"] * x[1] + self.more("friction", x[1], x)
        gravity = p["weight"] * sin(x[0]) + self.more("gravity", x[0], x)
        return [x[1], (torque - gravity - friction) / p["inertia"]]

    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """The angle."""
        return [x[0]]


class AlteredThermalNodes(Altered, ThermalNodes):
    """Two balances of heat."""

    def signals(self, x: list[float], u: list[float]) -> dict[str, float]:
        """Of heat that passes the difference that drives it, or the temperature that is stored at."""
        return {
            "power": u[0],
            "conduction": x[0] - x[1],
            "loss": x[1] - u[1],
            "inner": x[0],
            "outer": x[1],
        }

    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Heat that comes less heat that goes."""
        inner, outer, ambient = x[0], x[1], u[1]
        power = u[0] + self.more("power", u[0], x)
        conduction = (inner - outer) / p["R12"] + self.more("conduction", inner - outer, x)
        loss = (outer - ambient) / p["R2"] + self.more("loss", outer - ambient, x)
        stored = self.more("inner", inner, x), self.more("outer", outer, x)
        return [
            (power - conduction - stored[0]) / p["C1"],
            (conduction - loss - stored[1]) / p["C2"],
        ]

    def settled(self, p: Values) -> list[float]:
        """The surroundings."""
        return [293.0, 293.0]

    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Both temperatures."""
        return [x[0], x[1]]


class AlteredCell(Altered, Cell):
    """Open-circuit voltage less what is lost."""

    def signals(self, x: list[float], u: list[float]) -> dict[str, float]:
        """Of the drop the current."""
        return {"drop": u[0]}

    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Current through the resistance of the pair."""
        return [(u[0] - x[0]) / p["tau1"]]

    def settled(self, p: Values) -> list[float]:
        """Open circuit."""
        return [p["ocv"]]

    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Voltage at the terminals."""
        return [p["ocv"] - p["R0"] * u[0] - p["R1"] * x[0] - self.more("drop", u[0], x)]


class AlteredGalvanostat(Altered, Galvanostat):
    """A command, limited, behind a lag."""

    def signals(self, x: list[float], u: list[float]) -> dict[str, float]:
        """Of the command itself."""
        return {"current_command": u[0]}

    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """First order."""
        command, limit = u[0] + self.more("current_command", u[0], x), p["current_limit"]
        return [(min(max(command, -limit), limit) - x[0]) / p["response_time"]]

    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """The current."""
        return [x[0]]


class AlteredVoiceCoil(Altered, VoiceCoil):
    """Coil, slide, spring and filter; the force constant may change with the position."""

    finest = 2e-4

    def signals(self, x: list[float], u: list[float]) -> dict[str, float]:
        """Of friction the velocity, of a stop and of the force constant the position, of the resistance the current."""
        return {
            "force_reference": u[0],
            "friction": x[2],
            "stop": x[1],
            "force_constant": x[1],
            "resistance": x[0],
        }

    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Circuit, definition, momentum, filter."""
        current, position, velocity, filtered = x[:4]
        voltage = u[0] + self.more("force_reference", u[0], x)
        constant = p["K"] * (1.0 + self.more("force_constant", position, x))
        friction = (
            p["b_vc"] * velocity
            + self.more("friction", velocity, x)
            + self.more("stop", position, x)
        )
        resistance = p["R"] + self.more("resistance", current, x)
        tension = _SPRING * position + _DAMPER * velocity
        return [
            (voltage - resistance * current - constant * velocity) / p["L"],
            velocity,
            (constant * current - friction - tension) / p["m"],
            2.0 * pi * p["position_cutoff"] * (position - filtered),
        ]

    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Current of the coil and filtered position."""
        return [x[0], x[3]]


class AlteredFoot(Altered, Foot):
    """The foot on a stand; its tendons may rub and stretch, and the plantar one may cross the arch."""

    def signals(self, x: list[float], u: list[float]) -> dict[str, float]:
        """Of friction the rates, of the arch its angle, of what stretches the tension."""
        return {
            "ankle_friction": x[3],
            "mtp_friction": x[5],
            "arch": x[1],
            "arch_radius": x[1],
            "guide": x[3],
            "stretch": u[0],
        }

    def laws(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Balance of torques; in a guide a tendon that is drawn out pulls the more."""
        _, heel, pull = posterior(x[0])
        lengthening = -(pull.conjugate() * 1j * x[3] * heel).real
        po = u[0] * (1.0 + self.more("guide", lengthening, x))
        pl = u[1] * (1.0 + self.more("guide", PLANTAR * x[5], x))
        torques = turning(x[:3], po, pl, u[2])
        torques[0] -= self.more("ankle_friction", x[3], x)
        torques[1] -= self.more("arch", x[1], x) + pl * self.more("arch_radius", x[1], x)
        torques[2] -= self.more("mtp_friction", x[5], x)
        return moving(x, torques, p)

    def readings(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Angles, and the length of po less what its tendon is longer."""
        *angles, length = measured(x[:3])
        return [*angles, length - self.more("stretch", u[0], x)]


_EQUATIONS: dict[str, type[Altered]] = {
    "Motor": AlteredMotor,
    "Pendulum": AlteredPendulum,
    "ThermalNodes": AlteredThermalNodes,
    "Cell": AlteredCell,
    "Galvanostat": AlteredGalvanostat,
    "VoiceCoil": AlteredVoiceCoil,
    "Foot": AlteredFoot,
}
NAMES = tuple(_EQUATIONS)
USUAL = tuple(name for name in NAMES if name in DRAWN)
STEPS = {"ThermalNodes": 0.5, "Cell": 0.25}  # s, of what is slow


def altered(name: str, *changes: Change) -> Plant:
    """Make a plant with changes hidden in it, each at a place of its own."""
    equations, clean = _EQUATIONS[name], PLANTS[name]
    hidden, states = {}, [*clean.states]
    for change in changes:
        if change.place in hidden:
            raise ValueError(f"two changes at {change.place} of {name}")
        hidden[change.place] = change, slice(len(states), len(states) + len(change.rest))
        states += [f"{change.place}_memory_{k}" for k in range(len(change.rest))]
    about = {
        "hidden": hidden,
        "order": len(clean.states),
        "states": tuple(states),
        "finest": min([STEPS.get(name, equations.finest), *(change.finest for change in changes)]),
    }
    made: Plant = type(name, (equations,), about)()
    return made
