"""Transformations of the values of a connection, composed of those of its parts.

A connection through connectors of inner systems and entries of signal dictionaries is an element
that contains its parts: connections, and between each two of them the connector where they meet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from orchestration.system.checking import conversion
from orchestration.system.ssp.vocabulary import (
    BOOLEANS,
    NAMESPACES,
    TRANSFORMATIONS,
    TYPES,
    attribute,
    local_name,
    number,
    tag,
)

_IDENTITY = (1.0, 0.0)  # factor and offset
_TRUE = ("true", "1")


class Place(NamedTuple):
    """A connector on the way of a connection.

    Attributes
    ----------
    type : str
        Type of the signal; empty if it is not declared.
    unit : str or None
        None if it is not declared.
    items : Mapping of str to float
        Values of the items of an enumeration by name.
    """

    type: str
    unit: str | None
    items: Mapping[str, float]


def joined(
    first: Element, first_side: str, connector: Element, second: Element, second_side: str
) -> Element:
    """Return a connection made of two that meet at a connector.

    Parameters
    ----------
    first, second : Element
        Connections.
    first_side, second_side : {"start", "end"}
        The end of each that is the connector.
    connector : Element
        The connector, or the entry of a dictionary, with its type.

    Raises
    ------
    UserError
        If an end there is one element of an array.
    """
    if first.get(f"{first_side}Indices") or second.get(f"{second_side}Indices"):
        raise UserError(
            f"connection through {connector.get('name')}: elements of arrays are not known there"
        )
    ends = _other_end(first, first_side, "start") | _other_end(second, second_side, "end")
    whole = Element(first.tag, ends)
    before = _parts(first) if first_side == "end" else _parts(first)[::-1]
    after = _parts(second) if second_side == "start" else _parts(second)[::-1]
    whole.extend([*before, connector, *after])
    return whole


def _other_end(wire: Element, side: str, named: str) -> dict[str, str]:
    """Return the attributes of the end of a wire opposite to a side, as those of a side."""
    opposite = "end" if side == "start" else "start"
    parts = ("Element", "Connector", "Indices")
    return {f"{named}{p}": text for p in parts if (text := wire.get(f"{opposite}{p}")) is not None}


def _parts(wire: Element) -> list[Element]:
    """Return connections and connectors in turn, from the start to the end of a connection."""
    is_joined = wire.find("ssd:Connection", NAMESPACES) is not None
    return list(wire) if is_joined else [wire]


def transformations(wire: Element) -> list[Element | None]:
    """Return the transformation of each part of a connection, None where there is none."""
    return [
        next((node for node in part if node.tag in TRANSFORMATIONS), None)
        for part in _parts(wire)[::2]
    ]


def compose(
    wire: Element, source: Place, target: Place, enumerations: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """Return what a connection does to its values, as arguments of a `Connection`.

    SSP converts units before a linear transformation, in each part by itself.

    Parameters
    ----------
    wire : Element
        Its start is its source.
    source, target : Place
    enumerations : Mapping of str to Mapping
        Enumerations of the description by name.

    Raises
    ------
    UserError
        If a transformation does not fit its connectors, or a factor is applied to values whose
        unit changes: by SSP it is applied after the conversion, some tools apply it instead.
    """
    places = [source, *(_place(node, enumerations) for node in _parts(wire)[1::2]), target]
    suppressed = [
        part.get("suppressUnitConversion", "false") in _TRUE for part in _parts(wire)[::2]
    ]
    elements = transformations(wire)
    if not any(suppressed) and not any(element is not None for element in elements):
        factor, offset = conversion(source.unit or "", target.unit or "") or _IDENTITY
        return {"factor": factor, "offset": offset}
    total = _IDENTITY
    table: dict[float, float] = {}
    unit = source.unit
    for k, element in enumerate(elements):
        if element is not None and element.tag != tag("ssc:LinearTransformation"):
            step = _entries(element, places[k], places[k + 1], (source.type, target.type))
            values = dict.fromkeys((*table, *step))
            passed = {value: table.get(value, value) for value in values}
            table = {value: step.get(middle, middle) for value, middle in passed.items()}
            continue
        declared = [place.unit for place in places[k + 1 :] if place.unit is not None]
        # a connector without a unit has that of the one whose values it passes on
        to = unit if element is None and places[k + 1].unit is None else declared[0]
        needed = _IDENTITY if suppressed[k] else conversion(unit or "", to or "") or _IDENTITY
        if element is not None:
            if needed != _IDENTITY:
                raise UserError(
                    f"from {unit!r} to {to!r}, by a factor that may come on top of the conversion"
                    ' or be all of it; say suppressUnitConversion="true" if it is all'
                )
            needed = number(element, "factor", "1"), number(element, "offset", "0")
        total = total[0] * needed[0], total[1] * needed[0] + needed[1]
        unit = to
    changed = sorted((value, received) for value, received in table.items() if value != received)
    return {"factor": total[0], "offset": total[1], "table": tuple(changed)}


def _place(connector: Element, enumerations: Mapping[str, Mapping[str, float]]) -> Place:
    for node in connector:
        if local_name(node) in TYPES:
            items = enumerations.get(node.get("name", ""), {})
            return Place(TYPES[local_name(node)][0], node.get("unit"), items)
    return Place("", None, {})


def _entries(
    element: Element, start: Place, end: Place, types: Sequence[str]
) -> dict[float, float]:
    """Return the values of a mapping with those that replace them."""
    name = local_name(element)
    kind = name.removesuffix("MappingTransformation")
    if set(types) != {"boolean" if kind == "Boolean" else "integer"}:
        raise UserError(f"{name} does not fit {types[0]} and {types[1]}")
    entries: dict[float, float] = {}
    for entry in element:
        values = []
        for side, place in (("source", start), ("target", end)):
            text = attribute(entry, side)
            known = {"Boolean": BOOLEANS, "Enumeration": place.items}.get(kind)
            if known is not None and text not in known:
                raise UserError(
                    f"{side} {text[:40]!r} of a {name} is not one of {', '.join(known) or 'none'}"
                )
            values.append(number(entry, side, "") if known is None else known[text])
        if values[0] in entries:
            raise UserError(f"a {name} has two entries for {attribute(entry, 'source')!r}")
        entries[values[0]] = values[1]
    return entries
