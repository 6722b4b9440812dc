"""Parts of a system: members that are cut at their ports, and members that cannot be cut apart.

An input is what was measured at it, or at the output that feeds it. Where neither was measured, the
member and the one that feeds it are one part, which is closed there by their equations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from fmus.kit import Component
from fmus.kit.arrays import Array
from orchestration.fmu import Model, Signal
from orchestration.fmu.model import declared_model, declared_model_of
from orchestration.system import Connection, Member, Port, System, interface


class InputOrigin(StrEnum):
    """Origin of the values of an input."""

    MEASURED = "measured"  # at the input itself
    UPSTREAM = "upstream"  # measured at the output that feeds it
    LOOP = "computed"  # by the member that feeds it
    SETTING = "setting"  # of the user
    DEFAULT = "value in the system"


@dataclass(frozen=True)
class InputSource:
    """Source of an input of a member while it is judged.

    Attributes
    ----------
    origin : InputOrigin
    signal : Port or None
        Where it was measured or is computed; None if it stays at a value.
    values : ndarray, shape (n,), or None
        Measured, in the unit of the input.
    value : float or None
        At which it stays.
    """

    origin: InputOrigin
    signal: Port | None = None
    values: Array | None = None
    value: float | None = None


@dataclass(frozen=True)
class Part:
    """Members that are judged together, with what was measured of them.

    Attributes
    ----------
    members : tuple of Member
        In the order of the system.
    connections : tuple of Connection
        Along which the one computes what the other receives; empty of a member that is cut.
    inputs : dict of Port to InputSource
    outputs : dict of Port to ndarray, shape (n,)
        Measured, in their units; NaN where nothing was.
    missing : tuple of tuple of str
        Inputs of which nothing is known, each with the signal to measure.
    hold : tuple of Port
        Parameters of the members that keep their values.
    """

    members: tuple[Member, ...]
    connections: tuple[Connection, ...]
    inputs: dict[Port, InputSource]
    outputs: dict[Port, Array]
    missing: tuple[tuple[str, str], ...]
    hold: tuple[Port, ...] = ()

    @property
    def names(self) -> list[str]:
        """Names of the members."""
        return [member.name for member in self.members]

    @property
    def label(self) -> str:
        """Names of the members in one text."""
        return " with ".join(self.names)

    @cached_property
    def models(self) -> dict[str, Model]:
        """The model of each member, with its class if its equations are known."""
        return {member.name: model_of(member) for member in self.members}

    @property
    def classes(self) -> dict[str, type[Component]] | None:
        """The class of each member; None unless the equations of all are known."""
        known = {name: model.cls for name, model in self.models.items()}
        classes = {n: cls for n, cls in known.items() if cls is not None and cls.engine is None}
        return classes if len(classes) == len(known) else None


def model_of(member: Member) -> Model:
    """Return the model of a member, with its class if its equations are known."""
    if member.cls is not None:
        return declared_model_of(member.cls)
    return declared_model(str(member.fmu))


class Cuts:
    """A system cut at its measured signals.

    Parameters
    ----------
    system : System
    measured : Mapping of Port to ndarray, shape (n,)
    given : Mapping of Port to float
        Values of inputs that are known to have stayed where they were.
    hold : sequence of Port
        Parameters that keep their values.
    """

    def __init__(
        self,
        system: System,
        measured: Mapping[Port, Array],
        given: Mapping[Port, float],
        hold: Sequence[Port] = (),
    ) -> None:
        self.system = system
        self._hold = hold
        self._known = _known_ports(system, measured)
        self._given = given
        self._feeding = {c.target: c for c in system.connections}
        self._outer = {port: name for name, port in system.fed_ports}

    def parts(self) -> list[Part]:
        """Return the smallest parts whose inputs are known, in the order of the system."""
        groups = {member.name: {member.name} for member in self.system.members}
        for connection in self.system.connections:
            if self._is_unknown(connection):
                joined = groups[connection.source.member] | groups[connection.target.member]
                groups |= dict.fromkeys(joined, joined)
        return self._parts(groups)

    def closed(self, parts: Sequence[Part], open_ones: Sequence[str]) -> list[Part]:
        """Return parts of which some members are closed in the loops that they are in.

        Parameters
        ----------
        parts : sequence of Part
        open_ones : sequence of str
            Members that cannot be judged where they were cut.
        """
        groups = {name: set(part.names) for part in parts for name in part.names}
        for name in open_ones:
            joined = set.union(*(groups[other] for other in (name, *self.loop_members(name))))
            groups |= dict.fromkeys(joined, joined)
        return self._parts(groups)

    def loop_members(self, name: str) -> list[str]:
        """Return the other members that a member feeds, directly or not, and is fed by."""
        fed = _reached(name, [(c.source.member, c.target.member) for c in self.system.connections])
        feeding = _reached(
            name, [(c.target.member, c.source.member) for c in self.system.connections]
        )
        return [m.name for m in self.system.members if m.name in (fed & feeding) - {name}]

    def fed_by_loops(self, part: Part) -> list[str]:
        """Return the members of a part that others of their loops feed, which are in none of it."""
        feeding = {
            port: self._feeding[port].source.member for port in part.inputs if port in self._feeding
        }
        return [
            name
            for name in part.names
            if any(
                port.member == name and other in self.loop_members(name) and other not in part.names
                for port, other in feeding.items()
            )
        ]

    def _is_unknown(self, connection: Connection) -> bool:
        """Return whether nothing tells what a connection carried."""
        target = connection.target
        return self._measured_at(target) is None and target not in self._given

    def _measured_at(self, port: Port) -> tuple[InputOrigin, Port, Array] | None:
        """Return where an input was measured without gaps, and its values there."""
        values = self._known.get(port)
        if values is not None and np.isfinite(values).all():
            return InputOrigin.MEASURED, port, values
        connection = self._feeding.get(port)
        if connection is None:
            return None
        values = self._known.get(connection.source)
        if values is None or not np.isfinite(values).all():
            return None
        carried = connection.factor * values + connection.offset
        return InputOrigin.UPSTREAM, connection.source, carried

    def _parts(self, groups: Mapping[str, set[str]]) -> list[Part]:
        members = {member.name: member for member in self.system.members}
        distinct = {tuple(n for n in members if n in groups[name]): None for name in members}
        return [self._part([members[name] for name in names]) for names in distinct]

    def _part(self, members: Sequence[Member]) -> Part:
        """Return members with what feeds them, and what is measured of them."""
        names = {member.name for member in members}
        inside = tuple(
            c
            for c in self.system.connections
            if {c.source.member, c.target.member} <= names and len(names) > 1
        )
        computed = {c.target: c.source for c in inside}
        inputs: dict[Port, InputSource] = {}
        missing: list[tuple[str, str]] = []
        for member in members:
            for name, signal in interface(member).inputs.items():
                port = Port(member.name, name)
                source = self._source(port, member, signal, computed)
                if source is not None:
                    inputs[port] = source
                else:
                    connection = self._feeding.get(port)
                    absent = str(connection.source) if connection else self._outer[port]
                    missing.append((name, absent))
        outputs = dict(self._measured(members))
        hold = tuple(port for port in self._hold if port.member in names)
        return Part(tuple(members), inside, inputs, outputs, tuple(missing), hold)

    def _measured(self, members: Sequence[Member]) -> Iterator[tuple[Port, Array]]:
        """Yield outputs of members that are measured, with their values (n,)."""
        for member in members:
            for name, signal in interface(member).outputs.items():
                port = Port(member.name, name)
                values = self._known.get(port)
                if signal.type == "real" and values is not None and np.isfinite(values).any():
                    yield port, values

    def _source(
        self, port: Port, member: Member, signal: Signal, computed: Mapping[Port, Port]
    ) -> InputSource | None:
        """Return the source of an input: of a connection within a part what it carries.

        An input of the system has to be measured or given, but for a switch that nobody touched.
        """
        if port in computed:
            return InputSource(InputOrigin.LOOP, computed[port])
        found = self._measured_at(port)
        if found is not None:
            return InputSource(*found)
        if port in self._given:
            return InputSource(InputOrigin.SETTING, value=self._given[port])
        if port in self._feeding or (port in self._outer and signal.type != "boolean"):
            return None
        value = float(member.parameters.get(port.variable, signal.start or 0.0))
        return InputSource(InputOrigin.DEFAULT, value=value)


def _known_ports(system: System, measured: Mapping[Port, Array]) -> dict[Port, Array]:
    """Return what was measured, also of outputs at the inputs where they arrive."""
    known = dict(measured)
    for connection in system.connections:
        source, target = connection.source, connection.target
        if source not in known and target in known and connection.factor:
            known[source] = (known[target] - connection.offset) / connection.factor
    for ports in system.inputs.values():
        values = next((known[port] for port in ports if port in known), None)
        if values is not None:
            known |= {port: values for port in ports if port not in known}
    return known


def _reached(name: str, edges: Sequence[tuple[str, str]]) -> set[str]:
    """Return what can be reached from a node of a graph."""
    reached: set[str] = set()
    waiting = [name]
    while waiting:
        here = waiting.pop()
        for source, target in edges:
            if source == here and target not in reached:
                reached.add(target)
                waiting.append(target)
    return reached
