"""Variables of FMUs of FMI 3.0 in a system: types and arrays, which SSP 2.0 has and SSP 1.0 not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from orchestration.fmu import Archive, DeclaredVariable
from orchestration.system.model import Connection, Member, Port


class Wire(NamedTuple):
    """A connection as SSP has it: of two whole variables, or of two elements.

    Attributes
    ----------
    source, target : Port
        Whole variables, or elements under names that only this program knows.
    connection : Connection
        The connection, or the first of those of all elements.
    """

    source: Port
    target: Port
    connection: Connection


def declared(member: Member) -> dict[str, DeclaredVariable]:
    """Return the variables of a member by name, nothing of one of FMI 2.0.

    Raises
    ------
    UserError
        If its FMU cannot be read.
    """
    path = member.fmu.absolute()
    return _read(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _read(path: Path, modified: int) -> dict[str, DeclaredVariable]:
    """Read an FMU once for each time at which its file was modified."""
    with Archive(path) as archive:
        return archive.declared


def variable_of(member: Member, element: str) -> tuple[str, DeclaredVariable] | None:
    """Return the variable of FMI 3.0 to which an element belongs, and its name."""
    variables = declared(member)
    if element in variables:
        return element, variables[element]
    name = element.rpartition("[")[0]
    found = variables.get(name)
    return (name, found) if found is not None and element in found.elements else None


def elements(member: Member, name: str) -> tuple[str, ...]:
    """Return the elements of a variable; the name itself where it is no array of FMI 3.0."""
    found = declared(member).get(name)
    return (name,) if found is None else found.elements


def wires(connections: Sequence[Connection], members: Mapping[str, Member]) -> list[Wire]:
    """Return connections, with those of all elements of two arrays as one.

    Parameters
    ----------
    connections : sequence of Connection
    members : Mapping of str to Member

    Returns
    -------
    list of Wire
        In the order of the connections.
    """
    plain = {
        (connection.source, connection.target): connection
        for connection in connections
        if connection.passes_on
    }
    found = []
    done: set[Port] = set()
    for connection in connections:
        if connection.target in done:
            continue
        whole = _whole(connection, members)
        parts = _elementwise(*whole, members) if whole is not None else []
        if whole is not None and len(parts) > 1 and all(part in plain for part in parts):
            found.append(Wire(*whole, connection))
            done.update(target for _, target in parts)
        else:
            found.append(Wire(connection.source, connection.target, connection))
    return found


def _whole(connection: Connection, members: Mapping[str, Member]) -> tuple[Port, Port] | None:
    """Return the two arrays of which a connection joins elements, if they are of one shape."""
    ports = []
    shapes = []
    for port in (connection.source, connection.target):
        variable = variable_of(members[port.member], port.variable)
        if variable is None:
            return None
        ports.append(Port(port.member, variable[0]))
        shapes.append(variable[1].shape)
    return (ports[0], ports[1]) if shapes[0] == shapes[1] else None


def _elementwise(
    source: Port, target: Port, members: Mapping[str, Member]
) -> list[tuple[Port, Port]]:
    """Return the pairs of elements of two variables."""
    return [
        (Port(source.member, a), Port(target.member, b))
        for a, b in zip(
            elements(members[source.member], source.variable),
            elements(members[target.member], target.variable),
            strict=True,
        )
    ]
