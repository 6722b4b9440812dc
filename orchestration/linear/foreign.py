"""Linearisation of FMUs without equations, alone and as members of a system.

A system is run by Jacobi's method to its operating point. Then each member is linearised by itself,
with the inputs that it had until then: members with known laws together and by their equations,
each of the others by its interface. What connects them is linear and known. An FMU alone is a
system of one member without a name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import or_

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import error_context
from orchestration import master
from orchestration.fmu import Model, Signal, Value
from orchestration.fmu.simulation import grid, points_before, source_of
from orchestration.linear.blocks import LinearBlocks, joined
from orchestration.linear.fmu_derivatives import (
    FmuRequest,
    LinearPart,
    linearise_fmu,
    units_of,
)
from orchestration.linear.operating_point import OperatingPoint, point_at
from orchestration.linear.subject import Equations, LinearSubject, subject_of
from orchestration.reporting import option
from orchestration.system import Connection, Member, System, interface


@dataclass(frozen=True)
class MembersAtPoint(LinearSubject):
    """Members of a system that are linearised about an operating point, and their connections.

    Attributes
    ----------
    joined : LinearBlocks
        Those of all members, whose connected inputs are inputs.
    point : OperatingPoint
    is_held : bool
        Whether a member is known only with inputs that are held over the communication step.
    remarks : tuple of str
        Remarks on members for the user.
    """

    joined: LinearBlocks
    point: OperatingPoint
    is_held: bool
    remarks: tuple[str, ...]

    def blocks(
        self, point: OperatingPoint, cuts: Sequence[Connection], step: float
    ) -> LinearBlocks:
        """Return the blocks about the operating point, without some connections."""
        return self.joined.connected([c for c in self.connections if c not in cuts], step)


@dataclass(frozen=True)
class ForeignSubject:
    """An FMU without equations, or a system in which one is a member.

    Attributes
    ----------
    model : Model
        Of the FMU or the system.
    system : System
        For an FMU, one of a member without a name.
    """

    model: Model
    system: System

    def at(
        self,
        time: float,
        settings: Mapping[str, Value],
        instants: Array,
        driven: Signals,
        asked: set[str],
        step: float,
    ) -> MembersAtPoint:
        """Return the members, linearised about the operating point that they reach.

        Parameters
        ----------
        time : float
            Time of the operating point, s.
        settings : Mapping of str to float or str
            Values of parameters and constant inputs.
        instants : ndarray, shape (n,)
            Seconds.
        driven : Mapping of str to ndarray, shape (n,)
            Inputs that vary, held from each of the instants.
        asked : set of str
            Inputs and outputs that the linear model is to have; all if empty.
        step : float
            Communication step until then, and that of pulses, s.

        Raises
        ------
        UserError
            If the time is negative, a simulation fails, or a member cannot be linearised.
        """
        if not 0.0 <= time < np.inf:
            raise UserError(f"{option('at', f'{time:g}')}: a time from 0 s on")
        even = grid(0.0, time, step) if time else np.zeros(1)
        points = np.union1d(instants[instants <= time], even)
        latest = points_before(instants, points)
        known = self.model.inputs
        inputs = {n: np.full(points.size, float(v)) for n, v in settings.items() if n in known}
        inputs |= {name: values[latest] for name, values in driven.items()}
        parameters = {n: v for n, v in settings.items() if n not in known}
        members = self._members(parameters)
        received = self._received(members, points, inputs, step)
        parts = list(self._known_parts(parameters, points, received))
        wanted = self._ends | asked
        for prefix, (member, model) in members.items():
            if member.cls is None:
                request = FmuRequest(
                    model,
                    member.parameters,
                    points,
                    {name: received[f"{prefix}{name}"] for name in model.inputs},
                    _chosen(model.inputs, prefix, wanted),
                    _chosen(model.outputs, prefix, wanted),
                    step,
                    prefix,
                )
                with error_context(f"member {member.name}") if prefix else nullcontext():
                    parts.append(linearise_fmu(request))
        return self._connected(members, parts, received)

    @property
    def _ends(self) -> set[str]:
        """Inputs and outputs of members that are connected, inside the system or outside."""
        system = self.system
        ports = {port for c in system.connections for port in (c.source, c.target)}
        ports |= {port for _, port in system.fed_ports} | {*system.outputs.values()}
        return {str(port) for port in ports}

    def _members(self, parameters: Mapping[str, Value]) -> dict[str, tuple[Member, Model]]:
        """Return members with values of parameters, by what stands before their variables."""
        if self.model.system is None:
            return {"": (Member("", self.model.path, parameters), self.model)}
        members = self.system.given(parameters).members
        return {f"{member.name}.": (member, interface(member)) for member in members}

    def _received(
        self,
        members: Mapping[str, tuple[Member, Model]],
        points: Array,
        inputs: Signals,
        step: float,
    ) -> dict[str, Array]:
        """Run the system, and return what each input of a member receives at the points, (n,).

        Inputs are those of the system and of members, at the points. With a single point, a step
        of the given length follows.
        """
        received = {}
        for prefix, (member, model) in members.items():
            for name, signal in model.inputs.items():
                start = float(member.parameters.get(name, signal.start))
                received[f"{prefix}{name}"] = np.full(points.size, start)
        received |= inputs
        for name, port in self.system.fed_ports:
            received[str(port)] = inputs.get(name, received[str(port)])
        connections = self.system.connections
        if not connections:
            return received
        time = points if points.size > 1 else np.array([points[0], points[0] + step])
        run = master.run(
            replace(self.system, members=tuple(member for member, _ in members.values())),
            time,
            {name: np.resize(values, time.size) for name, values in inputs.items()},
            record=sorted({str(c.source) for c in connections}),
            method="jacobi",
        )
        if not run.complete:
            raise KeyboardInterrupt  # at which a master returns a part
        for connection in connections:
            sent = run.signals[str(connection.source)][: points.size]
            values = sent.copy()
            for value, other in connection.table:
                values[sent == value] = other
            received[str(connection.target)] = connection.factor * values + connection.offset
        return received

    @cached_property
    def _known(self) -> Equations | None:
        """Equations of the members whose laws are known, side by side; None without any."""
        members = tuple(m for m in self.system.members if m.cls is not None)
        if not members:
            return None
        return subject_of(
            replace(self.system, members=members, connections=(), inputs={}, outputs={})
        )

    def _known_parts(
        self, parameters: Mapping[str, Value], points: Array, received: Signals
    ) -> Iterator[LinearPart]:
        """Yield the members whose laws are known, linearised at the last of the points."""
        known = self._known
        if known is None:
            return
        layout = known.graph.layout
        names = {v.name for v in layout.parameters}
        own = {name: float(value) for name, value in parameters.items() if name in names}
        driven = {v.name: received[v.name] for v in layout.inputs}
        point = point_at(known.graph, float(points[-1]), own, driven, points, known.compiled)
        yield LinearPart(known.blocks(point, (), 0.0), known.complete(point), known.method)

    def _connected(
        self,
        members: Mapping[str, tuple[Member, Model]],
        parts: Sequence[LinearPart],
        received: Signals,
    ) -> MembersAtPoint:
        """Return members that are linearised, with the connections between real signals."""
        system = self.system
        blocks = joined([part.blocks for part in parts]).fed_by(system.inputs)
        groups = ("parameters", "inputs", "states", "discretes", "outputs", "rates")
        values = {name: reduce(or_, (getattr(one.point, name) for one in parts)) for name in groups}
        shown = values["outputs"]
        aliases = {alias: str(port) for alias, port in system.outputs.items()}
        outputs = {a: n for a, n in aliases.items() if n in shown} or {n: n for n in shown}
        shown |= {alias: shown[name] for alias, name in outputs.items()}
        values["inputs"] |= {n: float(received[str(port)][-1]) for n, port in system.fed_ports}
        real = {name for name, signal in self.model.inputs.items() if signal.type == "real"}
        units = {
            f"{prefix}{name}": unit
            for prefix, (_, model) in members.items()
            for name, unit in units_of(model).items()
        }
        units |= units_of(self.model)
        return MembersAtPoint(
            self.model.name,
            outputs,
            system,
            inputs=[name for name in blocks.inputs if name in real],
            units=units | {alias: units[name] for alias, name in outputs.items()},
            nominal=source_of(self.model).nominal,
            method=", ".join(dict.fromkeys(part.method for part in parts)),
            joined=blocks,
            point=OperatingPoint(parts[0].point.time, **values),
            is_held=any(part.is_held for part in parts),
            remarks=tuple(note for part in parts for note in part.notes),
        )


def _chosen(signals: Mapping[str, Signal], prefix: str, asked: set[str]) -> list[str]:
    """Return real signals of a member that are asked for; of an FMU alone all if none is."""
    real = [name for name, signal in signals.items() if signal.type == "real"]
    return [name for name in real if f"{prefix}{name}" in asked] or ([] if prefix else real)
