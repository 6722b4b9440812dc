"""Claims: arrays in a description of SSP 2.0 that another has written are read as its text says:
an array of the system is its elements, a whole connection one of each element with the same, and
indices, from 1, restrict a connection to an element.

Oracle: a description written by hand from the text of the standard, valid by its schema.
"""

from __future__ import annotations

import re

import pytest

from orchestration.system import Member, Port, System, connect, ssp
from orchestration.system.checking import check
from tests.support.fmi3_fmus import description, pack, wide_body
from tests.support.system.archive import DESCRIPTION, NAMESPACES
from tests.support.system.ssp_files import contents, refused, schemas_of_2, validate

FMU = 'type="application/x-fmu-sharedlibrary" source="resources/'
TEXT = f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription {NAMESPACES} version="2.0" name="by hand">
  <ssd:System name="by hand">
    <ssd:Connectors>
      <ssd:Connector name="load" kind="input"><ssc:Float64/><ssc:Dimension size="2"/>
      </ssd:Connector>
      <ssd:Connector name="single" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="end" kind="output"><ssc:Float64/></ssd:Connector>
      <ssd:Connector name="ends" kind="output"><ssc:Float64/><ssc:Dimension size="1"/>
        <ssc:Dimension size="2"/></ssd:Connector>
      <ssd:Connector name="mood" kind="output"><ssc:Enumeration name="State"/></ssd:Connector>
    </ssd:Connectors>
    <ssd:Elements>
      <ssd:Component name="one" {FMU}wide.fmu">
        <ssd:Connectors>
          <ssd:Connector name="u" kind="input"><ssc:Float64/><ssc:Dimension size="2"/>
          </ssd:Connector>
          <ssd:Connector name="y" kind="output"><ssc:Float64/><ssc:Dimension/></ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
      <ssd:Component name="two" {FMU}wide.fmu">
        <ssd:Connectors>
          <ssd:Connector name="u" kind="input"/>
          <ssd:Connector name="y" kind="output"/>
        </ssd:Connectors>
      </ssd:Component>
      <ssd:Component name="rates" {FMU}arrays.fmu">
        <ssd:Connectors>
          <ssd:Connector name="n" kind="structuralParameter"><ssc:UInt64/></ssd:Connector>
          <ssd:Connector name="A" kind="parameter"><ssc:Float64/>
            <ssc:Dimension sizeConnector="n"/><ssc:Dimension sizeConnector="n"/></ssd:Connector>
          <ssd:Connector name="u" kind="input"/>
        </ssd:Connectors>
        <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
          <ssv:ParameterSet version="2.0" name="rates"><ssv:Parameters>
            <ssv:Parameter name="C"><ssv:Float64 value="1 2 3 4 5 6"/>
              <ssc:Dimension size="2"/><ssc:Dimension size="3"/></ssv:Parameter>
          </ssv:Parameters></ssv:ParameterSet>
        </ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
      </ssd:Component>
      <ssd:Component name="types" {FMU}types.fmu">
        <ssd:Connectors>
          <ssd:Connector name="mood_in" kind="input"><ssc:Enumeration name="State"/>
          </ssd:Connector>
          <ssd:Connector name="mood_out" kind="output"><ssc:Enumeration name="State"/>
          </ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startConnector="load" endElement="one" endConnector="u"/>
      <ssd:Connection startElement="one" startConnector="y" startIndices="2"
          endElement="two" endConnector="u" endIndices="1"/>
      <ssd:Connection startConnector="single" endElement="two" endConnector="u" endIndices="2"/>
      <ssd:Connection startElement="two" startConnector="y" endElement="rates" endConnector="u"/>
      <ssd:Connection startElement="one" startConnector="y" startIndices="1" endConnector="end"/>
      <ssd:Connection startElement="two" startConnector="y" startIndices="1" endConnector="ends"
          endIndices="1 2"/>
      <ssd:Connection startElement="two" startConnector="y" startIndices="2" endConnector="ends"
          endIndices="1 1"/>
      <ssd:Connection startElement="types" startConnector="mood_out" endConnector="mood"/>
    </ssd:Connections>
  </ssd:System>
  <ssd:Enumerations>
    <ssc:Enumeration name="State"><ssc:Item name="glad" value="1"/><ssc:Item name="sad" value="-4"/>
    </ssc:Enumeration>
  </ssd:Enumerations>
</ssd:SystemStructureDescription>
"""


def written(path, text=TEXT):
    """The description with the FMUs that it names; those that are there have their time."""
    bodies = {"wide": wide_body(2), "arrays": None, "types": None}
    for name, body in bodies.items():
        if not path.with_name(f"{name}.fmu").exists():
            pack(path.with_name(f"{name}.fmu"), {"modelDescription.xml": description(name, body)})
    fmus = {f"resources/{n}.fmu": path.with_name(f"{n}.fmu").read_bytes() for n in bodies}
    return pack(path, fmus | {DESCRIPTION: text})


def test_it_is_valid():
    validate(TEXT.encode(), "SystemStructureDescription.xsd", schemas_of_2())


def test_it_is_read_as_its_text_says(tmp_path):
    found = ssp.read(written(tmp_path / "hand.ssp"), tmp_path / "u")
    check(found)
    values = {f"C[{row},{col}]": 3.0 * row + col - 3.0 for row in (1, 2) for col in (1, 2, 3)}
    names = {"one": "wide", "two": "wide", "rates": "arrays", "types": "types"}
    members = tuple(
        Member(name, tmp_path / f"{fmu}.fmu", values if name == "rates" else {})
        for name, fmu in names.items()
    )
    links = connect("one.y[2] -> two.u[1]", "two.y[1] -> rates.u[1]", "two.y[2] -> rates.u[2]")
    inputs = {
        "load[1]": (Port("one", "u[1]"),),
        "load[2]": (Port("one", "u[2]"),),
        "single": (Port("two", "u[2]"),),
    }
    outputs = {
        "end": Port("one", "y[1]"),
        "ends[1,1]": Port("two", "y[2]"),
        "ends[1,2]": Port("two", "y[1]"),
        "mood": Port("types", "mood_out"),
    }
    expected = System("by hand", members, links, inputs, outputs)
    assert contents(found) == contents(expected)
    assert list(found.outputs) == list(outputs)


def test_the_names_of_the_ends_do_not_tell_the_direction(tmp_path):
    named = {"start": "end", "end": "start"}
    turned = re.sub(
        "(start|end)(Element|Connector|Indices)=", lambda m: f"{named[m[1]]}{m[2]}=", TEXT
    )
    assert turned != TEXT
    straight = ssp.read(written(tmp_path / "hand.ssp"), tmp_path / "u")
    found = ssp.read(written(tmp_path / "turned.ssp", turned), tmp_path / "v")
    assert contents(found) == contents(straight)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('endIndices="1"', 'endIndices="3"', "two.u: u: there is no element 3; it has 2 elements"),
        ('endIndices="1"', 'endIndices="0"', "u: there is no element 0; it has 2 elements"),
        ('endIndices="1"', 'endIndices="1 1"', "u: there is no element 1,1; it has 2 elements"),
        ('endIndices="1"', 'endIndices="a"', "endIndices 'a' are no whole numbers"),
        ('endIndices="1"', 'endIndices="-1"', "endIndices '-1' are no whole numbers"),
        ('endIndices="1"', 'endIndices="1-2"', "endIndices '1-2' are no whole numbers"),
        ('endIndices="1"', "", "one.y -> two.u: from no dimension to 2 elements"),
        (
            'startConnector="mood_out"',
            'startConnector="mood_out" startIndices="1"',
            "mood_out: there is no element 1; it has no dimension",
        ),
        ('name="single"', 'name="load"', "two connectors of the system are named 'load'"),
        (
            'endIndices="1 2"',
            'endIndices="1 1"',
            "system output ends[1,1] has two sources, two.y[1",
        ),
        (
            'endConnector="ends"\n          endIndices="1 2"',
            'endConnector="end"',
            "system output end has two sources, one.y[1] is one",
        ),
        ('<ssc:Dimension size="2"/>', "<ssc:Dimension/>", "a dimension of size not stated; known"),
        ('<ssc:Dimension size="2"/>', '<ssc:Dimension size="-2"/>', "a dimension of size '-2'; kn"),
        (
            '<ssc:Dimension size="2"/>',
            f'<ssc:Dimension size="{10**17}"/>',
            f"'load' of the system has {10**17} elements; at most 200,000 are taken",
        ),
        (
            'endConnector="u"/>',
            'endConnector="u"><ssc:LinearTransformation factor="2"/></ssd:Connection>',
            "load -> one.u: a transformation at a connector of the system is not known",
        ),
    ],
)
def test_what_does_not_fit_is_refused_in_a_line(tmp_path, old, new, message):
    assert old in TEXT
    path = written(tmp_path / "other.ssp", TEXT.replace(old, new, 1))
    refused(path, tmp_path / "u", message)


def test_arrays_of_one_number_of_elements_and_other_shapes_do_not_fit(tmp_path):
    two_rows = TEXT.replace('startIndices="2" endConnector="ends"', 'endConnector="ends"', 1)
    two_rows = two_rows.replace('\n          endIndices="1 1"', "", 1)
    assert two_rows.count("endIndices") == TEXT.count("endIndices") - 1
    path = written(tmp_path / "other.ssp", two_rows)
    refused(path, tmp_path / "u", "two.y -> ends: from 2 elements to 1 by 2 elements")
