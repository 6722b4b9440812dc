"""Transformations of the values of a connection, composed of those of its steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, find
from orchestration.fmu import Signal
from orchestration.system.checking import conversion
from orchestration.system.ssp.junctions import DeclaredConnection, Step
from orchestration.system.ssp.vocabulary import BOOLEANS, attribute, local_name, number

_IDENTITY = (1.0, 0.0)  # factor and offset

Items = Mapping[str, float]  # values of the items of an enumeration by name
Table = tuple[tuple[float, float], ...]


def compose(
    connection: DeclaredConnection, source: Signal, target: Signal, items: Sequence[Items]
) -> tuple[float, float, Table]:
    """Return factor, offset and table of a `Connection`.

    SSP converts units before a linear transformation, in each step by itself.

    Parameters
    ----------
    connection : DeclaredConnection
        Its start is its source.
    source, target : Signal
    items : sequence of Mapping of str to float
        Of the source and of the target.

    Raises
    ------
    UserError
        If a transformation does not fit its connectors, or a factor is applied to values whose
        unit changes: by SSP it is applied after the conversion, some tools apply it instead.
    """
    known = [items[0], *(junction.items for junction in connection.junctions), items[1]]
    table = _table(connection.steps, (source.type, target.type), known)
    if all(step == Step() for step in connection.steps):
        return *(conversion(source.unit, target.unit) or _IDENTITY), table
    units = [junction.unit for junction in connection.junctions]
    return *_linear(connection.steps, source.unit, [*units, target.unit]), table


def _linear(steps: Sequence[Step], unit: str, units: Sequence[str | None]) -> tuple[float, float]:
    """Return factor and offset of steps that lead from a unit to others, one after each step."""
    factor, offset = _IDENTITY
    for k, step in enumerate(steps):
        if step.mapping is not None:
            continue
        # a connector without a unit has that of the one whose values it passes on
        later = units[k:] if step.linear else units[k : k + 1]
        to = next(filter(None, later), unit)
        scale, shift = change(step, unit, to)
        factor, offset = factor * scale, offset * scale + shift
        unit = to
    return factor, offset


def change(step: Step, unit: str, to: str) -> tuple[float, float]:
    """Return factor and offset of a step, which is a conversion of units or a transformation.

    Raises
    ------
    UserError
        If it is both.
    """
    converted = conversion(unit, to) or _IDENTITY
    if step.suppresses_conversion:
        converted = _IDENTITY
    if step.linear is None:
        return converted
    if converted != _IDENTITY:
        raise UserError(
            f"from {unit!r} to {to!r}, by a factor that may come on top of the conversion"
            ' or be all of it; say suppressUnitConversion="true" if it is all'
        )
    return step.linear


def _table(steps: Sequence[Step], types: Sequence[str], items: Sequence[Items]) -> Table:
    """Return the values that mappings change, each with the one that replaces it.

    `items` are those before, between and after the steps; empty where nothing defines any, whose
    names are then those of the next connector that does.
    """
    table: dict[float, float] = {}
    for k, step in enumerate(steps):
        if step.mapping is not None:
            before = next(filter(None, reversed(items[: k + 1])), {})
            after = next(filter(None, items[k + 1 :]), {})
            entries = _entries(step.mapping, types, (before, after))
            values = {value: value for value in entries} | table
            table = {value: entries.get(middle, middle) for value, middle in values.items()}
    return tuple(sorted(entry for entry in table.items() if entry[0] != entry[1]))


def _entries(mapping: Element, types: Sequence[str], items: Sequence[Items]) -> dict[float, float]:
    """Return the values of a mapping with those that replace them."""
    name = local_name(mapping)
    kind = name.removesuffix("MappingTransformation")
    if set(types) != {"boolean" if kind == "Boolean" else "integer"}:
        raise UserError(f"{name} does not fit {types[0]} and {types[1]}")
    words = {"Boolean": (BOOLEANS, BOOLEANS), "Enumeration": items}.get(kind, (None, None))
    entries: dict[float, float] = {}
    for entry in mapping:
        value, other = (
            number(entry, side, "")
            if known is None
            else find(attribute(entry, side), known, f"{side} of a {name}: none")
            for side, known in zip(("source", "target"), words, strict=True)
        )
        if value in entries:
            raise UserError(f"a {name} has two entries for {attribute(entry, 'source')!r}")
        entries[value] = other
    return entries
