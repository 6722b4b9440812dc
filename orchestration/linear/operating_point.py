"""Operating points: the values about which a model is linearised, and a simulation up to one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.record import CompiledModel
from fmus.kit.symbolic import Graph
from orchestration.fmu import grid
from orchestration.reporting import option


@dataclass(frozen=True)
class OperatingPoint:
    """The values of all variables of a model at one time.

    Attributes
    ----------
    time : float
        Seconds.
    parameters, inputs, states, discretes : dict of str to float
        In the units of the model.
    trimmed : bool
        Whether it is an equilibrium that was searched.
    drift : dict of str to float
        Rates of states that are not at rest in an equilibrium, in their unit per second.
    undetermined : tuple of str
        States that the equilibrium leaves open, which stay where they started.
    """

    time: float
    parameters: dict[str, float]
    inputs: dict[str, float]
    states: dict[str, float]
    discretes: dict[str, float]
    trimmed: bool = False
    drift: dict[str, float] = field(default_factory=dict)
    undetermined: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """Where it is, for messages: ``at 2 s`` or ``in the equilibrium``."""
        return "in the equilibrium" if self.trimmed else f"at {self.time:g} s"

    @property
    def values(self) -> dict[str, float]:
        """Inputs, states and discrete states by name."""
        return self.inputs | self.states | self.discretes

    def seconds(self, given: str | float) -> float:
        """Return a period: a number, or the value of a parameter."""
        return self.parameters[given] if isinstance(given, str) else float(given)

    def arguments(self, graph: Graph) -> list[Array]:
        """Return the arguments of the functions of a graph."""
        layout = graph.layout
        groups = (
            (layout.parameters, self.parameters),
            (layout.inputs, self.inputs),
            (layout.states, self.states),
            (layout.discretes, self.discretes),
        )
        vectors = [np.array([values[v.name] for v in group]) for group, values in groups]
        return [np.array([self.time]), *vectors]


def start_point(graph: Graph, settings: Mapping[str, float]) -> OperatingPoint:
    """Return the operating point at which a model starts.

    Parameters
    ----------
    graph : Graph
    settings : Mapping of str to float
        Parameters and inputs in place of defaults.
    """
    vectors = graph.point(**settings)
    layout = graph.layout
    groups = (layout.parameters, layout.inputs, layout.states, layout.discretes)
    named = [
        {v.name: float(value) for v, value in zip(group, vector, strict=True)}
        for group, vector in zip(groups, vectors, strict=True)
    ]
    return OperatingPoint(0.0, *named)


def point_at(
    graph: Graph,
    time: float,
    settings: Mapping[str, float],
    stimulus: Mapping[str, Array] | None = None,
    points: Array | None = None,
) -> OperatingPoint:
    """Simulate a model up to a time, and return the operating point there.

    Discrete states are those before a sample at that time, as an FMU shows them.

    Parameters
    ----------
    graph : Graph
    time : float
        Seconds from the start.
    settings : Mapping of str to float
        Parameters and inputs in place of defaults; inputs stay at their value.
    stimulus : Mapping of str to ndarray, shape (n,), optional
        Inputs that vary, at `points`, held until the next.
    points : ndarray, shape (n,), optional
        Seconds.

    Returns
    -------
    OperatingPoint

    Raises
    ------
    UserError
        If the time is negative, or the simulation fails.
    """
    if not (np.isfinite(time) and time >= 0.0):
        raise UserError(f"{option('at', f'{time:g}')}: a time from 0 s on")
    start = start_point(graph, settings)
    over = np.array([0.0]) if points is None else points[points < time]
    inputs = {v.name: np.full(over.size, start.inputs[v.name]) for v in graph.layout.inputs}
    inputs |= {name: values[: over.size] for name, values in (stimulus or {}).items()}
    last = {name: float(values[-1]) for name, values in inputs.items()} if over.size else {}
    if points is not None and stimulus:
        last |= {n: float(v[np.searchsorted(points, time, "right") - 1]) for n, v in stimulus.items()}
    now = start.inputs | last
    if time == 0.0:
        return OperatingPoint(0.0, start.parameters, now, start.states, start.discretes)
    instants = np.append(over if over.size else grid(0.0, time, time)[:1], time)
    driven = {name: np.append(values, now[name]) for name, values in inputs.items()}
    known = {p.name: start.parameters[p.name] for p in graph.layout.parameters}
    run = CompiledModel(graph).run(instants, driven, known)
    reached = {name: float(values[-1]) for name, values in run.signals.items()}
    return OperatingPoint(
        time,
        start.parameters,
        now,
        {name: reached[name] for name in start.states},
        {name: reached[name] for name in start.discretes},
    )
