"""Claims: connectors have the variables of those of the Modelica Standard Library 4.0, in SI."""

import pymoca.parser
import pytest

from fmus.kit import PowerPort
from fmus.kit.modelica.connectors import (
    connector_class,
    interface_classes,
    port_equations,
    signal_class,
)

# of Modelica.Electrical.Analog, Mechanics.Translational and .Rotational, Thermal.HeatTransfer
STANDARD = {
    "electrical": ({"v": "V"}, {"i": "A"}),
    "translational": ({"s": "m"}, {"f": "N"}),
    "rotational": ({"phi": "rad"}, {"tau": "N.m"}),
    "thermal": ({"T": "K"}, {"Q_flow": "W"}),
}


@pytest.mark.parametrize("domain", STANDARD)
def test_variables_are_those_of_the_standard_library(domain):
    name = connector_class(domain).removeprefix("Interfaces.")
    parsed = pymoca.parser.parse(interface_classes()[name]).classes[name]
    read = ({}, {})
    for symbol in parsed.symbols.values():
        attributes = symbol.class_modification.arguments
        unit = next(a.value for a in attributes if a.value.component.name == "unit")
        read["flow" in symbol.prefixes][symbol.name] = unit.modifications[0].value
    assert parsed.type == "connector"
    assert read == STANDARD[domain]


@pytest.mark.parametrize("causality", ["Input", "Output"])
@pytest.mark.parametrize("type", ["real", "integer", "boolean"])
def test_signals_are_short_classes(type, causality):
    name = signal_class(type, causality).removeprefix("Interfaces.")
    start = f"connector {name} = {causality.lower()} {type.capitalize()} "
    assert interface_classes()[name].startswith(start)
    assert pymoca.parser.parse(interface_classes()[name]).classes[name].type == "connector"


def test_two_connectors_share_a_difference_and_pass_the_flow_on():
    port = PowerPort("circuit", "electrical", "voltage", "current", ("p", "n"))
    assert port_equations(port) == [
        "voltage = p.v - n.v;",
        "current = p.i;",
        "p.i + n.i = 0.0;",
    ]


def test_a_flow_that_is_delivered_leaves():
    port = PowerPort(
        "joint", "rotational", "angle", "torque", ("joint",), delivers=True, rate="speed"
    )
    assert port_equations(port) == [
        "angle = joint.phi;",
        "torque = -joint.tau;",
        "speed = der(angle);",
    ]
