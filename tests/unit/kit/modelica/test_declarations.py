"""Claims: variables have type, causality and attributes; what an FMU computes has no start."""

import pytest

from fmus import component
from fmus.kit.modelica.declarations import declarations, declared_identifiers
from tests.support.kit_samples import Thermostat


def named(name, states=True):
    return next(line for line in declarations(Thermostat, states) if f" {name}" in line)


def test_attributes_are_those_of_the_component():
    assert named("capacity") == (
        'parameter Real capacity(unit="J/K", min=0.001, max=1000000.0) = 20.0'
        ' "heat capacity of the room";'
    )
    assert named("stages").startswith("parameter Integer stages(min=1, max=5) = 2 ")
    assert named("enabled").startswith("parameter Boolean enabled = true ")
    assert named("boost").startswith("Interfaces.BooleanInput boost(start=false) ")
    assert 'displayUnit="degC"' in named("setpoint")


def test_states_start_from_their_parameters():
    assert named("on(").startswith("Interfaces.BooleanOutput on(start=on_start, fixed=true) ")
    assert named("energy(").startswith('Real energy(start=energy_start, fixed=true, unit="J"')


@pytest.mark.slow
def test_of_what_is_computed_elsewhere_only_the_interface_is_there():
    lines = [l for l in declarations(Thermostat, states=False) if not l.startswith("parameter")]
    assert any(line.startswith("Interfaces.BooleanOutput on ") for line in lines)
    assert not any(" energy(" in line or " changes(" in line for line in lines)
    assert not any("fixed" in line for line in lines)


def test_names_of_variables_and_of_connectors_are_taken():
    taken = declared_identifiers(component("ppy_actuator"))
    assert {"p", "n", "flange_a", "flange_b"} <= taken
    assert {"voltage", "charge", "R1"} <= taken
