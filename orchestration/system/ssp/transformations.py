"""Transformations of the values of a connection, composed of those of its parts.

A connection through connectors of inner systems and entries of signal dictionaries is an element
that contains its parts: connections, and between each two of them the connector where they meet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, find
from orchestration.fmu import Signal
from orchestration.system.checking import conversion
from orchestration.system.ssp.vocabulary import (
    BOOLEANS,
    NAMESPACES,
    TRANSFORMATIONS,
    attribute,
    local_name,
    number,
    tag,
)

_IDENTITY = (1.0, 0.0)  # factor and offset
_TRUE = ("true", "1")

SIDES = ("start", "end")  # of a connection
OTHER = {"start": "end", "end": "start"}


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
    whole = Element(first.tag)
    for wire, near, side in ((first, first_side, "start"), (second, second_side, "end")):
        for part in ("Element", "Connector", "Indices"):
            text = wire.get(f"{OTHER[near]}{part}")
            if text is not None:
                whole.set(f"{side}{part}", text)
    before = _parts(first)[:: 1 if first_side == "end" else -1]
    after = _parts(second)[:: 1 if second_side == "start" else -1]
    whole.extend([*before, connector, *after])
    return whole


def far_end(wire: Element, side: str) -> tuple[str | None, str]:
    """Return element and connector of the end opposite to a side; None for the system."""
    opposite = OTHER[side]
    return wire.get(f"{opposite}Element"), attribute(wire, f"{opposite}Connector")


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
    wire: Element, source: Signal, target: Signal, items: Sequence[Mapping[str, float]]
) -> dict[str, Any]:
    """Return what a connection does to its values, as arguments of a `Connection`.

    SSP converts units before a linear transformation, in each part by itself.

    Parameters
    ----------
    wire : Element
        Its start is its source.
    source, target : Signal
    items : sequence of Mapping of str to float
        Values of the items by name, of the source and of the target.

    Raises
    ------
    UserError
        If a transformation does not fit its connectors, or a factor is applied to values whose
        unit changes: by SSP it is applied after the conversion, some tools apply it instead.
    """
    parts = _parts(wire)[::2]
    elements = transformations(wire)
    suppressed = [part.get("suppressUnitConversion", "false") in _TRUE for part in parts]
    if not any(suppressed) and elements == [None] * len(parts):
        factor, offset = conversion(source.unit, target.unit) or _IDENTITY
        return {"factor": factor, "offset": offset}
    factor, offset = _IDENTITY
    table: dict[float, float] = {}
    unit = source.unit
    units = [*map(_declared_unit, _parts(wire)[1::2]), target.unit]
    for k, element in enumerate(elements):
        if element is not None and element.tag != tag("ssc:LinearTransformation"):
            step = _entries(element, (source.type, target.type), items)
            values = {value: table.get(value, value) for value in (*table, *step)}
            table = {value: step.get(middle, middle) for value, middle in values.items()}
            continue
        # a connector without a unit has that of the one whose values it passes on
        to = units[k] or (unit if element is None else next(filter(None, units[k:]), unit))
        scale, shift = _IDENTITY if suppressed[k] else conversion(unit, to) or _IDENTITY
        if element is not None:
            if (scale, shift) != _IDENTITY:
                raise UserError(
                    f"from {unit!r} to {to!r}, by a factor that may come on top of the conversion"
                    ' or be all of it; say suppressUnitConversion="true" if it is all'
                )
            scale, shift = number(element, "factor", "1"), number(element, "offset", "0")
        factor, offset = factor * scale, offset * scale + shift
        unit = to
    changed = sorted(entry for entry in table.items() if entry[0] != entry[1])
    return {"factor": factor, "offset": offset, "table": tuple(changed)}


def _declared_unit(connector: Element) -> str | None:
    return next((unit for node in connector if (unit := node.get("unit"))), None)


def _entries(
    element: Element, types: Sequence[str], items: Sequence[Mapping[str, float]]
) -> dict[float, float]:
    """Return the values of a mapping with those that replace them."""
    name = local_name(element)
    kind = name.removesuffix("MappingTransformation")
    if set(types) != {"boolean" if kind == "Boolean" else "integer"}:
        raise UserError(f"{name} does not fit {types[0]} and {types[1]}")
    entries: dict[float, float] = {}
    for entry in element:
        values = []
        for side, known in zip(("source", "target"), items, strict=True):
            words = {"Boolean": BOOLEANS, "Enumeration": known}.get(kind)
            if words is None:
                values.append(number(entry, side, ""))
            else:
                where = f"{side} of a {name}: none"
                values.append(find(attribute(entry, side), words, where))
        if values[0] in entries:
            raise UserError(f"a {name} has two entries for {attribute(entry, 'source')!r}")
        entries[values[0]] = values[1]
    return entries
