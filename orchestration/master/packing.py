"""Packing of a system into one FMU, which does in compiled C what the master does.

The operations are those of the master's own schedule, in its order: each communication step of the
FMU equals that of a run with default options. Members are computed by the engine of their FMUs, and
those without equations by their own libraries, which lie in the resources of the FMU.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, TypeVar

import casadi as ca

from fmus.kit import Component, UserError, quoting
from fmus.kit.build import build
from fmus.kit.declare import (
    Declaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    name_declaration,
)
from fmus.kit.errors import error_context
from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import Layout
from fmus.kit.symbolic import Graph, packing, trace
from orchestration.fmu import Value
from orchestration.fmu.model import declared_model
from orchestration.master import dependency_graph as structures
from orchestration.master.buffers import BufferTransfer
from orchestration.master.executor import Executor
from orchestration.master.fmu_members import common_platforms, fmu_members, no_law
from orchestration.master.instances import STEP, CommunicationStep
from orchestration.master.schedule import ExchangeStage, MasterSettings, MemberCall, PlainStep
from orchestration.master.setup import make_structure, open_members
from orchestration.system import Member, Port, System, check

COMMUNICATION_STEP = "communication_step"  # name of the parameter for it
_SETTINGS = MasterSettings(
    sequential=True, extrapolation=0, feedthrough=True, adaptive=False, rates={}
)
_SHARED = ("unit", "doc", "min", "max", "nominal", "display", "type", "source")
_D = TypeVar("_D", bound=Declaration)


def pack(
    system: System,
    platforms: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> bytes:
    """Pack a system into one FMU of FMI 2.0 for co-simulation.

    Parameters
    ----------
    system : System
    platforms : sequence of str, optional
        FMI platforms; by default all that an installed compiler can serve.
    progress : callable
        Called with a short message at each step.

    Returns
    -------
    bytes
        The archive. Its inputs and outputs are those of the system; without any of its own it has
        the outputs of all members as ``member.output``. Its parameters are those of the members,
        ``member.parameter``, inputs that nothing feeds, and the communication step.

    Raises
    ------
    UserError
        If the system does not pass its check, a member stands for a device, or has no equations and
        is not for co-simulation of FMI 2.0 or has no binary for a platform, an algebraic loop has
        variables that are no real numbers, or a platform fails.
    """
    check(system)
    with error_context(f"system {system.name}"):
        classes = {member.name: _class_of(member) for member in system.members}
        traced = {cls: trace(cls) for cls in dict.fromkeys(classes.values()) if cls}
        fmus = fmu_members(system, [name for name, cls in classes.items() if cls is None])
        parts = {name: fmus[name] if cls is None else traced[cls] for name, cls in classes.items()}
        whole = _Whole(system, parts)
        targets = common_platforms(fmus, platforms)
        return build(whole.component(), "native", targets, progress, packed=whole.packed())


def _class_of(member: Member) -> type[Component] | None:
    """Return the class of a member, None without equations; UserError if it stands for a device."""
    cls = member.cls or declared_model(str(member.fmu)).cls
    if cls is not None and cls.engine is not None:
        raise UserError(
            f"member {member.name} ({cls.name}) cannot be packed, as it stands for a device and has"
            " no equations; put a model in its place"
        )
    return cls


def _declared(kind: type[_D], variable: Declaration, name: str, **more: Any) -> _D:
    """Return a declaration of another kind and name with what all kinds have in common."""
    common = {field: getattr(variable, field) for field in _SHARED}
    return name_declaration(kind(**common, **more), name)


class _Whole:
    """A system as one model: its variables, and the master's schedule as operations.

    Parameters
    ----------
    system : System
    parts : Mapping of str to Graph or FmuMember
        By member.
    """

    def __init__(self, system: System, parts: Mapping[str, Graph | packing.FmuMember]):
        self._system = system
        self._parts = parts
        self._declarations = {
            Port(name, v.name): v for name, part in parts.items() for v in part.layout.variables
        }
        fed = {connection.target for connection in system.connections}
        fed |= {port for _, port in system.fed_ports}
        # in the order of the declarations, as the parameters of the whole
        self._constants = [
            port
            for port, v in self._declarations.items()
            if isinstance(v, ParameterDeclaration)
            or (isinstance(v, InputDeclaration) and port not in fed)
        ]
        self._outputs = dict(system.outputs) or {
            str(Port(name, v.name)): Port(name, v.name)
            for name, part in parts.items()
            for v in part.layout.shown
        }
        self._check_names()

    def _check_names(self) -> None:
        """Raise UserError if an input or output has the name of a parameter."""
        taken = {COMMUNICATION_STEP, *map(str, self._constants)}
        for name in (*self._system.inputs, *self._system.outputs):
            if name in taken:
                raise UserError(f"a connector of it has the name of the parameter {name!r}")

    def _start(self, port: Port) -> Value:
        declared: Any = self._declarations[port]
        given = self._system.member(port.member).parameters
        return given.get(port.variable, declared.start)

    def _constant(self, port: Port) -> ParameterDeclaration:
        """Return the parameter for one of a member, or for an input that nothing feeds."""
        declared = self._declarations[port]
        tunable = getattr(declared, "tunable", True)
        start = self._start(port)
        return _declared(ParameterDeclaration, declared, str(port), start=start, tunable=tunable)

    def _layout(self) -> Layout:
        step = ParameterDeclaration(
            start=self._system.step,
            unit="s",
            doc="longest time between two exchanges of values among the members",
            min=1e-12,
        )
        constants = [self._constant(port) for port in self._constants]
        inputs = [
            _declared(
                InputDeclaration, self._declarations[ports[0]], name, start=self._start(ports[0])
            )
            for name, ports in self._system.inputs.items()
            if ports
        ]
        outputs = [
            _declared(OutputDeclaration, self._declarations[port], name, law=no_law)
            for name, port in self._outputs.items()
        ]
        parameters = (name_declaration(step, COMMUNICATION_STEP), *constants)
        return Layout(parameters, tuple(inputs), (), (), tuple(outputs))

    def component(self) -> type[Component]:
        """Return a class with name, documentation and default experiment of the system."""
        system = self._system
        members = [
            f"- `{member.name}`: {self._parts[member.name].name}" for member in system.members
        ]
        connections = [f"- {c} {c.transformation}".rstrip() for c in system.connections]
        doc = "\n".join([system.doc or f"System {system.name}.", "", *members, "", *connections])
        name = quoting.identifier(system.name, "system")
        often = f"{COMMUNICATION_STEP}, {system.step:g} s by default"
        body = {
            "name": name,
            "remark": f"Members exchange values every {often}",
            "experiment": (system.stop, system.step),
            "tolerance": self._tolerance,
            "__doc__": doc,
            "__module__": __name__,
        }
        cls: type[Component] = type(name, (Component,), body)
        cls.layout = self._layout()
        return cls

    @property
    def _tolerance(self) -> float:
        # the largest, as a host may ask each member for more accuracy than its own
        declared = [part.tolerance for part in self._parts.values() if part.tolerance > 0.0]
        return max(declared, default=Component.tolerance)

    @uninterrupted()
    def packed(self) -> packing.PackedSystem:
        """Return the whole with the operations of its master.

        Raises
        ------
        UserError
            If a member cannot be opened, or an algebraic loop cannot be solved.
        """
        with ExitStack() as opened:
            members = open_members(self._system, opened)
            record = [str(port) for port in self._outputs.values()]
            external: dict[Port, Sequence[float]] = {port: [] for _, port in self._system.fed_ports}
            structure, _ = make_structure(self._system, members, list(external), record, _SETTINGS)
            executor = Executor(
                members,
                structure,
                self._system.connections,
                external=external,
                disturbances={},
                settings=_SETTINGS,
                present_step=CommunicationStep(),
            )
            layout = self._layout()
            places = packing.Places(list(self._parts.values()), len(executor.outputs.at))
            index = {name: str(i) for i, name in enumerate(layout.names)}
            translation = _Translation(self._system, executor, self._parts, places, index)
            program = translation.program(self._constants, self._outputs)
        graph = self._graph_of(layout, structure)
        return packing.PackedSystem(graph, self._parts, places, program)

    def _graph_of(self, layout: Layout, structure: structures.Structure) -> Graph:
        """Return a graph with the dependencies of the outputs; it has no values of these."""
        parameters = ca.SX.sym("parameters", len(layout.parameters))
        inputs = ca.SX.sym("inputs", len(layout.inputs))
        symbols = {v.name: inputs[i] for i, v in enumerate(layout.inputs)}
        fed = {port: symbols[name] for name, port in self._system.fed_ports}
        outputs = [
            ca.sum1(parameters)
            + sum(fed[port] for port in _reached(structure, source) if port in fed)
            for source in self._outputs.values()
        ]
        none = ca.SX(0, 1)
        return Graph(
            name=quoting.identifier(self._system.name, "system"),
            tolerance=self._tolerance,
            layout=layout,
            time=ca.SX.sym("time"),
            parameters=parameters,
            inputs=inputs,
            states=none,
            discretes=none,
            rates=none,
            outputs=ca.vertcat(none, *outputs),
            updates=(),
            restorable=all(isinstance(part, Graph) for part in self._parts.values()),
        )


def _reached(structure: structures.Structure, output: Port) -> set[Port]:
    """Return the inputs of members on which an output depends without delay."""
    found: set[Port] = set()
    waiting = [output]
    while waiting:
        for port in structure.feedthrough[waiting.pop()]:
            if port not in found:
                found.add(port)
                waiting += [structure.sources[port]] if port in structure.sources else []
    return found


class _Translation:
    """The translation of a master's schedule to operations.

    Parameters
    ----------
    system : System
    executor : Executor
    parts : Mapping of str to Graph or FmuMember
        By member.
    places : Places
    index : Mapping of str to str
        Places of the variables of the whole.
    """

    def __init__(
        self,
        system: System,
        executor: Executor,
        parts: Mapping[str, Graph | packing.FmuMember],
        places: packing.Places,
        index: Mapping[str, str],
    ):
        self._executor = executor
        self._places = places
        self._index = index
        self._numbers = {member.name: k for k, member in enumerate(executor.members)}
        self._computed = {
            Port(name, v.name) for name, part in parts.items() for v in part.layout.outputs
        }
        self._connections = {connection.target: connection for connection in system.connections}
        self._inputs = {port: name for name, port in system.fed_ports}
        self._written = list(executor.inputs.at)  # by place in the buffer
        self._solved = 0  # loops in the schedule until here

    def program(self, constants: Sequence[Port], outputs: Mapping[str, Port]) -> packing.Program:
        """Return the whole schedule.

        Parameters
        ----------
        constants : sequence of Port
            Parameters of members, and inputs that nothing feeds.
        outputs : Mapping of str to Port
            Outputs of the whole.
        """
        complete = self._executor.complete
        calls = [call for _, of_member in complete.steps for call in of_member]
        readings = [call for call in calls if call.request != STEP]
        exchange = [o for stage in complete.stages for o in self._stage(stage)]
        exchange += [
            packing.Operation("COPY", 0, self._index[name], self._read(port))
            for name, port in outputs.items()
        ]
        return packing.Program(
            parameters=[
                packing.Operation("COPY", 0, self._variable(port), self._index[str(port)])
                for port in constants
            ],
            readings=[o for call in readings for o in self._call(call)],
            steps=[o for call in calls for o in self._call(call)],
            exchange=exchange,
            loops=[self._loop(loop) for loop, _ in self._executor.loops],
        )

    def _variable(self, port: Port) -> str:
        return self._places.variable(self._numbers[port.member], port.variable)

    def _read(self, port: Port) -> str:
        return self._places.read(self._executor.outputs.at[port])

    def _stage(self, stage: ExchangeStage) -> Iterator[packing.Operation]:
        """Yield the values that inputs receive, then the calls; inputs are set where they stand."""
        targets = [target for target, _ in stage.copies] + [c.target for c in stage.scaled]
        for target in targets:
            yield from self._link(self._written[target])
        for target, _ in stage.external:
            port = self._written[target]
            yield packing.Operation(
                "COPY", 0, self._variable(port), self._index[self._inputs[port]]
            )
        for call in stage.calls:
            yield from self._call(call)

    def _link(self, port: Port) -> Iterator[packing.Operation]:
        """Yield the copy that a connected input receives, and the table of its connection."""
        connection = self._connections[port]
        target, source = self._variable(port), self._read(connection.source)
        yield packing.Operation("COPY", 0, target, source, connection.factor, connection.offset)
        for value, received in connection.table:
            yield packing.Operation("MAP", 0, target, source, value, received)

    def _call(self, call: MemberCall) -> Iterator[packing.Operation]:
        operation = call.operation
        number = self._numbers[call.member.name]
        if isinstance(operation, ExchangeStage):
            yield from self._stage(operation)
        elif isinstance(operation, PlainStep):
            yield packing.Operation("STEP", number)
        elif isinstance(operation, BufferTransfer) and operation.verb == "Get":
            yield from self._reading(number, operation.ports)
        elif call.request == "solving":
            yield packing.Operation("SOLVE", self._solved)
            self._solved += 1

    def _reading(self, number: int, ports: Sequence[Port]) -> Iterator[packing.Operation]:
        """Yield the reading of outputs of a member; states need no evaluation."""
        if not self._computed.isdisjoint(ports):
            yield packing.Operation("EVALUATE", number)
        for port in ports:
            yield packing.Operation("COPY", 0, self._read(port), self._variable(port))

    def _loop(self, loop: structures.Loop) -> packing.Loop:
        """Return a loop; UserError if its variables are no real numbers."""
        name = structures.describe_loop(loop)
        links = [o for port in loop.inputs for o in self._link(port)]
        members = {member.name: member for member in self._executor.members}
        if any(o.action == "MAP" for o in links):
            raise UserError(f"{name}: it cannot be packed, as a value in it is no real number")
        by_member = {
            owner: [port for port in loop.outputs if port.member == owner] for owner in members
        }
        around = [
            o
            for owner, ports in by_member.items()
            for o in self._reading(self._numbers[owner], ports)
        ]
        scale = [members[port.member].nominal(port.variable) for port in loop.inputs]
        return packing.Loop(name, links, around, scale)
