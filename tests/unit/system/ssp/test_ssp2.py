"""Claims: what is written as SSP 2.0 is valid, others' files of it are read, and what is not taken
is refused in a line.

Oracle: the XML schemas of SSP 2.0.
"""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest

from orchestration.system import ssp
from tests.support.system.archive import INLINE, NAMESPACES, repacked
from tests.support.system.mixed import mixed
from tests.support.system.ssp_files import contents, refused, schemas_of_2, validate


@pytest.fixture(name="mixed")
def _mixed(tmp_path):
    return mixed(tmp_path)


@pytest.fixture
def archive(mixed, tmp_path):
    ssp.write(mixed, tmp_path / "mixed.ssp", connectors=True)
    return tmp_path / "mixed.ssp"


@pytest.mark.parametrize("connectors", [False, True])
def test_what_is_written_is_valid(mixed, tmp_path, connectors):
    ssp.write(mixed, tmp_path / "a.ssp", connectors)
    schemas = {".ssd": "SystemStructureDescription", ".ssv": "SystemStructureParameterValues"}
    checked = set()
    with zipfile.ZipFile(tmp_path / "a.ssp") as found:
        for name in found.namelist():
            ending = Path(name).suffix
            if ending in schemas:
                validate(found.read(name), f"{schemas[ending]}.xsd", schemas_of_2())
                checked.add(ending)
    assert checked == set(schemas)


@pytest.mark.parametrize("dimension", ["<ssc:Dimension/>", '<ssc:Dimension sizeConnector="n"/>'])
def test_a_size_that_is_left_open_is_that_of_the_variable(mixed, archive, tmp_path, dimension):
    other = repacked(archive, lambda text: text.replace('<ssc:Dimension size="2" />', dimension))
    assert contents(ssp.read(other, tmp_path / "u")) == contents(mixed)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('version="2.0" name="mixed"', 'version="3.0" name="mixed"', "SSP version 3.0; this"),
        ('version="2.0" name="mixed"', 'name="mixed"', "SSP version not stated; this program"),
        ('version="2.0" name="mixed"', 'version="2" name="mixed"', "SSP version 2; this program"),
        (
            "ssc:Float32 ",
            "ssc:Float16 ",
            "Float16, in Connector to f32, is not known to this program; known: Binary",
        ),
        ("ssc:Float32 ", "ssc:Binary ", "'f32_in' is declared as Binary, but in the FMU it is"),
        ("ssc:Float32 ", "ssc:Clock ", "member new: connector 'f32_in' is Clock; known are"),
        (
            '"f32_out" kind="output">',
            '"f32_out" kind="output"><ssc:Dimension/>',
            "'f32_out' is declared as any elements, but in the FMU it has no dimension",
        ),
        (
            '"of f32" kind="output">',
            '"of f32" kind="output"><ssc:Dimension size="2"/>',
            "connection new.f32_out -> of f32: from no dimension to 2 elements",
        ),
        (
            'size="2" />',
            'size="two" />',
            "is declared as two elements, but in the FMU it has 2",
        ),
        (
            'size="2" />',
            'size="2" /><ssc:Dimension size="1" />',
            "is declared as 2 by 1 elements, but in the FMU it has 2",
        ),
        (
            'implementation="CoSimulation"',
            'implementation="ScheduledExecution"',
            "is run by CoSimulation, not by ScheduledExecution",
        ),
        ("</ssd:System>", "</ssd:System><ssd:SSDVariant/>", "SSDVariant, in SystemStructureDesc"),
    ],
)
def test_what_is_not_taken_is_refused_in_a_line(archive, tmp_path, old, new, message):
    def change(text):
        assert old in text
        return text.replace(old, new)

    refused(repacked(archive, change), tmp_path / "u", message)


def with_parameter(text):
    """A description with a set of SSP 2.0 for the member of FMI 3.0."""
    values = INLINE.format(text).replace('version="1.0"', 'version="2.0"')
    values = values.replace("<ssd:ParameterBinding>", f"<ssd:ParameterBinding {NAMESPACES}>")
    found = re.compile(r'<ssd:ParameterBinding [^>]*source="resources/new.ssv" />')
    return lambda description: found.sub(values, description)


@pytest.mark.parametrize(
    ("name", "element", "value"),
    [
        ("f64_in", '<ssv:Float64 value="0.25"/>', 0.25),
        ("f64_in", '<ssv:Float32 value="0.25"/>', 0.25),
        ("u8_in", '<ssv:UInt8 value="255"/>', 255.0),
        ("i64_in", '<ssv:Int64 value="-3"/>', -3.0),
        ("mood_in", '<ssv:Enumeration value="sad"/>', -4.0),
        ("word", '<ssv:String value="x y"/>', "x y"),
    ],
)
def test_parameters_of_others(archive, tmp_path, name, element, value):
    parameter = f'<ssv:Parameter name="{name}">{element}</ssv:Parameter>'
    found = ssp.read(repacked(archive, with_parameter(parameter)), tmp_path / "u")
    assert dict(found.member("new").parameters) == {name: value}


def test_arrays_among_the_parameters_of_others(archive, tmp_path):
    sizes = '<ssc:Dimension size="2"/><ssc:Dimension size="3"/>'
    words = '<ssv:Value value="a b"/><ssv:Value value="c"/>'
    parameters = (
        f'<ssv:Parameter name="whole"><ssv:Int32 value="1 2 3 4 5 6"/>{sizes}</ssv:Parameter>'
        f'<ssv:Parameter name="words"><ssv:String>{words}</ssv:String></ssv:Parameter>'
    )
    found = ssp.read(repacked(archive, with_parameter(parameters)), tmp_path / "u")
    whole = {
        f"whole[{row},{column}]": 3.0 * row + column - 3.0 for row in (1, 2) for column in (1, 2, 3)
    }
    assert dict(found.member("new").parameters) == whole | {"words[1]": "a b", "words[2]": "c"}


@pytest.mark.parametrize(
    ("name", "element", "message"),
    [
        ("mood_in", '<ssv:Enumeration value="grim"/>', "its enumeration has no item named 'grim'"),
        ("i32_in", '<ssv:Enumeration value="glad"/>', "its enumeration has no item named 'glad'"),
        ("f64_in", '<ssv:Int32 value="1"/>', "given as integer, but the FMU has it as real"),
        ("f64_in", '<ssv:Float128 value="1"/>', "parameter f64_in is Float128; known are Float32"),
        ("f64_in", '<ssv:Float64 value="1"/><ssc:Dimension/>', "in the FMU it has no dimension"),
        ("f64_in", '<ssv:Float64 value="1 2"/>', "'1 2' is not a number"),
        ("whole", '<ssv:Int32 value="1 2"/>', "whole: has 2 values; expected 6"),
        ("f64_in", '<ssv:Binary value="00"/>', "f64_in: given as string, but the FMU has it as"),
    ],
)
def test_parameters_that_are_not_taken(archive, tmp_path, name, element, message):
    parameter = f'<ssv:Parameter name="{name}">{element}</ssv:Parameter>'
    refused(repacked(archive, with_parameter(parameter)), tmp_path / "u", "member new", message)


def test_a_parameter_set_of_another_version(archive, tmp_path):
    change = with_parameter("")
    other = repacked(
        archive, lambda text: change(text).replace('n="2.0" name="s"', 'n="4.0" name="s"')
    )
    refused(other, tmp_path / "u", "member new: a ParameterSet: SSP version 4.0; this program")
