"""Signal dictionaries, whose entries connect all that is connected to them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator, Sequence
from itertools import combinations, product
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, error_context, find
from orchestration.fmu.archive import parse_xml
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.transformations import joined
from orchestration.system.ssp.vocabulary import (
    NAMESPACES,
    attribute,
    check_elements,
    check_version,
    find_all,
    local_name,
    tag,
)

ENTRY = "entry"  # attribute of a connection through a dictionary: what it leads through
_SIDES = ("start", "end")


def resolve(system: Element) -> None:
    """Give the references in a system the dictionaries that are defined there.

    A name that is not defined there is one of the system around it.

    Parameters
    ----------
    system : Element
        The elements of systems in it are its own already.
    """
    defined = {
        attribute(dictionary, "name"): dictionary
        for dictionary in find_all([system], "ssd:SignalDictionaries/ssd:SignalDictionary")
    }
    for reference in find_all([system], "ssd:Elements/ssd:SignalDictionaryReference"):
        found = defined.get(attribute(reference, "dictionary"))
        if found is not None and reference.find("ssd:SignalDictionary", NAMESPACES) is None:
            reference.append(found)


def dissolve(top: Element, package: Package) -> None:
    """Rewrite connections to references of dictionaries as connections through them.

    Parameters
    ----------
    top : Element
        The flat ``System``, which has no references afterwards.
    package : Package

    Raises
    ------
    UserError
        If a dictionary or an entry does not exist.
    """
    dictionaries = _take_references(top)
    entries = {
        id(dictionary): _entries(dictionary, package) for dictionary in dictionaries.values()
    }
    receivers = _receivers(top)
    (connections,) = find_all([top], "ssd:Connections")
    while True:
        ends = [
            (wire, side, wire.get(f"{side}Element", ""))
            for wire in connections
            for side in _SIDES
            if wire.get(f"{side}Element") in dictionaries
        ]
        if not ends:
            return
        wire, side, name = ends[0]
        signal = attribute(wire, f"{side}Connector")
        known = entries[id(dictionaries[name])]
        entry = find(signal, known, f"{name}: no entry of its dictionary")
        meeting = [
            (other, at)
            for other, at, owner in ends
            if dictionaries[owner] is dictionaries[name] and other.get(f"{at}Connector") == signal
        ]
        counts = Counter(other for other, _ in meeting)
        for other in counts:
            connections.remove(other)
        # one of which both ends meet here connects nothing
        through = [pair for pair in meeting if counts[pair[0]] == 1]
        for made in _joined_at(entry, through, receivers):
            made.set(ENTRY, f"{name}.{signal}")
            connections.append(made)


def _take_references(top: Element) -> dict[str, Element]:
    """Remove the references of a system; return their dictionaries by the name of a reference."""
    dictionaries: dict[str, Element] = {}
    for elements in find_all([top], "ssd:Elements"):
        for reference in find_all([elements], "ssd:SignalDictionaryReference"):
            name = attribute(reference, "name")
            dictionary = reference.find("ssd:SignalDictionary", NAMESPACES)
            if dictionary is None:
                wanted = attribute(reference, "dictionary")
                raise UserError(f"{name}: there is no signal dictionary named {wanted!r}")
            dictionaries[name] = dictionary
            elements.remove(reference)
    return dictionaries


def _joined_at(
    entry: Element,
    meeting: Sequence[tuple[Element, str]],
    receivers: Container[tuple[str | None, str]],
) -> Iterator[Element]:
    """Yield the connections through an entry, but for those between two receivers."""
    targets = [pair for pair in meeting if _far_end(*pair) in receivers]
    others = [pair for pair in meeting if _far_end(*pair) not in receivers]
    for (first, near), (second, far) in (*combinations(others, 2), *product(others, targets)):
        yield joined(first, near, entry, second, far)


def _far_end(wire: Element, side: str) -> tuple[str | None, str]:
    """Return element and connector of the end opposite to a side; None for the system."""
    opposite = _SIDES[1 - _SIDES.index(side)]
    return wire.get(f"{opposite}Element"), wire.get(f"{opposite}Connector", "")


def _receivers(top: Element) -> set[tuple[str | None, str]]:
    """Return the connectors that are declared to receive values; None for the system."""
    owners: list[tuple[str | None, Element, str]] = [(None, top, "output")]
    owners += [(each.get("name"), each, "input") for each in find_all([top], "ssd:Elements/*")]
    return {
        (owner, connector.get("name", ""))
        for owner, element, kind in owners
        for connector in find_all([element], "ssd:Connectors/ssd:Connector")
        if connector.get("kind") == kind
    }


def _entries(dictionary: Element, package: Package) -> dict[str, Element]:
    """Return the entries of a dictionary by name."""
    name = attribute(dictionary, "name")
    with error_context(f"signal dictionary {name}"):
        tables = dictionary.findall("ssb:SignalDictionary", NAMESPACES)
        source = dictionary.get("source")
        if source is not None:
            tables.append(parse_xml(package.text(source), str(package.path), source))
            check_elements(tables[-1])
        for table in tables:
            if table.tag != tag("ssb:SignalDictionary"):
                raise UserError(f"{source} is a {local_name(table)}, not a SignalDictionary")
            check_version(table, source or "its entries")
        return {
            attribute(entry, "name"): entry for entry in find_all(tables, "ssb:DictionaryEntry")
        }
