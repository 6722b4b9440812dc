"""A mass on a spring as a component, and its equations written anew for SciPy."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.arrays import Array
from orchestration.diagnosis import LawModel, Record
from orchestration.diagnosis.fitting import Problem, StartPrior

M, K, D = 2.0, 30.0, 1.5
START = np.array([0.02, 0.1])
FREE = np.array([0, 1, 2])


class Mass(Component):
    """A mass on a spring with a damper."""

    name = "mass"
    mass = Parameter(M, "kg", min=0.01, max=100.0)
    stiffness = Parameter(K, "N/m", min=0.0, max=1e5)
    damping = Parameter(D, "N*s/m", min=0.0, max=1e5)
    force = Input("N", nominal=5.0)
    x = State("m", rate="velocity", nominal=0.1)
    v = State("m/s", rate="acceleration", nominal=1.0)

    def velocity(self):
        """By definition."""
        return self.v

    def spring(self):
        """Hooke."""
        return self.stiffness * self.x

    def friction(self):
        """Viscous."""
        return self.damping * self.v

    def acceleration(self):
        """Newton."""
        return (self.force - self.spring() - self.friction()) / self.mass

    @Output("m", nominal=0.1)
    def position(self):
        """As seen."""
        return self.x


@cache
def mass() -> LawModel:
    """Return the compiled mass."""
    return LawModel(Mass)


def nominal() -> Array:
    """Return the declared values of all parameters."""
    return np.array([float(p.start) for p in mass().parameters])


def pushed(count: int, step: float = 0.02, smooth: bool = False) -> Record:
    """Return a record of a varied force, without measured outputs."""
    time = step * np.arange(count)
    force = 5.0 * np.sin(1.3 * time) + 3.0 * np.sign(np.sin(2.1 * time)) + np.cos(4.0 * time)
    return Record(time, force[:, None].copy(), np.zeros((count, 1)), (smooth,))


def integrated(
    record: Record,
    rates: Callable[[Array, float, float], list[float]],
    start: Array,
    rtol: float = 1e-9,
) -> Array:
    """Integrate ``rates(x, u, t)`` over a record, from sample to sample, by SciPy."""
    force = record.inputs[:, 0]
    states = [np.asarray(start, dtype=float)]
    for k, (a, b) in enumerate(pairwise(record.time.tolist())):
        slope = (force[k + 1] - force[k]) / (b - a) if record.smooth[0] else 0.0

        def of_time(
            t: float, x: Array, k: int = k, a: float = a, slope: float = slope
        ) -> list[float]:
            return rates(x, force[k] + slope * (t - a), t)

        done = solve_ivp(of_time, (a, b), states[-1], method="DOP853", rtol=rtol, atol=1e-11)
        states.append(done.y[:, -1])
    return np.array(states)


def exact(record: Record, values: tuple[float, float, float], start: Array, push: Array) -> Array:
    """Return position and velocity of the linear mass under held forces, by matrix exponentials."""
    m, k, d = values
    whole = np.zeros((3, 3))
    whole[:2] = [[0.0, 1.0, 0.0], [-k / m, -d / m, 1.0 / m]]
    moved = expm(whole * (record.time[1] - record.time[0]))
    states = [np.asarray(start, dtype=float)]
    for force in push[:-1].tolist():
        states.append(moved[:2, :2] @ states[-1] + moved[:2, 2] * force)
    return np.array(states)


def problem_of(records: list[Record], start: Array = START) -> Problem:
    """Return the problem of fitting the mass to records, from starts near the given."""
    spread = np.mean([np.nanstd(r.outputs, axis=0) for r in records], axis=0)
    priors = tuple(StartPrior(start, np.array([0.01, 0.1])) for _ in records)
    return Problem(mass(), tuple(records), spread, priors)
