"""Reading of connections: between members, and to the connectors of the system."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, error_context, find
from orchestration.fmu.wrapping import MOST_ELEMENTS, DeclaredVariable, element_names
from orchestration.system.checking import interface
from orchestration.system.model import Connection, Member, Port
from orchestration.system.ssp.arrays import (
    End,
    element_at,
    enumeration_items,
    scalars,
    show_shape,
    variable_of,
)
from orchestration.system.ssp.declarations import check_type_and_unit
from orchestration.system.ssp.flattening import Structure
from orchestration.system.ssp.junctions import DeclaredConnection, join
from orchestration.system.ssp.transformations import compose
from orchestration.system.ssp.vocabulary import NAMESPACES, WHOLE, attribute, check_exchanged


@dataclass(frozen=True)
class SystemConnector:
    """A scalar connector of the system, or an element of an array.

    Attributes
    ----------
    declaration : Element
    kind : {"input", "output"}
    ports : list of Port
        Ports of members that it is connected to.
    """

    declaration: Element
    kind: str
    ports: list[Port] = field(default_factory=list)


def read_connections(
    structure: Structure, members: Mapping[str, Member]
) -> tuple[list[Connection], dict[str, SystemConnector]]:
    """Read the connections of a system, and its connectors.

    Parameters
    ----------
    structure : Structure
    members : Mapping of str to Member

    Returns
    -------
    list of Connection
        Connections between members, one for each element of arrays.
    dict of str to SystemConnector
        Connectors of the system by name, likewise; outputs have one port.

    Raises
    ------
    UserError
        If a connector and its port differ in type or unit, an end of a connection does not exist,
        or an output of the system is not connected.
    """
    reader = _ConnectionReader(members, structure.connectors)
    connections = [
        connection
        for declared in join(structure.connections, structure.junctions, reader.receives)
        for connection in reader.read(declared)
    ]
    for name, connector in reader.connectors.items():
        if connector.kind == "output" and not connector.ports:
            raise UserError(f"system output {name} is connected with nothing")
        for port in connector.ports:
            scalar = scalars(members[port.member]).get(port.variable)
            if scalar is not None:
                where = f"connector {name!r} of the system, that is {port},"
                check_type_and_unit(connector.declaration, scalar, where)
    return connections, reader.connectors


def _read_shape(connector: Element, where: str) -> tuple[int, ...]:
    """Return the shape of a connector of the system; UserError if it is not of known size."""
    texts = [node.get("size", "") for node in connector.iterfind("ssc:Dimension", NAMESPACES)]
    for text in texts:
        if WHOLE.fullmatch(text) is None:
            raise UserError(
                f"{where} is an array with a dimension of size"
                f" {repr(text[:40]) if text else 'not stated'}; known are whole numbers"
            )
    shape = tuple(map(int, texts))
    if math.prod(shape) > MOST_ELEMENTS:
        raise UserError(f"{where} has {show_shape(shape)}; at most {MOST_ELEMENTS:,} are taken")
    return shape


class _ConnectionReader:
    """Reader of connections between members and connectors of the system.

    Attributes
    ----------
    connectors : dict of str to SystemConnector
        With the ports of the connections that were read.
    """

    def __init__(self, members: Mapping[str, Member], declarations: Sequence[Element]):
        self.connectors: dict[str, SystemConnector] = {}
        self._members = members
        self._variables: dict[str, DeclaredVariable] = {}  # of the system
        for declaration in declarations:
            self._add_connector(declaration)

    def _add_connector(self, declaration: Element) -> None:
        name = attribute(declaration, "name")
        kind = attribute(declaration, "kind")
        where = f"connector {name!r} of the system"
        if kind not in ("input", "output"):
            raise UserError(f"{where} is {kind}; known: input, output")
        check_exchanged(declaration, where)
        if name in self._variables:
            raise UserError(f"two connectors of the system are named {name!r}")
        shape = _read_shape(declaration, where)
        elements = tuple(element_names(name, shape))
        self._variables[name] = DeclaredVariable("", shape, elements)
        for element in elements:
            self.connectors[element] = SystemConnector(declaration, kind)

    def read(self, declared: DeclaredConnection) -> list[Connection]:
        """Return the connections of members in one declared, one for each element of arrays.

        A connection to a connector of the system is added there and not returned.
        """
        # in SSP the causality of the connectors gives the direction, not start and end
        if self.receives(declared.start) and not self.receives(declared.end):
            declared = declared.turned()
        source, target = declared.start.member, declared.end.member
        with error_context(str(declared)):
            start, end = self._at(declared.start), self._at(declared.end)
            if start.shape != end.shape:
                raise UserError(f"from {show_shape(start.shape)} to {show_shape(end.shape)}")
            pairs = [
                (Port(source, a), Port(target, b))
                for a, b in zip(start.elements, end.elements, strict=True)
            ]
            if source and target:
                return [self._connection(declared, *pair) for pair in pairs]
            if any(step.linear or step.mapping is not None for step in declared.steps):
                raise UserError("a transformation at a connector of the system is not known")
            for pair in pairs:
                self._connect_system(*pair)
        return []

    def _connection(self, declared: DeclaredConnection, source: Port, target: Port) -> Connection:
        """Return a connection with what it does to values, also by conversion of units."""
        output = interface(self._members[source.member]).outputs.get(source.variable)
        input_ = interface(self._members[target.member]).inputs.get(target.variable)
        if output is None or input_ is None:  # refused when the system is checked
            return Connection(source, target)
        items = [enumeration_items(self._members[p.member], p.variable) for p in (source, target)]
        return Connection(source, target, *compose(declared, output, input_, items))

    def _connect_system(self, source: Port, target: Port) -> None:
        """Add a connection to a connector of the system, whose port has an empty member."""
        kind, own, port = ("output", target, source) if source.member else ("input", source, target)
        connector = self.connectors.get(own.variable)
        if own.member or not port.member or connector is None or connector.kind != kind:
            raise UserError("leads from no input of the system, nor to an output of it")
        if kind == "output" and connector.ports:
            raise UserError(
                f"system output {own.variable} has two sources, {connector.ports[0]} is one"
            )
        connector.ports.append(port)

    def _whole(self, end: End) -> DeclaredVariable:
        """Return the variable of an end without its indices."""
        if not end.member:
            return self._variables.get(end.connector, DeclaredVariable("", (), (end.connector,)))
        member = find(end.member, self._members, "there is no member")
        return variable_of(member, end.connector)

    def _at(self, end: End) -> DeclaredVariable:
        """Return the variable at an end; one element of an array is a scalar."""
        whole = self._whole(end)
        if not end.indices:
            return whole
        with error_context(end.connector):
            return DeclaredVariable(whole.kind, (), (element_at(whole, end.indices),))

    def receives(self, end: End) -> bool:
        """Return whether an end is a target: an input of a member or an output of the system."""
        if end.member and end.member not in self._members:
            return False
        for element in self._whole(end).elements[:1]:
            if not end.member:
                return element in self.connectors and self.connectors[element].kind == "output"
            scalar = scalars(self._members[end.member]).get(element)
            return scalar is not None and scalar.causality == "input"
        return False
