"""Claims: a model says what it is, and every connector has a place of its own on its icon."""

import re

import pytest

import fmus
from fmus.kit.modelica.annotations import annotation, placements
from tests.support.kit_samples import Thermostat


def middle(annotation):
    left, low, right, high = map(int, re.findall(r"-?\d+", annotation))
    return (left + right) / 2, (low + high) / 2


@pytest.mark.parametrize("name", ["galvanostat", "foot", "pid"])
def test_inputs_are_left_outputs_right_and_ports_below(name):
    cls = fmus.component(name)
    places = {key: middle(text) for key, text in placements(cls).items()}
    assert len(set(places.values())) == len(places)
    at_ports = {n for port in cls.ports for n in port.variables}
    for v in cls.layout.inputs:
        assert (v.name in places) == (v.name not in at_ports)
        assert v.name in at_ports or places[v.name][0] == -110
    for v in cls.layout.shown:
        assert places[v.name][0] == 110
    for port in cls.ports:
        assert all(places[connector][1] == -110 for connector in port.connectors)


def test_the_documentation_is_that_of_the_class_with_what_was_made_of_it():
    cls = type(
        "Cold", (Thermostat,), {"remark": "fitted to x < 3\nof <b>", "__doc__": 'A "cold" one.'}
    )
    info = annotation(cls).partition("Documentation(info=")[2]
    assert info == (
        '"<html><p>A &quot;cold&quot; one.</p><p>fitted to x &lt; 3</p>'
        '<p>of &lt;b&gt;</p></html>"));'
    )
