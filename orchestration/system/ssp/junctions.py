"""Connections as declared, and the junctions at which they meet.

A junction is a connector of an inner system or an entry of a signal dictionary.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import NamedTuple
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, error_context, find
from orchestration.system.ssp.arrays import End
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.vocabulary import (
    LINEAR,
    MAPPINGS,
    NAMESPACES,
    WHOLE,
    attribute,
    enumerations,
    number,
    path_of,
)


class Step(NamedTuple):
    """Change of a value on its way from one declared connector or parameter to the next.

    Attributes
    ----------
    linear : tuple of float or None
        Factor and offset.
    mapping : Element or None
        A mapping of booleans, integers or items of an enumeration.
    suppresses_conversion : bool
        Whether the value is not converted to the unit of its target.
    """

    linear: tuple[float, float] | None = None
    mapping: Element | None = None
    suppresses_conversion: bool = False

    @classmethod
    def of(cls, element: Element) -> Step:
        """Return the step of a connection or of an entry of a parameter mapping.

        Raises
        ------
        UserError
            If a factor or an offset is not a finite number.
        """
        linear = None
        for node in element.iterfind(LINEAR, NAMESPACES):
            linear = number(node, "factor", "1"), number(node, "offset", "0")
        return cls(
            linear,
            next((node for node in element if node.tag in MAPPINGS), None),
            element.get("suppressUnitConversion") in ("true", "1"),
        )


class Junction:
    """A place where connections meet; references of one signal dictionary share its entries.

    Attributes
    ----------
    name : str
    unit : str or None
    items : dict of str to float
        Values of the items of its enumeration by name; empty if it has none.
    """

    def __init__(self, element: Element, enumerations: Mapping[str, Element]):
        self.name = attribute(element, "name")
        self.unit = next((unit for node in element if (unit := node.get("unit"))), None)
        self.items: dict[str, float] = {}
        for declared in element.iterfind("ssc:Enumeration", NAMESPACES):
            for item in enumerations.get(declared.get("name", ""), ()):
                self.items[attribute(item, "name")] = number(item, "value", "")


Junctions = Mapping[str, Mapping[str, Junction]]  # by element and connector


@dataclass(frozen=True, eq=False)
class DeclaredConnection:
    """A connection of a description; which end is the source depends on the connectors.

    Attributes
    ----------
    start, end : End
    steps : tuple of Step
        Steps from the start to the end, one for each connection that it is made of.
    junctions : tuple of Junction
        Where these meet.
    """

    start: End
    end: End
    steps: tuple[Step, ...]
    junctions: tuple[Junction, ...] = ()

    @classmethod
    def of(cls, element: Element, path: str) -> DeclaredConnection:
        """Return the connection of an element.

        Parameters
        ----------
        element : Element
        path : str
            Name of the system that it is in; empty for the outermost.

        Raises
        ------
        UserError
            If it lacks a connector, its indices are no whole numbers, or its factor is not finite.
        """
        start, end = (
            End(
                path_of(path, element.get(f"{side}Element", "")),
                attribute(element, f"{side}Connector"),
            )
            for side in ("start", "end")
        )
        with error_context(f"connection {start} -> {end}"):
            start = start._replace(indices=_indices(element, "startIndices"))
            end = end._replace(indices=_indices(element, "endIndices"))
            return cls(start, end, (Step.of(element),))

    def __str__(self) -> str:
        return f"connection {self.start} -> {self.end}"

    @property
    def is_plain(self) -> bool:
        """True if no step changes the value."""
        return all(step == Step() for step in self.steps)

    def turned(self) -> DeclaredConnection:
        """Return the connection with start and end exchanged."""
        return DeclaredConnection(self.end, self.start, self.steps[::-1], self.junctions[::-1])

    def joined(self, junction: Junction, other: DeclaredConnection) -> DeclaredConnection:
        """Return this connection with one behind it, which starts at the junction where it ends.

        Raises
        ------
        UserError
            If an end there is one element of an array.
        """
        if self.end.indices or other.start.indices:
            raise UserError(
                f"connection through {junction.name}: elements of arrays are not known there"
            )
        junctions = (*self.junctions, junction, *other.junctions)
        return DeclaredConnection(self.start, other.end, self.steps + other.steps, junctions)


def _indices(element: Element, name: str) -> tuple[int, ...]:
    texts = element.get(name, "").split()
    if not all(map(WHOLE.fullmatch, texts)):
        raise UserError(f"{name} {' '.join(texts)[:40]!r} are no whole numbers")
    return tuple(map(int, texts))


def entries(dictionary: Element, package: Package) -> dict[str, Junction]:
    """Return the entries of a signal dictionary by name.

    Parameters
    ----------
    dictionary : Element
        A ``SignalDictionary`` of a system, which contains a table or names its file.
    package : Package

    Raises
    ------
    UserError
        If the file is missing or no signal dictionary.
    """
    with error_context(f"signal dictionary {attribute(dictionary, 'name')}"):
        tables = package.documents(dictionary, "ssb:SignalDictionary")
        listed = [
            Junction(entry, enumerations(table, "ssb"))
            for table in tables
            for entry in table.iterfind("ssb:DictionaryEntry", NAMESPACES)
        ]
        return {entry.name: entry for entry in listed}


def _junction(end: End, junctions: Junctions) -> Junction | None:
    if end.member not in junctions:
        return None
    return find(end.connector, junctions[end.member], f"{end.member}: no connector or entry")


def join(
    connections: Iterable[DeclaredConnection],
    junctions: Junctions,
    receives: Callable[[End], bool],
) -> list[DeclaredConnection]:
    """Return connections in which those that meet at a junction are joined.

    Parameters
    ----------
    connections : iterable of DeclaredConnection
    junctions : Mapping of str to Mapping of str to Junction
    receives : callable
        Whether an end is the input of a member or an output of the system.

    Raises
    ------
    UserError
        If a junction does not exist, an end there is one element of an array, or two ends are
        connected in two ways of which one changes the value.
    """
    made: dict[object, DeclaredConnection] = {}  # by their ends, unless declared from end to end
    meetings: dict[Junction, list[object]] = {}

    def add(connection: DeclaredConnection) -> None:
        start, end = (_junction(each, junctions) for each in (connection.start, connection.end))
        if start is not None and start is end:
            return  # a loop connects nothing
        is_declared = start is None and end is None and not connection.junctions
        ends = frozenset((start or connection.start, end or connection.end))
        key = connection if is_declared else ends
        if key in made and not (made[key].is_plain and connection.is_plain):
            raise UserError(f"{connection}: there is another way between these, and values change")
        made.setdefault(key, connection)
        for place in filter(None, (start, end)):
            meetings.setdefault(place, []).append(key)

    for connection in connections:
        add(connection)
    while meetings:
        place, listed = meetings.popitem()
        met = [made.pop(key) for key in listed if key in made]
        arriving = [one if _junction(one.end, junctions) is place else one.turned() for one in met]
        for connection in _through(place, arriving, receives):
            add(connection)
    return list(made.values())


def _through(
    place: Junction, arriving: Sequence[DeclaredConnection], receives: Callable[[End], bool]
) -> Iterator[DeclaredConnection]:
    """Yield the connections that those that end at a junction make: of any two but two targets."""
    targets = [connection for connection in arriving if receives(connection.start)]
    others = [connection for connection in arriving if not receives(connection.start)]
    for one, other in (*combinations(others, 2), *product(others, targets)):
        yield one.joined(place, other.turned())
