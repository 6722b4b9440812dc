"""Variables of members in SSP: scalars, whole arrays with types and sizes, and single elements."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import UserError
from orchestration.fmu import Archive, read_description
from orchestration.fmu.wrapping import DeclaredVariable
from orchestration.system.model import UNCHANGED, Connection, Member
from orchestration.system.ssp.vocabulary import path_of


class End(NamedTuple):
    """An end of a connection.

    Attributes
    ----------
    member : str
        Empty for a connector of the system.
    connector : str
    indices : tuple of int
        Indices of an element of an array, from 1; empty for the whole connector.
    """

    member: str
    connector: str
    indices: tuple[int, ...] = ()

    def __str__(self) -> str:
        return path_of(self.member, self.connector)


class Wire(NamedTuple):
    """Connection of two whole variables or of two elements.

    Attributes
    ----------
    source, target : End
    change : tuple
        As in `Connection`.
    is_boolean : bool
        Whether the values are booleans.
    """

    source: End
    target: End
    change: tuple[Any, ...] = UNCHANGED
    is_boolean: bool = False

    @property
    def passes_on(self) -> bool:
        """True if the target receives the value unchanged."""
        return self.change == UNCHANGED


class _Variables(NamedTuple):
    """The variables of an FMU.

    Attributes
    ----------
    scalars : dict of str to Any
        Scalar variables of fmpy by name.
    declared : dict of str to DeclaredVariable
        Variables of FMI 3.0 by name.
    places : dict of str to tuple
        Variable of FMI 3.0 and indices from 1, by the name of an element.
    """

    scalars: dict[str, Any]
    declared: dict[str, DeclaredVariable]
    places: dict[str, tuple[str, tuple[int, ...]]]


def _variables(member: Member) -> _Variables:
    return _read(*member.version)


@lru_cache(maxsize=64)
def _read(path: Path, modified: int) -> _Variables:
    """Read the variables of an FMU; `modified`, ns, makes the cache valid for this file only."""
    with Archive(path) as archive:
        declared = archive.declared
    places = {
        element: (name, tuple(index + 1 for index in indices))
        for name, variable in declared.items()
        for element, indices in zip(variable.elements, np.ndindex(variable.shape), strict=True)
    }
    scalars = {scalar.name: scalar for scalar in read_description(path).modelVariables}
    return _Variables(scalars, declared, places)


def scalars(member: Member) -> dict[str, Any]:
    """Return the scalar variables of fmpy of a member, by name.

    Raises
    ------
    UserError
        If its FMU cannot be read.
    """
    return _variables(member).scalars


def enumeration_items(member: Member, name: str) -> dict[str, float]:
    """Return the values of the items of an enumeration by name; empty if it has no items."""
    enumeration = scalars(member)[name].declaredType
    listed = enumeration.items if enumeration is not None else None
    return {str(item.name): float(item.value) for item in listed or ()}


def declared(member: Member) -> dict[str, DeclaredVariable]:
    """Return the variables of a member of FMI 3.0 by name; empty for one of FMI 2.0.

    Raises
    ------
    UserError
        If its FMU cannot be read.
    """
    return _variables(member).declared


def variable_of(member: Member, name: str) -> DeclaredVariable:
    """Return a variable of FMI 3.0, or a scalar if there is none of that name."""
    return declared(member).get(name, DeclaredVariable("", (), (name,)))


def type_name(member: Member, element: str) -> str:
    """Return the type of a variable or element, with its name in the FMI version of the member."""
    variables = _variables(member)
    name, _ = variables.places.get(element, (element, ()))
    if name in variables.declared:
        return variables.declared[name].kind
    return str(variables.scalars[element].type)


def end_of(member: Member, element: str) -> End:
    """Return the end of a connection at an element or scalar of a member."""
    return End(member.name, *_variables(member).places.get(element, (element, ())))


def element_at(variable: DeclaredVariable, indices: Sequence[int]) -> str:
    """Return the name of an element.

    Parameters
    ----------
    variable : DeclaredVariable
    indices : sequence of int
        From 1, one for each dimension.

    Raises
    ------
    UserError
        If there is no such element.
    """
    shape = variable.shape
    if len(indices) != len(shape) or not all(
        1 <= index <= size for index, size in zip(indices, shape, strict=True)
    ):
        raise UserError(
            f"there is no element {','.join(map(str, indices))}; it has {show_shape(shape)}"
        )
    position = np.ravel_multi_index([index - 1 for index in indices], shape)
    return variable.elements[int(position)]


def show_shape(shape: Sequence[int]) -> str:
    """Return the size of an array as a text for a message."""
    return f"{' by '.join(map(str, shape))} elements" if shape else "no dimension"


def wires(connections: Sequence[Connection], members: Mapping[str, Member]) -> list[Wire]:
    """Return the wires of connections, with one wire for two arrays that are wholly connected.

    Parameters
    ----------
    connections : sequence of Connection
    members : Mapping of str to Member

    Returns
    -------
    list of Wire
        In the order of the connections.
    """
    single = []
    for connection in connections:
        source, target = connection.source, connection.target
        is_boolean = type_name(members[source.member], source.variable) == "Boolean"
        start, end = (end_of(members[port.member], port.variable) for port in (source, target))
        single.append(Wire(start, end, connection.change, is_boolean))
    of_arrays = _array_wires(single, members)
    merged = [_whole(wire) if _whole(wire) in of_arrays else wire for wire in single]
    return list(dict.fromkeys(merged))


def _array_wires(wires: Sequence[Wire], members: Mapping[str, Member]) -> set[Wire]:
    """Return the wires of whole arrays that stand for wires between all of their elements.

    These are arrays of one shape, each element connected with that of the same indices, without
    factor and offset.
    """
    counts = Counter(
        _whole(wire)
        for wire in wires
        if wire.source.indices == wire.target.indices and wire.passes_on
    )
    return {
        wire
        for wire, count in counts.items()
        if _shape(wire.source, members) == _shape(wire.target, members)
        and count == math.prod(_shape(wire.source, members))
    }


def _whole(wire: Wire) -> Wire:
    """Return the wire of the whole variables of a wire of elements."""
    ends = (wire.source._replace(indices=()), wire.target._replace(indices=()))
    return Wire(*ends, is_boolean=wire.is_boolean)


def _shape(end: End, members: Mapping[str, Member]) -> tuple[int, ...]:
    return variable_of(members[end.member], end.connector).shape
