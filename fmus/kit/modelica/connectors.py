"""Modelica connectors of physical domains and of signals.

They are type compatible (section 6.4) with connectors of the Modelica Standard Library, so that a
``connect`` may join the two. The package needs no library, so that any compiler reads it.
"""

from __future__ import annotations

from typing import NamedTuple

from fmus.kit.modelica.names import identifier, string
from fmus.kit.ports import DOMAINS, PowerPort
from fmus.kit.units import to_modelica

INTERFACES = "Interfaces"  # name of their package


class _Connector(NamedTuple):
    """A connector of a physical domain.

    Attributes
    ----------
    name : str
    potential, flow : str
        Names of its variables.
    quantities : tuple of str
        ISO 80000 quantities of the two variables, with the names of the standard library.
    colour : str
        Colour of its icon: red, green, blue.
    """

    name: str
    potential: str
    flow: str
    quantities: tuple[str, str]
    colour: str


_CONNECTORS = {
    "electrical": _Connector("Pin", "v", "i", ("ElectricPotential", "ElectricCurrent"), "0,0,255"),
    "translational": _Connector("Flange", "s", "f", ("Length", "Force"), "0,127,0"),
    "rotational": _Connector("RotationalFlange", "phi", "tau", ("Angle", "Torque"), "95,95,95"),
    "thermal": _Connector(
        "HeatPort", "T", "Q_flow", ("ThermodynamicTemperature", "Power"), "191,0,0"
    ),
}
SIGNALS = {"real": "Real", "integer": "Integer", "boolean": "Boolean"}  # by type of the variable
_COLOURS = {"Real": "0,0,127", "Integer": "255,127,0", "Boolean": "255,0,255"}


def connector_class(domain: str) -> str:
    """Return the name of the connector of a domain, relative to the package of components."""
    return f"{INTERFACES}.{_CONNECTORS[domain].name}"


def signal_class(type: str, causality: str) -> str:
    """Return the name of the connector for a type of signal and ``Input`` or ``Output``."""
    return f"{INTERFACES}.{SIGNALS[type]}{causality}"


def port_equations(port: PowerPort) -> list[str]:
    """Write the equations between the variables of a port and those of its connectors.

    Parameters
    ----------
    port : PowerPort

    Returns
    -------
    list of str
    """
    connector = _CONNECTORS[port.domain]
    names = [identifier(name) for name in port.connectors]
    first, *others = names  # one other, or none
    potentials = " - ".join(f"{name}.{connector.potential}" for name in names)
    sign = "-" if port.delivers else ""
    potential = identifier(port.potential)
    lines = [
        f"{potential} = {potentials};",
        f"{identifier(port.flow)} = {sign}{first}.{connector.flow};",
    ]
    # the flow that enters at the first connector leaves at the other
    lines += [f"{first}.{connector.flow} + {name}.{connector.flow} = 0.0;" for name in others]
    if port.rate:
        lines.append(f"{identifier(port.rate)} = der({potential});")
    return lines


def interface_classes() -> dict[str, str]:
    """Write the classes of all connectors.

    Returns
    -------
    dict of str to str
        Text of each class by its name, without the ``within`` clause.
    """
    classes = {}
    for domain, connector in _CONNECTORS.items():
        units = DOMAINS[domain]
        variables = [
            _variable(connector.potential, connector.quantities[0], units.potential),
            f"flow {_variable(connector.flow, connector.quantities[1], units.flow)}",
        ]
        classes[connector.name] = "\n".join(
            [
                f'connector {connector.name} "{domain.capitalize()} connector"',
                *(f"  {variable};" for variable in variables),
                f"  annotation({_square(connector.colour)});",
                f"end {connector.name};",
            ]
        )
    for kind, colour in _COLOURS.items():
        for causality in ("Input", "Output"):
            name = f"{kind}{causality}"
            signal = f"{causality.lower()} {kind}"
            icon = f"annotation({_triangle(colour)})"
            classes[name] = f'connector {name} = {signal} "{causality} signal"\n  {icon};'
    return classes


def _variable(name: str, quantity: str, unit: str) -> str:
    return f"Real {name}(quantity={string(quantity)}, unit={string(to_modelica(unit))})"


def _square(colour: str) -> str:
    colours = f"lineColor={{{colour}}}, fillColor={{{colour}}}, fillPattern=FillPattern.Solid"
    return f"Icon(graphics={{Rectangle(extent={{{{-100,-100}},{{100,100}}}}, {colours})}})"


def _triangle(colour: str) -> str:
    colours = f"lineColor={{{colour}}}, fillColor={{{colour}}}, fillPattern=FillPattern.Solid"
    points = "{{-100,100},{100,0},{-100,-100}}"
    return f"Icon(graphics={{Polygon(points={points}, {colours})}})"
