"""Modelica connectors of physical domains and of signals.

They are type compatible (section 6.4) with connectors of the Modelica Standard Library, so that a
``connect`` may join the two. The package needs no library, so that any compiler reads it.
"""

from __future__ import annotations

from typing import NamedTuple

from fmus.kit.modelica.graphics import SIGNAL, box, placement, square, triangle
from fmus.kit.modelica.names import PACKAGE, identifier, string
from fmus.kit.ports import DOMAINS, PowerPort
from fmus.kit.units import to_modelica

INTERFACES = "Interfaces"  # name of their package
SOURCES = "Sources"  # name of the package of sources


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
    sources : tuple of str
        Sources of the two variables, by name.
    reference : str
        Name for a component at which the potential is zero.
    symbol : str
        Points of the line that stands for the domain on icons.
    """

    name: str
    potential: str
    flow: str
    quantities: tuple[str, str]
    colour: str
    sources: tuple[str, str]
    reference: str
    symbol: str


_CONNECTORS = {
    "electrical": _Connector(
        "Pin",
        "v",
        "i",
        ("ElectricPotential", "ElectricCurrent"),
        "0,0,255",
        ("Voltage", "Current"),
        "ground",
        "{-40,0},{-30,0},{-20,15},{-5,-15},{5,15},{20,-15},{30,0},{40,0}",
    ),
    "translational": _Connector(
        "Flange",
        "s",
        "f",
        ("Length", "Force"),
        "0,127,0",
        ("Position", "Force"),
        "frame",
        "{-40,0},{40,0},{25,12},{40,0},{25,-12}",
    ),
    "rotational": _Connector(
        "RotationalFlange",
        "phi",
        "tau",
        ("Angle", "Torque"),
        "95,95,95",
        ("Angle", "Torque"),
        "bearing",
        "{30,-25},{40,0},{25,25},{0,35},{-25,25},{-40,0},{-30,5},{-40,0},{-45,15}",
    ),
    "thermal": _Connector(
        "HeatPort",
        "T",
        "Q_flow",
        ("ThermodynamicTemperature", "Power"),
        "191,0,0",
        ("Temperature", "HeatFlow"),
        "absolute_zero",
        "{-10,-40},{10,-15},{-10,10},{10,35},{-2,28},{10,35},{12,20}",
    ),
}
SIGNALS = {"real": "Real", "integer": "Integer", "boolean": "Boolean"}  # by type of the variable
_COLOURS = {"Real": SIGNAL, "Integer": "255,127,0", "Boolean": "255,0,255"}


def connector_class(domain: str) -> str:
    """Return the name of the connector of a domain, relative to the package of components."""
    return f"{INTERFACES}.{_CONNECTORS[domain].name}"


def signal_class(type: str, causality: str) -> str:
    """Return the name of the connector for a type of signal and ``Input`` or ``Output``."""
    return f"{INTERFACES}.{SIGNALS[type]}{causality}"


def symbol(domain: str) -> tuple[str, str]:
    """Return the points and the colour of the line that stands for a domain on icons."""
    connector = _CONNECTORS[domain]
    return connector.symbol, connector.colour


def source_class(domain: str, is_flow: bool) -> str:
    """Return the full name of the source of the potential or of the flow of a domain."""
    return f"{PACKAGE}.{SOURCES}.{_CONNECTORS[domain].sources[is_flow]}"


def reference_name(domain: str) -> str:
    """Return the name for a component at which the potential of a domain is zero."""
    return _CONNECTORS[domain].reference


def source_classes() -> dict[str, str]:
    """Write the classes of the sources of all domains.

    Returns
    -------
    dict of str to str
        Text of each class by its name, without the ``within`` clause.
    """
    classes = {}
    for domain, connector in _CONNECTORS.items():
        # a flow counts into a component, so that a source's own is negative
        equations = (f"c.{connector.potential} = value;", f"c.{connector.flow} = -value;")
        for name, unit, equation in zip(connector.sources, DOMAINS[domain], equations, strict=True):
            classes[name] = "\n".join(
                [
                    f'model {name} "Source of {name.lower()} at its connector"',
                    f"  {INTERFACES}.RealInput value(unit={string(to_modelica(unit))})"
                    f"{placement(-110, 0)};",
                    f"  {INTERFACES}.{connector.name} c{placement(110, 0)};",
                    "equation",
                    f"  {equation}",
                    f"  annotation({box(connector.colour, [symbol(domain)])});",
                    f"end {name};",
                ]
            )
    return classes


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
                f"  annotation({square(connector.colour)});",
                f"end {connector.name};",
            ]
        )
    for kind, colour in _COLOURS.items():
        for causality in ("Input", "Output"):
            name = f"{kind}{causality}"
            signal = f"{causality.lower()} {kind}"
            icon = f"annotation({triangle(colour)})"
            classes[name] = f'connector {name} = {signal} "{causality} signal"\n  {icon};'
    return classes


def _variable(name: str, quantity: str, unit: str) -> str:
    return f"Real {name}(quantity={string(quantity)}, unit={string(to_modelica(unit))})"
