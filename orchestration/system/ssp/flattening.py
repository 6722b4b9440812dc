"""Descriptions with systems in systems, rewritten as one system of members.

A member of an inner system is named ``inner.member``; what is connected through a connector of the
inner system is connected directly. Parameter connectors of a system become other names of the
parameters that they are connected to.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from orchestration.system.ssp.junctions import resolve
from orchestration.system.ssp.transformations import OTHER, SIDES
from orchestration.system.ssp.vocabulary import NAMESPACES, attribute, tag

OWNER = "owner"  # attribute of a binding: the name of the system that it was declared in
_PARAMETER = "parameter"

Aliases = dict[str, list[str]]


def flatten(system: Element) -> Aliases:
    """Rewrite a system in place as one without systems in it.

    Parameters
    ----------
    system : Element
        The ``System`` of a description, whose elements are known.

    Returns
    -------
    dict of str to list of str
        Parameters ``member.parameter`` by the name of the parameter connectors that set them.

    Raises
    ------
    UserError
        If an element of an array is connected through a connector of an inner system.
    """
    for wire in _wires(system):
        for side in SIDES:  # an empty name is that of the system itself
            if wire.get(f"{side}Element") == "":
                del wire.attrib[f"{side}Element"]
    aliases: Aliases = {}
    for inner in system.findall("ssd:Elements/ssd:System", NAMESPACES):
        name = attribute(inner, "name")
        own = flatten(inner)
        for connector, parameters in own.items():
            aliases[f"{name}.{connector}"] = [f"{name}.{parameter}" for parameter in parameters]
        _dissolve(inner, name, system)
    resolve(system)
    return aliases | _parameter_aliases(system, aliases)


def _wires(system: Element) -> list[Element]:
    return system.findall("ssd:Connections/ssd:Connection", NAMESPACES)


def _group(system: Element, name: str) -> Element:
    """Return the element of a group in a system, a new one where it has none."""
    found = system.find(name, NAMESPACES)
    return SubElement(system, tag(name)) if found is None else found


def _dissolve(inner: Element, name: str, system: Element) -> None:
    """Move members, connections and parameter bindings of an inner system into its system.

    Its connectors stay, for the connections that meet there.
    """
    elements = _group(system, "ssd:Elements")
    for member in inner.findall("ssd:Elements/*", NAMESPACES):
        member.set("name", f"{name}.{attribute(member, 'name')}")
        elements.append(member)
    for number, binding in enumerate(
        inner.findall("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES)
    ):
        binding.set(OWNER, ".".join(filter(None, (name, binding.get(OWNER)))))
        # what the outer system sets comes later, and counts
        _group(system, "ssd:ParameterBindings").insert(number, binding)
    connections = _group(system, "ssd:Connections")
    for wire in _wires(inner):
        for side in SIDES:
            owner = wire.get(f"{side}Element")
            wire.set(f"{side}Element", name if owner is None else f"{name}.{owner}")
        connections.append(wire)


def _ends_at(wire: Element, owner: str | None) -> list[str]:
    """Return the sides of a wire that are connectors of an owner; None is the system itself."""
    return [side for side in SIDES if wire.get(f"{side}Element") == owner]


def _parameter_aliases(system: Element, known: Aliases) -> Aliases:
    """Remove the parameter connectors of a system with their wires; return what they set."""
    connectors = _group(system, "ssd:Connectors")
    connections = _group(system, "ssd:Connections")
    aliases: Aliases = {}
    for connector in list(connectors):
        if connector.get("kind") == _PARAMETER:
            connectors.remove(connector)
            aliases[attribute(connector, "name")] = []
    for wire in list(connections):
        for side in _ends_at(wire, None):
            targets = aliases.get(attribute(wire, f"{side}Connector"))
            owner = wire.get(f"{OTHER[side]}Element")
            if targets is not None and owner is not None:
                connections.remove(wire)
                name = f"{owner}.{attribute(wire, f'{OTHER[side]}Connector')}"
                targets += known.get(name, [name])
    return aliases
