"""Reading of connections: between members, and to the connectors of the system."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, error_context
from orchestration.fmu.wrapping import MOST_ELEMENTS, DeclaredVariable, element_names
from orchestration.system.checking import interface
from orchestration.system.model import Connection, Member, Port
from orchestration.system.ssp.arrays import (
    element_at,
    enumeration_items,
    scalars,
    show_shape,
    variable_of,
)
from orchestration.system.ssp.declarations import check_type_and_unit
from orchestration.system.ssp.junctions import Junctions, connect
from orchestration.system.ssp.transformations import SIDES, compose, transformations
from orchestration.system.ssp.vocabulary import (
    NAMESPACES,
    attribute,
    check_exchanged,
    find_all,
)

# attribute of one end of a connection -> the same attribute of the other end
_OTHER_SIDE = {
    "startElement": "endElement",
    "startConnector": "endConnector",
    "startIndices": "endIndices",
    "endElement": "startElement",
    "endConnector": "startConnector",
    "endIndices": "startIndices",
}
_WHOLE = re.compile(r"[0-9]{1,18}")


@dataclass
class SystemConnectors:
    """Connectors of the system, and the ports of members to which they are connected.

    Attributes
    ----------
    declared : dict of str to DeclaredVariable
        Scalars and arrays, by the name of the connector.
    inputs : dict of str to list of Port
        Connected ports, by the name of a scalar or of an element of an array.
    outputs : dict of str to Port or None
        Connected port, likewise; None until its connection is read.
    """

    declared: dict[str, DeclaredVariable] = field(default_factory=dict)
    inputs: dict[str, list[Port]] = field(default_factory=dict)
    outputs: dict[str, Port | None] = field(default_factory=dict)

    def connected_outputs(self) -> dict[str, Port]:
        """Return the ports of all outputs.

        Raises
        ------
        UserError
            If one is not connected.
        """
        connected = {name: port for name, port in self.outputs.items() if port is not None}
        unconnected = self.outputs.keys() - connected.keys()
        if unconnected:
            raise UserError(f"system output {min(unconnected)} is connected with nothing")
        return connected

    def connect(self, source: Port, target: Port, where: str) -> None:
        """Add a connection to a connector of the system, whose port has an empty member.

        Raises
        ------
        UserError
            If neither end is a connector of the system, or an output has a source already; the
            message begins with `where`.
        """
        if not source.member and target.member and source.variable in self.inputs:
            self.inputs[source.variable].append(target)
            return
        if target.member or not source.member or target.variable not in self.outputs:
            raise UserError(f"{where}: leads from no input of the system, nor to an output of it")
        other = self.outputs[target.variable]
        if other is not None:
            raise UserError(
                f"{where}: system output {target.variable} has two sources, {other} is one"
            )
        self.outputs[target.variable] = source


def read_connections(
    parts: Sequence[Element],
    members: Mapping[str, Member],
    junctions: Junctions,
) -> tuple[list[Connection], SystemConnectors]:
    """Read the connections of a system, and its connectors.

    Parameters
    ----------
    parts : sequence of Element
        The ``System``, and the elements of annotations with further connectors and connections.
    members : Mapping of str to Member
    junctions : Mapping of str to Mapping of str to Element
        Connectors at which connections meet, see `junctions`.

    Returns
    -------
    list of Connection
        Connections between members, one for each element of arrays.
    SystemConnectors
        Connectors of the system with their ports.

    Raises
    ------
    UserError
        If a connector and its port differ in type or unit, or an end of a connection does not
        exist.
    """
    declared = find_all(parts, "ssd:Connectors/ssd:Connector")
    connectors = _read_system_connectors(declared)
    reader = _ConnectionReader(members, connectors)
    connections = [
        connection
        for wire in connect(
            find_all(parts, "ssd:Connections/ssd:Connection"), junctions, reader.receives
        )
        for connection in reader.read(wire)
    ]
    connectors.connected_outputs()  # refuses outputs without a connection
    for connector in declared:
        _check_system_connector(connector, members, connectors)
    return connections, connectors


def _read_system_connectors(declared: Sequence[Element]) -> SystemConnectors:
    """Read the connectors of the system, still without connections."""
    connectors = SystemConnectors()
    for connector in declared:
        name = attribute(connector, "name")
        kind = attribute(connector, "kind")
        where = f"connector {name!r} of the system"
        if kind not in ("input", "output"):
            raise UserError(f"{where} is {kind}; known: input, output")
        check_exchanged(connector, where)
        if name in connectors.declared:
            raise UserError(f"two connectors of the system are named {name!r}")
        shape = _read_shape(connector, where)
        elements = tuple(element_names(name, shape))
        connectors.declared[name] = DeclaredVariable("", shape, elements)
        if kind == "input":
            connectors.inputs |= {element: [] for element in elements}
        else:
            connectors.outputs |= dict.fromkeys(elements)
    return connectors


def _read_shape(connector: Element, where: str) -> tuple[int, ...]:
    """Return the shape of a connector of the system; UserError if it is not of known size."""
    texts = [node.get("size", "") for node in connector.iterfind("ssc:Dimension", NAMESPACES)]
    for text in texts:
        if _WHOLE.fullmatch(text) is None:
            raise UserError(
                f"{where} is an array with a dimension of size"
                f" {repr(text[:40]) if text else 'not stated'}; known are whole numbers"
            )
    shape = tuple(map(int, texts))
    if math.prod(shape) > MOST_ELEMENTS:
        raise UserError(f"{where} has {show_shape(shape)}; at most {MOST_ELEMENTS:,} are taken")
    return shape


def _check_system_connector(
    connector: Element, members: Mapping[str, Member], connectors: SystemConnectors
) -> None:
    """Raise UserError if a connector differs in type or unit from a port connected to it."""
    for element in connectors.declared[attribute(connector, "name")].elements:
        output = connectors.outputs.get(element)
        ports = connectors.inputs.get(element, [] if output is None else [output])
        for port in ports:
            scalar = scalars(members[port.member]).get(port.variable)
            if scalar is None:
                continue
            where = f"connector {element!r} of the system, that is {port},"
            check_type_and_unit(connector, scalar, where)


class _ConnectionReader:
    """Reader of connections between members and connectors of the system."""

    def __init__(self, members: Mapping[str, Member], connectors: SystemConnectors):
        self._members = members
        self._connectors = connectors

    def read(self, element: Element) -> list[Connection]:
        """Return the connections of members in an element, one for each element of arrays.

        A connection to a connector of the system is added there and not returned.
        """
        wire = self._with_source_first(element)
        start, end = (self._read_end(wire, side) for side in SIDES)
        where = f"connection {_show_wire(wire)}"
        if start.shape != end.shape:
            raise UserError(f"{where}: from {show_shape(start.shape)} to {show_shape(end.shape)}")
        pairs = zip(start.elements, end.elements, strict=True)
        source = wire.get("startElement")
        target = wire.get("endElement")
        if source is None or target is None:
            if any(element is not None for element in transformations(wire)):
                raise UserError(
                    f"{where}: a transformation at a connector of the system is not known"
                )
            for a, b in pairs:
                self._connectors.connect(Port(source or "", a), Port(target or "", b), where)
            return []
        with error_context(where):
            return [self._connection(wire, Port(source, a), Port(target, b)) for a, b in pairs]

    def _connection(self, wire: Element, source: Port, target: Port) -> Connection:
        """Return a connection with what it does to values, also by conversion of units."""
        output = interface(self._members[source.member]).outputs.get(source.variable)
        input_ = interface(self._members[target.member]).inputs.get(target.variable)
        if output is None or input_ is None:  # refused when the system is checked
            return Connection(source, target)
        items = [enumeration_items(self._members[p.member], p.variable) for p in (source, target)]
        return Connection(source, target, **compose(wire, output, input_, items))

    def _read_end(self, wire: Element, side: str) -> DeclaredVariable:
        """Return the variable at an end of a connection; one element of an array is a scalar.

        Raises
        ------
        UserError
            If there is no such member or element.
        """
        where = f"connection {_show_wire(wire)}"
        owner = wire.get(f"{side}Element")
        name = attribute(wire, f"{side}Connector")
        if owner is not None and owner not in self._members:
            raise UserError(f"{where}: there is no member named {owner!r}")
        if owner is not None:
            whole = variable_of(self._members[owner], name)
        else:
            whole = self._connectors.declared.get(name, DeclaredVariable("", (), (name,)))
        indices = wire.get(f"{side}Indices", "").split()
        if not indices:
            return whole
        if not all(map(_WHOLE.fullmatch, indices)):
            raise UserError(
                f"{where}: {side}Indices {' '.join(indices)[:40]!r} are no whole numbers"
            )
        with error_context(f"{where}: {name}"):
            element = element_at(whole, tuple(map(int, indices)))
        return DeclaredVariable(whole.kind, (), (element,))

    def _with_source_first(self, wire: Element) -> Element:
        """Return a connection whose start is its source, by exchanging start and end if needed.

        In SSP start and end do not give the direction, but the causality of the connectors does.
        """
        start, end = (self.receives(wire, side) for side in SIDES)
        if end or not start:
            return wire
        swapped = {_OTHER_SIDE.get(name, name): text for name, text in wire.attrib.items()}
        reversed_wire = Element(wire.tag, swapped)
        reversed_wire.extend(reversed(wire))  # its parts, if it has some
        return reversed_wire

    def receives(self, wire: Element, side: str) -> bool:
        """Return whether an end is a target: an input of a member or an output of the system."""
        owner = wire.get(f"{side}Element")
        name = wire.get(f"{side}Connector", "")
        if owner is None:
            declared = self._connectors.declared.get(name)
            elements = declared.elements[:1] if declared is not None else ()
            return any(element in self._connectors.outputs for element in elements)
        if owner not in self._members:
            return False
        known = scalars(self._members[owner])
        elements = variable_of(self._members[owner], name).elements[:1]
        return any(each in known and known[each].causality == "input" for each in elements)


def _show_wire(wire: Element) -> str:
    """Return the ends of a connection as in the file, for a message."""
    ends = []
    for side in SIDES:
        names = [wire.get(f"{side}Element"), wire.get(f"{side}Connector")]
        ends.append(".".join(name for name in names if name is not None))
    return " -> ".join(ends)
