"""Claims: a component's ports are its terminals, of which each has a potential and a flow."""

from __future__ import annotations

from pathlib import Path

import fmpy
import lxml.etree
import pytest

import fmus
from fmus.kit.build.description import terminals
from tests.support.kit_samples import Divider

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"


def parsed(cls, with_icon=True):
    root = lxml.etree.fromstring(terminals(cls, with_icon))
    lxml.etree.XMLSchema(lxml.etree.parse(SCHEMA)).assertValid(root)
    return root


def read(cls):
    root = parsed(cls)
    return {
        node.get("name"): {
            member.get("memberName"): (member.get("variableName"), member.get("variableKind"))
            for member in node
        }
        for node in root.iter("Terminal")
    }


def test_the_muscle_has_a_circuit_and_a_chain():
    circuit, chain = read(fmus.component("ppy_actuator")).values()
    assert circuit == {"potential": ("voltage", "signal"), "flow": ("current", "inflow")}
    assert {kind for _, kind in chain.values()} <= {"signal", "inflow", "outflow"}


def test_the_flow_of_a_source_goes_out():
    (circuit,) = read(fmus.component("galvanostat")).values()
    assert circuit == {"potential": ("voltage", "signal"), "flow": ("current", "outflow")}


@pytest.mark.parametrize(
    ("proxy", "name"),
    [
        ("rig_proxy", "ppy_actuator"),
        ("rig_proxy_length_driven", "ppy_actuator_length_driven"),
    ],
)
def test_a_proxy_has_the_terminals_of_what_it_takes_the_place_of(proxy, name):
    assert read(fmus.component(proxy)) == read(fmus.component(name))


@pytest.mark.parametrize("name", fmus.PROXIES)
def test_every_proxy_has_the_circuit_of_the_actuator(name):
    circuit = {"potential": ("voltage", "signal"), "flow": ("current", "inflow")}
    assert read(fmus.component(name))["circuit"] == circuit


@pytest.mark.parametrize("name", fmus.MODELS)
def test_members_are_variables_and_no_terminal_is_twice(name):
    cls = fmus.component(name)
    members = [variable for terminal in read(cls).values() for variable, _ in terminal.values()]
    assert set(members) <= set(cls.layout.names)


def test_without_ports_there_is_no_terminal():
    assert read(Divider) == {}


@pytest.mark.parametrize("with_icon", [True, False])
def test_an_icon_has_a_place_if_there_is_one(with_icon):
    root = parsed(fmus.component("ppy_actuator"), with_icon)
    assert len(list(root.iter("Icon"))) == with_icon
    assert len(list(root.iter("Terminal"))) == 2
