"""A tank with effects in its catalogue, and the same physics by SciPy."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from fmus.kit import Component, Effect, Input, Output, Parameter, State, Term
from fmus.kit.arrays import Array
from orchestration.diagnosis import LawModel, Record

AREA, DRAIN, START = 2.0, 0.5, 1.5


class Tank(Component):
    """A tank that drains in proportion to its level."""

    name = "tank"
    area = Parameter(AREA, "m^2", min=0.1, max=10, doc="area")
    conductance = Parameter(DRAIN, "m^2/s", min=0.01, max=10, doc="of the drain")
    inflow = Input("m^3/s", doc="inflow")
    height = State("m", rate="height_rate", start=START, doc="height")

    def drained(self):
        """Flow through the drain."""
        return self.conductance * self.height

    def height_rate(self):
        """Rate of the height."""
        return (self.inflow - self.drained()) / self.area

    @Output("m")
    def level(self):
        """Height of the water."""
        return self.height

    @Output("m^3/s")
    def flow(self):
        """Flow through the drain."""
        return self.drained()


class Silting(Effect):
    """A part of the flow that hangs on a lag of the height; silt = 0 is without."""

    id = "silting"
    title = "Silt in the drain"
    neutral = "silt"
    term = Term("drained", "height", "s / (T s + 1)", "drained remembering height")
    silt = Parameter(0.0, "m^2/s", min=0, max=10, nominal=0.1, doc="silt")
    silt_time = Parameter(3.0, "s", min=0.01, max=1e4, doc="time constant of the silt")
    silted = State("m", rate="silted_rate", start=0.25, doc="height behind the silt")

    def silted_rate(self):
        """Rate of the height behind the silt."""
        return (self.height - self.silted) / self.silt_time

    def drained(self):
        """Flow through the drain."""
        return super().drained() + self.silt * self.silted


class Swirl(Effect):
    """A part of the flow that grows with the square of its strength: its response vanishes at 0."""

    id = "swirl"
    title = "A swirl above the drain"
    neutral = "spin"
    term = Term("drained", "height", "s^2 h^3", "drained over height")
    spin = Parameter(0.0, "1/s", min=0, max=10, nominal=0.2, doc="spin")

    def drained(self):
        """Flow through the drain."""
        return super().drained() + self.spin**2 * self.height**3


EFFECTS = {"silting": Silting, "swirl": Swirl}


@cache
def tank() -> LawModel:
    """Return the tank, with its catalogue."""
    return LawModel(Tank, EFFECTS)


def drawn(count: int = 160, seed: int = 1, noise: float = 0.0, **values: float) -> Record:
    """Return a record of a tank with a silted and swirling drain, by SciPy."""
    time = 0.25 * np.arange(count)
    steps = np.random.default_rng(seed).uniform(0.2, 2.0, count // 8 + 1)
    inflow = np.repeat(steps, 8)[:count]
    p = {"area": AREA, "k": DRAIN, "silt": 0.0, "time": 3.0, "spin": 0.0, "start": START} | values

    def drained(x: Array) -> float:
        return float(p["k"] * x[0] + p["silt"] * x[1] + p["spin"] ** 2 * x[0] ** 3)

    x = np.array([p["start"], 0.25])
    rows = [x]
    for k in range(count - 1):

        def rates(t: float, x: Array, u: float = float(inflow[k])) -> list[float]:
            return [(u - drained(x)) / p["area"], (x[0] - x[1]) / p["time"]]

        x = solve_ivp(rates, (0.0, 0.25), x, rtol=1e-10, atol=1e-12).y[:, -1]
        rows.append(x)
    outputs = np.array([[x[0], drained(x)] for x in rows])
    outputs += noise * np.random.default_rng(seed).standard_normal(outputs.shape)
    return Record(time, inflow[:, None].copy(), outputs, (False,))
