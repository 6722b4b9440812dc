"""Linearisation of FMUs without equations, alone and as members of a system.

A system is run by Jacobi's method to its operating point. Then each member is linearised by itself,
with the inputs that it had until then: members with known laws together and by their equations,
each of the others by its interface. What connects them is linear and known.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import or_

import casadi as ca
import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import error_context
from fmus.kit.record import CompiledModel
from fmus.kit.symbolic import Graph
from orchestration import master
from orchestration.fmu import Model, Signal, Value
from orchestration.fmu.signal import numeric
from orchestration.fmu.simulation import grid
from orchestration.linear.blocks import LinearBlocks, blocks_of, jacobians, joined
from orchestration.linear.fmu_derivatives import FmuRequest, LinearPart, linearise_fmu
from orchestration.linear.operating_point import OperatingPoint, point_at, with_outputs
from orchestration.linear.subject import BY_LAWS, LinearSubject
from orchestration.master.reference import fuse
from orchestration.reporting import option
from orchestration.system import Connection, Member, System, interface


@dataclass(frozen=True)
class PartsAtPoint(LinearSubject):
    """FMUs that are linearised about an operating point, and their connections.

    Attributes
    ----------
    name : str
    model : Model
        Of the FMU or the system, with the units of signals.
    outputs : Mapping of str to str
    system : System or None
    parts : tuple of LinearPart
    point : OperatingPoint
    """

    name: str
    model: Model
    outputs: Mapping[str, str]
    system: System | None
    parts: tuple[LinearPart, ...]
    point: OperatingPoint

    @cached_property
    def _joined(self) -> LinearBlocks:
        blocks = joined([part.blocks for part in self.parts])
        if self.system is None:
            return blocks
        fed = {
            name: [str(port) for port in ports if str(port) in blocks.inputs]
            for name, ports in self.system.inputs.items()
        }
        return blocks.fed_by({name: ports for name, ports in fed.items() if ports})

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs that are real numbers."""
        connected = {str(c.target) for c in self._connected}
        known = self.model.inputs
        free = [name for name in self._joined.inputs if name not in connected]
        return [name for name in free if known[name].type == "real"]

    @property
    def states(self) -> list[str]:
        """Names of continuous and discrete states."""
        # those of a realisation have no meaning
        known = [part.blocks for part in self.parts if not part.is_held]
        return [name for blocks in known for name in (*blocks.states, *blocks.discretes)]

    @property
    def units(self) -> dict[str, str]:
        """Units of all signals, by name."""
        model = self.model
        signals = {**model.parameters, **model.others, **model.outputs, **model.inputs}
        units = {name: signal.unit for name, signal in signals.items()}
        for member in self.system.members if self.system else ():
            for name, signal in interface(member).others.items():
                units[f"{member.name}.{name}"] = signal.unit
        for connection in self._connected:
            source = str(connection.source)
            units.setdefault(str(connection.target), units.get(source, "1"))
        return units | {name: units.get(signal, "1") for name, signal in self.outputs.items()}

    @property
    def nominal(self) -> dict[str, float]:
        """Magnitudes of continuous states, by name."""
        return reduce(or_, (part.nominal for part in self.parts))

    @property
    def method(self) -> str:
        """Origin of the derivatives."""
        return ", ".join(dict.fromkeys(part.method for part in self.parts))

    @property
    def is_held(self) -> bool:
        """Whether a part is known only with inputs that are held over the communication step."""
        return any(part.is_held for part in self.parts)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the parts for the user."""
        return tuple(note for part in self.parts for note in part.notes)

    def complete(self, point: OperatingPoint) -> OperatingPoint:
        """Return an operating point with outputs and rates, also by their names in the system."""
        return point

    def blocks(
        self, point: OperatingPoint, cuts: Sequence[Connection], step: float
    ) -> LinearBlocks:
        """Return the blocks about an operating point, without some connections."""
        others = [c for c in self._connected if c not in cuts]
        if step and others:
            return self._joined.exchanging(others, step)
        return self._joined.connected(others)

    @property
    def _connected(self) -> list[Connection]:
        """Connections between real signals."""
        blocks = self._joined
        connections = self.system.connections if self.system else ()
        known = {*blocks.inputs, *blocks.signals}
        return [c for c in connections if {str(c.source), str(c.target)} <= known]


@dataclass(frozen=True)
class ForeignSubject:
    """An FMU without equations, or a system in which one is a member.

    Attributes
    ----------
    model : Model
        Of the FMU or the system.
    system : System, optional
    """

    model: Model
    system: System | None = None

    def at(
        self,
        time: float,
        settings: Mapping[str, Value],
        drive: tuple[Array, Signals],
        signals: tuple[Sequence[str], Sequence[str]],
        step: float,
    ) -> PartsAtPoint:
        """Return the parts of the model, linearised about the operating point that they reach.

        Parameters
        ----------
        time : float
            Time of the operating point, s.
        settings : Mapping of str to float or str
            Values of parameters and constant inputs.
        drive : tuple
            Times, s, shape (n,), and inputs that vary, each of shape (n,), held between them.
        signals : tuple of sequence of str
            Inputs and outputs that the linear model is to have; all if empty.
        step : float
            Communication step until then, and that of pulses, s.

        Raises
        ------
        UserError
            If the time is negative, a simulation fails, or a part cannot be linearised.
        """
        if not 0.0 <= time < np.inf:
            raise UserError(f"{option('at', f'{time:g}')}: a time from 0 s on")
        instants, driven = drive
        before = instants <= time
        points = np.union1d(instants[before], grid(0.0, time, step) if time else np.zeros(1))
        latest = np.searchsorted(instants, points, side="right") - 1
        held = {name: values[latest] for name, values in driven.items()}
        if self.system is not None:
            return self._members_at(self.system, settings, points, held, signals, step)
        model = self.model
        inputs, outputs = (
            _chosen(names, known)
            for names, known in zip(signals, (model.inputs, model.outputs), strict=True)
        )
        request = FmuRequest(
            model, time, settings, inputs, outputs, step, points=points, driven=held
        )
        part = linearise_fmu(request)
        return PartsAtPoint(
            model.name, model, {name: name for name in outputs}, None, (part,), part.point
        )

    def _members_at(
        self,
        system: System,
        settings: Mapping[str, Value],
        points: Array,
        driven: Signals,
        signals: tuple[Sequence[str], Sequence[str]],
        step: float,
    ) -> PartsAtPoint:
        """Return the members of a system at the last of its communication points, s, shape (n,)."""
        given = {n: float(v) for n, v in settings.items() if n in self.model.inputs}
        constant = self._starts_of(system) | given
        inputs = {name: np.full(points.size, value) for name, value in constant.items()}
        inputs |= driven
        parameters = {n: v for n, v in settings.items() if n not in constant}
        received = _received(system.given(parameters), points, inputs, step)
        wanted = [*map(str, system.outputs.values()), *(str(c.source) for c in system.connections)]
        asked, outputs = ({*received, *signals[0]}, {*wanted, *signals[1]})
        parts = []
        if self._graph is not None:
            parts.append(self._known_part(points, numeric(parameters), received))
        for member in system.given(parameters).members:
            if member.cls is None:
                parts.append(_foreign_part(member, points, received, (asked, outputs), step))
        there = _beside([part.point for part in parts], {n: v[-1] for n, v in inputs.items()})
        named = {alias: str(port) for alias, port in system.outputs.items()}
        shown = {alias: signal for alias, signal in named.items() if signal in there.values}
        point = replace(
            there, outputs=there.outputs | {a: there.values[s] for a, s in shown.items()}
        )
        return PartsAtPoint(self.model.name, self.model, shown, system, tuple(parts), point)

    def _starts_of(self, system: System) -> dict[str, float]:
        """Return the start value of each real input of a system: that of the first port it feeds.

        The value that a member has in the system comes before that of its FMU.
        """
        starts = {}
        for name, (port, *_) in system.inputs.items():
            signal = self.model.inputs[name]
            if signal.type == "real":
                own = system.member(port.member).parameters
                starts[name] = float(own.get(port.variable, signal.start))
        return starts

    @cached_property
    def _graph(self) -> Graph | None:
        """Equations of the members whose laws are known, side by side; None without any."""
        system = self.system
        members = tuple(m for m in system.members if m.cls is not None) if system else ()
        if system is None or not members:
            return None
        return fuse(replace(system, members=members, connections=(), inputs={}, outputs={}))

    @cached_property
    def _functions(self) -> tuple[CompiledModel, ca.Function]:
        """The equations as compiled, and the function of their Jacobians."""
        assert self._graph is not None
        return CompiledModel(self._graph), jacobians(self._graph)

    def _known_part(
        self, points: Array, settings: Mapping[str, float], received: Signals
    ) -> LinearPart:
        """Return the members whose laws are known, linearised at the last of the points."""
        graph = self._graph
        assert graph is not None
        layout = graph.layout
        compiled, function = self._functions
        own = {v.name: settings[v.name] for v in layout.parameters if v.name in settings}
        driven = {v.name: received[v.name] for v in layout.inputs if v.name in received}
        time = float(points[-1])
        point = with_outputs(graph, point_at(graph, time, own, driven, points, compiled))
        nominal = {v.name: v.nominal for v in layout.states}
        return LinearPart(blocks_of(graph, point, function), point, BY_LAWS, nominal)


def _chosen(names: Sequence[str], signals: Mapping[str, Signal]) -> list[str]:
    """Return those of the names that are real signals; all real signals if there are none."""
    real = [name for name, signal in signals.items() if signal.type == "real"]
    return [name for name in names if name in real] or real


def _received(system: System, points: Array, inputs: Signals, step: float) -> dict[str, Array]:
    """Run a system, and return what each of its members' inputs receives, by ``member.variable``.

    Parameters
    ----------
    system : System
    points : ndarray, shape (n,)
        Communication points, s.
    inputs : Mapping of str to ndarray, shape (n,)
    step : float
        Length of a step behind the first point, if it is the only one, s.

    Returns
    -------
    dict of str to ndarray, shape (n,)
    """
    time = points if points.size > 1 else np.array([points[0], points[0] + step])
    held = {name: np.resize(values, time.size) for name, values in inputs.items()}
    sources = list(dict.fromkeys(str(c.source) for c in system.connections))
    run = master.run(system, time, held, record=sources, method="jacobi")
    if not run.complete:
        raise UserError(f"system {system.name}: {run.message}")
    received = {name: values for name, values in inputs.items() if name not in system.inputs}
    for name, port in system.fed_ports:
        if name in inputs:
            received[str(port)] = inputs[name]
    for connection in system.connections:
        sent = run.signals[str(connection.source)][: points.size]
        values = sent.copy()
        for value, other in connection.table:
            values[sent == value] = other
        received[str(connection.target)] = connection.factor * values + connection.offset
    return received


def _foreign_part(
    member: Member,
    points: Array,
    received: Signals,
    signals: tuple[Container[str], Container[str]],
    step: float,
) -> LinearPart:
    """Return a member without equations, linearised at the last of the points."""
    prefix = f"{member.name}."
    model = interface(member)
    inputs, outputs = (
        [n for n, s in known.items() if s.type == "real" and f"{prefix}{n}" in asked]
        for known, asked in zip((model.inputs, model.outputs), signals, strict=True)
    )
    driven = {n: received[f"{prefix}{n}"] for n in model.inputs if f"{prefix}{n}" in received}
    with error_context(f"member {member.name}"):
        return linearise_fmu(
            FmuRequest(
                model,
                float(points[-1]),
                member.parameters,
                inputs,
                outputs,
                step,
                prefix,
                points,
                driven,
            )
        )


def _beside(points: Sequence[OperatingPoint], inputs: Mapping[str, float]) -> OperatingPoint:
    """Return the operating point of several models, whose names differ, with further inputs."""
    groups = ("parameters", "inputs", "states", "discretes", "outputs", "rates")
    values = {name: reduce(or_, (getattr(one, name) for one in points)) for name in groups}
    values["inputs"] |= {name: float(value) for name, value in inputs.items()}
    return OperatingPoint(points[0].time, **values)
