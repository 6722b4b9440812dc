"""Reading of the members of a system, with their parameter bindings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

from fmus.kit import units
from fmus.kit.errors import UserError, error_context, find
from orchestration.fmu import Archive, Signal, Value
from orchestration.fmu.archive import for_model_exchange
from orchestration.system.checking import variable
from orchestration.system.model import Member, owner_of
from orchestration.system.ssp.arrays import enumeration_items, variable_of
from orchestration.system.ssp.declarations import check_connectors, check_shape
from orchestration.system.ssp.flattening import Structure
from orchestration.system.ssp.junctions import Step
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.transformations import change
from orchestration.system.ssp.vocabulary import (
    BOOLEANS,
    FMU,
    NAMESPACES,
    TYPES,
    attribute,
    find_all,
    local_name,
    path_of,
    tag,
)

_PARAMETER_TYPES = {tag(f"ssv:{name}"): kinds for name, kinds in TYPES.items()}


def read_members(structure: Structure, package: Package, folder: Path) -> dict[str, Member]:
    """Read the members, with the parameter bindings of members and of the system.

    Parameters
    ----------
    structure : Structure
    package : Package
    folder : Path
        Folder into which FMUs of an archive are unpacked.

    Returns
    -------
    dict of str to Member
        By name.

    Raises
    ------
    UserError
        If a member is no FMU for co-simulation, its declaration differs from its FMU, or one of
        its parameters cannot be set.
    """
    members = {
        name: _read_member(name, element, package, folder)
        for name, element in structure.components.items()
    }
    parameters: dict[str, dict[str, Value]] = {name: {} for name in members}
    for path, binding in structure.bindings:
        where = f"member {path}" if path in members else "system"
        for own, value, step in _read_binding(binding, package, where):
            for target in structure.parameters(path_of(path, own)):
                owner = owner_of(target, members)
                if owner is None:
                    raise UserError(
                        f"parameter {target!r} of the system is not of the form member.parameter"
                    )
                name = target[len(owner) + 1 :]
                parameters[owner] |= _read_values(members[owner], name, value, step)
    return {name: replace(members[name], parameters=parameters[name]) for name in members}


def _read_member(name: str, element: Element, package: Package, folder: Path) -> Member:
    """Read a member without parameters, and compare its connectors with its FMU."""
    where = f"member {name}"
    kind = element.get("type", FMU)
    if kind != FMU:
        raise UserError(f"{where} is of type {kind}; this program runs FMUs")
    asked = element.get("implementation", "any")
    with error_context(where):
        fmu = package.fmu(attribute(element, "source"), folder)
        if asked == "ModelExchange":
            fmu = for_model_exchange(fmu)
        with Archive(fmu) as archive:
            if asked not in ("any", archive.implementation):
                raise UserError(f"{fmu.name} is run by {archive.implementation}, not by {asked}")
        member = Member(name, fmu)
        check_connectors(element, member)
    return member


def _read_binding(
    binding: Element, package: Package, where: str
) -> Iterator[tuple[str, Element, Step]]:
    """Yield names, values and transformations of the parameters of a binding.

    Messages begin with `where`.
    """
    with error_context(where):
        if binding.get("sourceBase", "SSD") != "SSD":
            raise UserError("parameters inside of an FMU are not known to this program")
        targets = _read_mapping(binding, package)
        sets = package.documents(binding, "ssd:ParameterValues/ssv:ParameterSet")
        for parameter in find_all(sets, "ssv:Parameters/ssv:Parameter"):
            own = binding.get("prefix", "") + attribute(parameter, "name")
            if len(parameter) == 0 or parameter[0].tag not in _PARAMETER_TYPES:
                kind = local_name(parameter[0]) if len(parameter) else "nothing"
                raise UserError(f"parameter {own} is {kind}; known are {', '.join(TYPES)}")
            for name, step in [(own, Step())] if targets is None else targets.get(own, ()):
                yield name, parameter, step


def _read_mapping(binding: Element, package: Package) -> dict[str, list[tuple[str, Step]]] | None:
    """Return what the parameters of a binding are mapped to, by name; None without a mapping."""
    declared = binding.find("ssd:ParameterMapping", NAMESPACES)
    if declared is None:
        return None
    mappings = package.documents(declared, "ssm:ParameterMapping")
    targets: dict[str, list[tuple[str, Step]]] = {}
    for entry in find_all(mappings, "ssm:MappingEntry"):
        target = (attribute(entry, "target"), Step.of(entry))
        targets.setdefault(attribute(entry, "source"), []).append(target)
    return targets


def _value_texts(element: Element, is_array: bool) -> list[str]:
    """Return the texts of values: of elements ``Value``, or in the attribute ``value``."""
    listed = [node.get("value", "") for node in element.iterfind("ssv:Value", NAMESPACES)]
    text = element.get("value", "")
    return listed or (text.split() if is_array else [text])


def _read_values(member: Member, name: str, parameter: Element, step: Step) -> dict[str, Value]:
    """Return the value of a parameter, or the values of all elements of an array, by name."""
    element = parameter[0]
    names = variable_of(member, name).elements
    texts = _value_texts(element, is_array=len(names) > 1)
    where = f"member {member.name}: {name}"
    check_shape(parameter, name, member, where)
    if len(texts) != len(names):
        raise UserError(f"{where}: has {len(texts)} values; expected {len(names)}")
    values: dict[str, Value] = {}
    for each, text in zip(names, texts, strict=True):
        signal = variable(member, each)
        with error_context(f"member {member.name}: {each}"):
            if step.linear and signal.type != "real":
                raise UserError(f"a factor is for real parameters, this is {signal.type}")
            if element.tag == tag("ssv:Enumeration") and signal.type == "integer":
                items = enumeration_items(member, each)
                values[each] = find(text, items, "its enumeration has no item")
            else:
                values[each] = _read_scalar(signal, element, text, step)
    return values


def _read_scalar(signal: Signal, element: Element, text: str, step: Step) -> Value:
    """Return the value of a scalar parameter, converted to the FMU's unit and transformed.

    Parameters
    ----------
    signal : Signal
        The parameter.
    element : Element
        Type of the value, with its unit.
    text : str
        The value.
    step : Step
        What the mapping of the parameter does to it.
    """
    kinds = _PARAMETER_TYPES[element.tag]
    if signal.type not in kinds:
        raise UserError(f"given as {kinds[0]}, but the FMU has it as {signal.type}")
    if signal.type == "string":
        return text
    if signal.type == "boolean":
        if text not in BOOLEANS:
            raise UserError(f"{text!r} is neither true nor false")
        return BOOLEANS[text]
    try:
        value = float(text)
    except ValueError as error:
        raise UserError(f"{text!r} is not a number") from error
    unit = element.get("unit", signal.unit)
    if step == Step():
        return float(units.convert(value, unit, signal.unit, f"value {text}"))
    factor, offset = change(step, unit, signal.unit)
    return factor * value + offset
