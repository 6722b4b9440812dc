"""Operating points: the values about which a model is linearised, and a simulation up to one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.interrupt import uninterrupted
from fmus.kit.record import CompiledModel
from fmus.kit.symbolic import Graph
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
    outputs : dict of str to float
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
    outputs: dict[str, float] = field(default_factory=dict)
    trimmed: bool = False
    drift: dict[str, float] = field(default_factory=dict)
    undetermined: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """Where it is, for messages: ``at 2 s`` or ``in the equilibrium``."""
        return "in the equilibrium" if self.trimmed else f"at {self.time:g} s"

    @property
    def values(self) -> dict[str, float]:
        """Inputs, states, discrete states and outputs by name."""
        return self.inputs | self.states | self.discretes | self.outputs

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


@uninterrupted()
def with_outputs(graph: Graph, point: OperatingPoint) -> OperatingPoint:
    """Return an operating point with the values of outputs that belong to its other values."""
    values = ca.Function("outputs", graph.arguments, [graph.outputs])(*point.arguments(graph))
    names = [v.name for v in graph.layout.outputs]
    return replace(point, outputs=dict(zip(names, values.full().ravel().tolist(), strict=True)))


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
    parameters, inputs, states, discretes = named
    return OperatingPoint(0.0, parameters, inputs, states, discretes)


def point_at(
    graph: Graph,
    time: float,
    settings: Mapping[str, float],
    stimulus: Mapping[str, Array] | None = None,
    points: Array | None = None,
    compiled: CompiledModel | None = None,
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
    compiled : CompiledModel, optional
        The same model, where it is compiled once for several points.

    Returns
    -------
    OperatingPoint

    Raises
    ------
    UserError
        If the time is negative, or the simulation fails.
    """
    earliest = 0.0 if points is None else float(points[0])
    if not (np.isfinite(time) and time >= earliest):
        raise UserError(f"{option('at', f'{time:g}')}: a time from {earliest:g} s on")
    start = start_point(graph, settings)
    instants = np.zeros(1) if points is None else points[points <= time]
    driven = {v.name: np.full(instants.size, start.inputs[v.name]) for v in graph.layout.inputs}
    driven |= {name: values[: instants.size] for name, values in (stimulus or {}).items()}
    now = {name: float(values[-1]) for name, values in driven.items()}
    if instants[-1] < time:
        instants = np.append(instants, time)
        driven = {name: np.append(values, values[-1]) for name, values in driven.items()}
    if instants.size == 1:
        return replace(start, inputs=now)
    known = {p.name: start.parameters[p.name] for p in graph.layout.parameters}
    run = (compiled or CompiledModel(graph)).run(instants, driven, known)
    reached = {name: float(values[-1]) for name, values in run.signals.items()}
    return OperatingPoint(
        time,
        start.parameters,
        now,
        {name: reached[name] for name in start.states},
        {name: reached[name] for name in start.discretes},
    )
