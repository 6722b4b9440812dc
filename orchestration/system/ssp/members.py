"""Reading of the members of a system, with their parameter bindings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

from fmus.kit import UserError, units
from orchestration.fmu import Value
from orchestration.fmu.archive import parse_xml
from orchestration.system.checking import variable
from orchestration.system.model import Member, owner_of
from orchestration.system.ssp.arrays import enumeration_items, variable_of
from orchestration.system.ssp.declarations import check_connectors, check_shape
from orchestration.system.ssp.flattening import OWNER
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.vocabulary import (
    BOOLEANS,
    FMU,
    NAMESPACES,
    TYPES,
    attribute,
    check_elements,
    check_version,
    find_all,
    local_name,
    tag,
)

_PARAMETER_TYPES = {tag(f"ssv:{name}"): kinds for name, kinds in TYPES.items()}
_OTHER_IMPLEMENTATIONS = {
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}


def read_members(
    top: Element, package: Package, folder: Path, aliases: Mapping[str, Sequence[str]]
) -> dict[str, Member]:
    """Read the members, with the parameter bindings of members and of the system.

    Parameters
    ----------
    top : Element
        The ``System``.
    package : Package
    folder : Path
        Folder into which FMUs of an archive are unpacked.
    aliases : Mapping of str to sequence of str
        Parameters ``member.parameter`` by other names of them.

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
    listed = [
        _read_member(element, package, folder)
        for element in top.findall("ssd:Elements/*", NAMESPACES)
    ]
    members = {member.name: member for member in listed}
    if len(members) != len(listed):
        raise UserError("two members have one name")
    for name, value in _read_bindings(top, package, "system"):
        for target in aliases.get(name, [name]):
            owner = owner_of(target, members)
            if owner is None:
                raise UserError(
                    f"parameter {name!r} of the system is not of the form member.parameter"
                )
            member = members[owner]
            own = _read_values(member, target[len(owner) + 1 :], value)
            members[owner] = replace(member, parameters={**member.parameters, **own})
    return members


def _read_member(element: Element, package: Package, folder: Path) -> Member:
    """Read a member with its parameter bindings, and compare its connectors with its FMU."""
    name = attribute(element, "name")
    if element.tag != tag("ssd:Component"):
        raise UserError(
            f"{name} is a {local_name(element)}; this program runs components that are FMUs"
        )
    kind = element.get("type", FMU)
    if kind != FMU:
        raise UserError(f"member {name} is of type {kind}; this program runs FMUs")
    other = _OTHER_IMPLEMENTATIONS.get(element.get("implementation", "any"))
    if other is not None:
        raise UserError(f"member {name} is to be run by {other}; this program runs co-simulation")
    try:
        member = Member(name, package.fmu(attribute(element, "source"), folder))
        check_connectors(element, member)
    except UserError as error:
        text = str(error).removeprefix(f"{package.path}: ")
        raise UserError(f"member {name}: {text}") from error
    parameters: dict[str, Value] = {}
    for key, value in _read_bindings(element, package, f"member {name}"):
        parameters |= _read_values(member, key, value)
    return replace(member, parameters=parameters)


def _read_bindings(element: Element, package: Package, where: str) -> Iterator[tuple[str, Element]]:
    """Yield names and values of all parameters that are bound to an element."""
    for binding in element.findall("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES):
        if binding.get("sourceBase", "SSD") != "SSD":
            raise UserError(f"{where}: parameters inside of an FMU are not known to this program")
        mapped = _read_mapping(binding, package, where)
        for parameter in _read_parameters(binding, package, where):
            own = binding.get("prefix", "") + attribute(parameter, "name")
            if len(parameter) == 0 or parameter[0].tag not in _PARAMETER_TYPES:
                kind = local_name(parameter[0]) if len(parameter) else "nothing"
                known = ", ".join(TYPES)
                raise UserError(f"{where}: parameter {own} is {kind}; known are {known}")
            for name in [own] if mapped is None else mapped.get(own, ()):
                yield ".".join(filter(None, (binding.get(OWNER), name))), parameter


def _read_mapping(binding: Element, package: Package, where: str) -> dict[str, list[str]] | None:
    """Return the names that parameters of a binding are mapped to; None without a mapping.

    Raises
    ------
    UserError
        If a value is transformed on the way.
    """
    declared = binding.find("ssd:ParameterMapping", NAMESPACES)
    if declared is None:
        return None
    mappings = declared.findall("ssm:ParameterMapping", NAMESPACES)
    source = declared.get("source")
    if source is not None:
        mappings.append(parse_xml(package.text(source), str(package.path), source))
        check_elements(mappings[-1])
    names: dict[str, list[str]] = {}
    for entry in find_all(mappings, "ssm:MappingEntry"):
        target = attribute(entry, "target")
        if len(entry):
            raise UserError(f"{where}: a transformation of parameter {target!r} is not known")
        names.setdefault(attribute(entry, "source"), []).append(target)
    return names


def _read_parameters(binding: Element, package: Package, where: str) -> list[Element]:
    """Return the parameters in a binding, and in the file that it refers to."""
    sets = binding.findall("ssd:ParameterValues/ssv:ParameterSet", NAMESPACES)
    source = binding.get("source")
    if source is not None:
        parameter_set = parse_xml(package.text(source), str(package.path), source)
        check_elements(parameter_set)
        if parameter_set.tag != tag("ssv:ParameterSet"):
            raise UserError(
                f"{where}: {source} is a {local_name(parameter_set)}, not a ParameterSet"
            )
        sets.append(parameter_set)
    for each in sets:
        check_version(each, f"{where}: {source or 'a ParameterSet'}")
    return find_all(sets, "ssv:Parameters/ssv:Parameter")


def _value_texts(element: Element, is_array: bool) -> list[str]:
    """Return the texts of values: of elements ``Value``, or in the attribute ``value``."""
    nodes = element.findall("ssv:Value", NAMESPACES)
    if nodes:
        return [node.get("value", "") for node in nodes]
    text = element.get("value", "")
    return text.split() if is_array else [text]


def _read_values(member: Member, name: str, parameter: Element) -> dict[str, Value]:
    """Return the value of a parameter, or the values of all elements of an array, by name."""
    element = parameter[0]
    names = variable_of(member, name).elements
    texts = _value_texts(element, is_array=len(names) > 1)
    where = f"member {member.name}: {name}"
    check_shape(parameter, name, member, where)
    if len(texts) != len(names):
        raise UserError(f"{where}: has {len(texts)} values; expected {len(names)}")
    return {
        each: _read_scalar(member, each, element, text)
        for each, text in zip(names, texts, strict=True)
    }


def _read_scalar(member: Member, name: str, element: Element, text: str) -> Value:
    """Return the value of a scalar parameter, converted to the FMU's unit.

    Parameters
    ----------
    member : Member
    name : str
        Name of the parameter.
    element : Element
        Its type, with the unit of the value.
    text : str
        The value.
    """
    signal = variable(member, name)
    where = f"member {member.name}: {name}"
    kinds = _PARAMETER_TYPES[element.tag]
    if signal.type not in kinds:
        raise UserError(f"{where}: given as {kinds[0]}, but the FMU has it as {signal.type}")
    if signal.type == "string":
        return text
    if element.tag == tag("ssv:Enumeration"):
        return _item(member, name, text)
    if signal.type == "boolean":
        if text not in BOOLEANS:
            raise UserError(f"{where}: {text!r} is neither true nor false")
        return BOOLEANS[text]
    try:
        value = float(text)
        return float(units.convert(value, element.get("unit", signal.unit), signal.unit, where))
    except UserError as error:
        if where in str(error):  # only some messages about units begin with it
            raise
        raise UserError(f"{where}: {error}") from error
    except ValueError as error:
        raise UserError(f"{where}: {text!r} is not a number") from error


def _item(member: Member, name: str, text: str) -> float:
    """Return the value of an item of an enumeration by the name of the item."""
    items = enumeration_items(member, name)
    if text not in items:
        raise UserError(
            f"member {member.name}: {name}: {text!r} is no item of its enumeration; items are"
            f" {', '.join(items) or 'none'}"
        )
    return items[text]
