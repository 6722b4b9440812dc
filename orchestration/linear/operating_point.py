"""Operating points about which models are linearised, and simulations up to one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Signals
from fmus.kit.interrupt import uninterrupted
from fmus.kit.record import CompiledModel
from fmus.kit.symbolic import Graph
from orchestration.fmu.simulation import points_before
from orchestration.reporting import option

_AT_REST = 1e-3  # largest way to the equilibrium that is none, of a state's magnitude
_INTEGRATES = 1e-9  # of the fastest pole, below which a pole is that of an integrator


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
        In the units of the model.
    rates : dict of str to float
        Rates of continuous states, in their unit per second, where they are computed.
    trimmed : bool
        True if it is an equilibrium.
    drift : dict of str to float
        Rates of states that drift in the equilibrium, in their unit per second.
    undetermined : tuple of str
        States that the equilibrium does not determine, which keep their start values.
    outside : dict of str to tuple of float
        Ranges that states and free signals declare, of those that leave them in the equilibrium.
    """

    time: float
    parameters: dict[str, float]
    inputs: dict[str, float]
    states: dict[str, float]
    discretes: dict[str, float]
    outputs: dict[str, float] = field(default_factory=dict)
    rates: dict[str, float] = field(default_factory=dict)
    trimmed: bool = False
    drift: dict[str, float] = field(default_factory=dict)
    undetermined: tuple[str, ...] = ()
    outside: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """Text for messages: ``at 2 s`` or ``in the equilibrium``."""
        return "in the equilibrium" if self.trimmed else f"at {self.time:g} s"

    @property
    def values(self) -> dict[str, float]:
        """Inputs, states, discrete states and outputs by name."""
        return self.inputs | self.states | self.discretes | self.outputs

    def seconds(self, period: str | float) -> float:
        """Return a period in s, which is a number or the name of a parameter."""
        return self.parameters[period] if isinstance(period, str) else float(period)

    def arguments(self, graph: Graph) -> list[Array]:
        """Return the arguments of the functions of a graph."""
        values = self.parameters | self.inputs | self.states | self.discretes
        vectors = [np.array([values[v.name] for v in group]) for group in graph.layout.arguments]
        return [np.array([self.time]), *vectors]

    def updated(self, values: Mapping[str, float]) -> OperatingPoint:
        """Return the operating point with other values of some variables but outputs."""
        groups = (self.parameters, self.inputs, self.states, self.discretes)
        parameters, inputs, states, discretes = (
            {name: values.get(name, value) for name, value in group.items()} for group in groups
        )
        return replace(
            self, parameters=parameters, inputs=inputs, states=states, discretes=discretes
        )


def rest_notes(
    point: OperatingPoint,
    by_states: Array,
    names: Sequence[str],
    nominal: Mapping[str, float],
    units: Mapping[str, str],
) -> tuple[str, ...]:
    """Return a note on states that move at an operating point, of which a linear model is then not.

    Left to itself, the slowest mode with a pole p goes on by the rate over p.

    Parameters
    ----------
    point : OperatingPoint
    by_states : ndarray, shape (n, n)
        Derivatives of the rates of states.
    names : sequence of str, length n
        Names of the states.
    nominal : Mapping of str to float
        Magnitudes of states.
    units : Mapping of str to str
        Units of states, where they are known.
    """
    poles = np.abs(np.linalg.eigvals(by_states)) if names else np.zeros(0)
    slowest = min(poles[poles > _INTEGRATES * poles.max(initial=0.0)], default=1.0)
    moving = {}
    for name in names:
        rate = point.rates.get(name, 0.0)
        magnitude = max(abs(point.values[name]), nominal.get(name, 1.0))
        if abs(rate) > _AT_REST * slowest * magnitude:
            moving[name] = rate
    return not_at_rest(moving, units)


def not_at_rest(rates: Mapping[str, float], units: Mapping[str, str]) -> tuple[str, ...]:
    """Return a note on signals that move, with their rates in their units per second, if any."""
    words = [
        f"{name} changes by {with_unit(f'{rate:.3g}', units.get(name))} per second"
        for name, rate in rates.items()
    ]
    return (f"not at rest here: {listed(words)}",) if words else ()


def with_unit(number: str, unit: str | None) -> str:
    """Return a number with its unit, if it has one."""
    return f"{number} {unit}" if unit and unit != "1" else number


def listed(words: Sequence[str], most: int = 6) -> str:
    """Return the first ones of some words, and the number of others."""
    rest = len(words) - most
    return ", ".join(words[:most]) + (f" and {rest} more" if rest > 0 else "")


@uninterrupted()
def with_outputs(graph: Graph, point: OperatingPoint) -> OperatingPoint:
    """Return an operating point with outputs and rates, which are computed from other values."""
    laws = ca.Function("laws", graph.arguments, [graph.outputs, graph.rates])
    outputs, rates = (law.full().ravel().tolist() for law in laws.call(point.arguments(graph)))
    layout = graph.layout
    return replace(
        point,
        outputs=dict(zip((v.name for v in layout.outputs), outputs, strict=True)),
        rates=dict(zip((v.name for v in layout.states), rates, strict=True)),
    )


def start_point(graph: Graph, settings: Mapping[str, float]) -> OperatingPoint:
    """Return the operating point at the start of a model.

    Parameters
    ----------
    graph : Graph
    settings : Mapping of str to float
        Values of parameters and inputs that differ from their defaults.
    """
    parameters, inputs, states, discretes = (
        {v.name: float(value) for v, value in zip(group, vector, strict=True)}
        for group, vector in zip(graph.layout.arguments, graph.point(**settings), strict=True)
    )
    return OperatingPoint(0.0, parameters, inputs, states, discretes)


@uninterrupted()
def _remembering(graph: Graph, start: OperatingPoint) -> OperatingPoint:
    """Return the start with the memory of effects that samples a period before would have left."""
    laws = ca.Function("updates", graph.arguments, list(graph.updates))
    values: dict[str, float] = {}
    for place, (clock, members) in enumerate(graph.layout.sampled):
        before = replace(start, time=start.time - start.seconds(clock.period))
        sampled = laws.call(before.arguments(graph))[place].full().ravel().tolist()
        after = dict(zip(start.discretes, sampled, strict=True))
        values |= {v.name: after[v.name] for v in members if v.is_memory}
    return start.updated(values)


def point_at(
    graph: Graph,
    time: float,
    settings: Mapping[str, float],
    stimulus: Signals | None = None,
    points: Array | None = None,
    compiled: CompiledModel | None = None,
) -> OperatingPoint:
    """Simulate a model up to a time, and return the operating point there.

    Discrete states are those before a sample at that time, as an FMU shows them. At the start the
    memory of effects, such as of a delay, is that of a model that rested there before.

    Parameters
    ----------
    graph : Graph
    time : float
        Seconds from the start.
    settings : Mapping of str to float
        Values of parameters and constant inputs that differ from their defaults.
    stimulus : Mapping of str to ndarray, shape (n,), optional
        Values of other inputs at `points`, constant between them.
    points : ndarray, shape (n,), optional
        Seconds.
    compiled : CompiledModel, optional
        The compiled model, if it is used for several points.

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
    known = np.zeros(1) if points is None else points
    instants = np.union1d(known[known <= time], [time])
    latest = points_before(known, instants)
    inputs = {name: np.full(latest.size, value) for name, value in start.inputs.items()}
    inputs |= {name: values[latest] for name, values in (stimulus or {}).items()}
    now = {name: float(values[-1]) for name, values in inputs.items()}
    if instants.size == 1:
        return _remembering(graph, start.updated(now))
    run = (compiled or CompiledModel(graph)).run(instants, inputs, start.parameters)
    end = {name: float(values[-1]) for name, values in run.signals.items()}
    return replace(start.updated(end | now), time=time)
