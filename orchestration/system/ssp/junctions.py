"""Connectors of inner systems and entries of signal dictionaries, at which connections meet."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import combinations, product
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, error_context, find
from orchestration.fmu.archive import parse_xml
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.transformations import OTHER, SIDES, far_end, joined
from orchestration.system.ssp.vocabulary import (
    NAMESPACES,
    attribute,
    check_elements,
    check_version,
    find_all,
    local_name,
    tag,
)

Junctions = Mapping[str, Mapping[str, Element]]  # by element and connector


def resolve(system: Element) -> None:
    """Give references in a system the dictionaries that are defined there, and not further in."""
    defined = {
        attribute(dictionary, "name"): dictionary
        for dictionary in find_all([system], "ssd:SignalDictionaries/ssd:SignalDictionary")
    }
    for reference in find_all([system], "ssd:Elements/ssd:SignalDictionaryReference"):
        found = defined.get(attribute(reference, "dictionary"))
        if found is not None:  # one that is there already comes first
            reference.append(found)


def take(top: Element, package: Package) -> Junctions:
    """Remove inner systems and references of dictionaries from a flat system.

    Parameters
    ----------
    top : Element
        The ``System``.
    package : Package

    Returns
    -------
    Mapping of str to Mapping of str to Element
        Their connectors; references of one dictionary share its entries.

    Raises
    ------
    UserError
        If a dictionary does not exist.
    """
    junctions = {}
    for elements in find_all([top], "ssd:Elements"):
        for element in list(elements):
            if element.tag == tag("ssd:Component"):
                continue
            elements.remove(element)
            name = attribute(element, "name")
            found = element.findall("ssd:Connectors/ssd:Connector", NAMESPACES)
            if element.tag != tag("ssd:System"):
                found = _entries(element, package)
            junctions[name] = {attribute(each, "name"): each for each in found}
    return junctions


def _entries(reference: Element, package: Package) -> list[Element]:
    """Return the entries of the dictionary of a reference."""
    dictionary = reference.find("ssd:SignalDictionary", NAMESPACES)
    name = attribute(reference, "dictionary")
    if dictionary is None:
        raise UserError(f"{reference.get('name')}: there is no signal dictionary named {name!r}")
    source = dictionary.attrib.pop("source", None)
    with error_context(f"signal dictionary {name}"):
        if source is not None:
            table = parse_xml(package.text(source), str(package.path), source)
            if table.tag != tag("ssb:SignalDictionary"):
                raise UserError(f"{source} is a {local_name(table)}, not a SignalDictionary")
            check_elements(table)
            dictionary.append(table)
        for table in dictionary:
            check_version(table, source or "it")
    return find_all(dictionary, "ssb:DictionaryEntry")


def _junction(junctions: Junctions, owner: str | None, connector: str) -> Element | None:
    if owner is None or owner not in junctions:
        return None
    return find(connector, junctions[owner], f"{owner}: no connector or entry")


def connect(
    wires: Iterable[Element], junctions: Junctions, receives: Callable[[Element, str], bool]
) -> list[Element]:
    """Return connections in which those that meet at a junction are joined.

    Parameters
    ----------
    wires : iterable of Element
    junctions : Mapping of str to Mapping of str to Element
    receives : callable
        Whether a side of a connection is the input of a member or an output of the system.

    Raises
    ------
    UserError
        If there is no such connector.
    """
    made: dict[Element, None] = {}
    meetings: dict[Element, list[tuple[Element, str]]] = {}

    def add(wire: Element) -> None:
        places = [_junction(junctions, *far_end(wire, side)) for side in SIDES[::-1]]
        if places[0] is not None and places[0] is places[1]:
            return  # a loop connects nothing
        made[wire] = None
        for side, place in zip(SIDES, places, strict=True):
            if place is not None:
                meetings.setdefault(place, []).append((wire, side))

    for wire in wires:
        add(wire)
    while meetings:
        place, listed = meetings.popitem()
        ends = [end for end in listed if end[0] in made]
        targets = [end for end in ends if receives(end[0], OTHER[end[1]])]
        others = [end for end in ends if end not in targets]
        for wire, _ in ends:
            del made[wire]
        for first, second in (*combinations(others, 2), *product(others, targets)):
            add(joined(*first, place, *second))
    return list(made)
