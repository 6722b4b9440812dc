"""``terminalsAndIcons.xml`` of FMI 3.0, from the ports of a component."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from fmus.kit.build.parameters import serialized
from fmus.kit.component import Component
from fmus.kit.ports import PowerPort


def terminals(cls: type[Component], with_icon: bool) -> bytes:
    """Write ``terminalsAndIcons.xml``.

    A terminal has the two variables of a port: the potential, and the flow as an inflow or an
    outflow (FMI 3.0, section 2.4.9).

    Parameters
    ----------
    cls : type[Component]
    with_icon : bool
        Whether the folder has an icon, whose place in a diagram is then stated.

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    if with_icon:
        graphics = SubElement(root, "GraphicalRepresentation")
        corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
        SubElement(graphics, "CoordinateSystem", corners | {"suggestedScalingFactorTo_mm": "0.1"})
        SubElement(graphics, "Icon", corners)
    if cls.ports:
        parent = SubElement(root, "Terminals")
        for port in cls.ports:
            _append_terminal(parent, port)
    return serialized(root)


def _append_terminal(parent: Element, port: PowerPort) -> None:
    """Append the terminal of a port."""
    node = SubElement(
        parent,
        "Terminal",
        name=port.name,
        matchingRule="plug",
        terminalKind=port.domain,
        description=f"{port.domain}: {port.potential} and {port.flow}",
    )
    members = {
        port.potential: ("potential", "signal"),
        port.flow: ("flow", "outflow" if port.delivers else "inflow"),
    }
    for variable, (member, kind) in members.items():
        SubElement(
            node,
            "TerminalMemberVariable",
            variableName=variable,
            memberName=member,
            variableKind=kind,
        )
