"""Claims: what is written is SSP 1.0 and reads back the same; what is read is judged before
anything is unpacked.

Oracles: the XML schemas of SSP 1.0 that fmpy ships, and fmpy's own reader.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from orchestration.system import System, ssp
from tests.support.system.archive import BINDINGS, INLINE, NAMESPACES, SET, repacked
from tests.support.system.ssp_files import bound, contents, refused, refused_one

# --- there and back
# --------------------------------------------------------------------------------------------------


# --- parameters of others
# ---------------------------------------------------------------------------------------------


def parameters(path, folder):
    """Parameters of the drive, read."""
    return dict(ssp.read(path, folder).members[0].parameters)


def test_values_are_converted_to_the_units_of_the_fmu(archive, tmp_path):
    text = INLINE.format(
        '<ssv:Parameter name="gain"><ssv:Real value="2e3" unit="mN/A"/></ssv:Parameter>'
    )
    other = repacked(archive, bound(text))
    assert parameters(other, tmp_path / "u") == {"gain": pytest.approx(2.0)}


def test_values_in_a_file_of_their_own(archive, tmp_path):
    values = SET.format('<ssv:Parameter name="in"><ssv:Real value="2"/></ssv:Parameter>')
    values = values.replace("<ssv:ParameterSet", f"<ssv:ParameterSet {NAMESPACES}")
    text = '<ssd:ParameterBinding source="resources/my%20set.ssv" prefix="ga"/>'
    other = repacked(archive, bound(text), [("resources/my set.ssv", values)])
    assert parameters(other, tmp_path / "u") == {"gain": 2.0}


def test_values_of_the_system_go_over_those_of_the_member(archive, tmp_path):
    values = INLINE.format('<ssv:Parameter name="drive.gain"><ssv:Real value="7"/></ssv:Parameter>')
    block = f"{BINDINGS.format(values)}<ssd:Elements>".replace(
        "<ssv:ParameterSet", f"<ssv:ParameterSet {NAMESPACES}"
    )
    other = repacked(archive, lambda text: text.replace("<ssd:Elements>", block))
    assert parameters(other, tmp_path / "u") == {"gain": 7.0, "steps": -3.0, "armed": 1.0}


@pytest.mark.parametrize(
    ("value", "parts"),
    [
        (
            '<ssv:Parameter name="gian"><ssv:Real value="1"/></ssv:Parameter>',
            ["'gian'", "did you mean gain"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:Real value="1" unit="V"/></ssv:Parameter>',
            ["gain", "'V'", "'N/A'"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:Real value="1" unit="bananas"/></ssv:Parameter>',
            ["gain", "bananas"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:Real value="much"/></ssv:Parameter>',
            ["gain", "'much' is not a number"],
        ),
        ('<ssv:Parameter name="gain"><ssv:Real/></ssv:Parameter>', ["'' is not a number"]),
        (
            '<ssv:Parameter name="gain"><ssv:Integer value="1"/></ssv:Parameter>',
            ["given as integer", "has it as real"],
        ),
        (
            '<ssv:Parameter name="armed"><ssv:Boolean value="on"/></ssv:Parameter>',
            ["'on' is neither true nor false"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:String value="1"/></ssv:Parameter>',
            ["given as string", "has it as real"],
        ),
        (
            '<ssv:Parameter name="gain"><ssv:Binary value="1"/></ssv:Parameter>',
            ["parameter gain is Binary"],
        ),
        ('<ssv:Parameter name="gain"/>', ["parameter gain is nothing"]),
    ],
)
def test_parameters_that_cannot_be_set(archive, tmp_path, value, parts):
    refused(repacked(archive, bound(INLINE.format(value))), tmp_path / "u", "member drive", *parts)


@pytest.mark.parametrize(
    ("binding", "part"),
    [
        ('<ssd:ParameterBinding source="resources/gone.ssv"/>', "resources/gone.ssv is missing"),
        ('<ssd:ParameterBinding source="../gone.ssv"/>', "'../gone.ssv' leads out"),
        ('<ssd:ParameterBinding source="file:///etc/passwd"/>', "'file:///etc/passwd' leads out"),
        (
            '<ssd:ParameterBinding source="SystemStructure.ssd"/>',
            "is a SystemStructureDescription, not a ParameterSet",
        ),
        ('<ssd:ParameterBinding source="resources/drive.fmu"/>', "it is not well-formed XML"),
        (
            "<ssd:ParameterBinding><ssd:ParameterMapping/></ssd:ParameterBinding>",
            "parameter mappings are not known",
        ),
        ('<ssd:ParameterBinding sourceBase="component" source="x"/>', "inside of an FMU"),
    ],
)
def test_bindings_that_cannot_be_followed(archive, tmp_path, binding, part):
    refused(repacked(archive, bound(binding)), tmp_path / "u", part)


# --- structure of others
# ----------------------------------------------------------------------------------------------

WAY = 'startElement="drive" startConnector="way" endElement="second load" endConnector="length"'
WIRE = (
    '<ssd:Connection startElement="drive" startConnector="force" endElement="load"'
    ' endConnector="force" />'
)


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ('name="drive" type', 'name="load" type', ["two members have one name"]),
        (
            "resources/drive.fmu",
            "resources/gone.fmu",
            ["member drive", "resources/gone.fmu is missing"],
        ),
        ("resources/drive.fmu", "../drive.fmu", ["member drive", "'../drive.fmu' leads out"]),
        ("resources/drive.fmu", "resources/%2e%2e/%2e%2e/drive.fmu", ["member drive", "leads out"]),
        ("resources/drive.fmu", "/drive.fmu", ["member drive", "leads out"]),
        ("resources/drive.fmu", "C:/drive.fmu", ["member drive", "leads out"]),
        ("resources/drive.fmu", "", ["member drive", "'' leads out"]),
        (
            "resources/drive.fmu",
            "SystemStructure.ssd",
            ["SystemStructure.ssd", "not a zip archive"],
        ),
        (
            "application/x-fmu-sharedlibrary",
            "application/x-ssp-package",
            ["of type application/x-ssp-package"],
        ),
        ('implementation="CoSimulation"', 'implementation="ModelExchange"', ["model exchange"]),
        ("ssd:Elements", "ssd:Parts", ["Parts, in System sample, is not known to this program"]),
        (
            'version="1.0" name="sample"',
            'version="3.0" name="sample"',
            ["SSP version 3.0", "knows SSP 1.0 and 2.0"],
        ),
        (
            'baseStepSize="0.30000000000000004"',
            'baseStepSize="fast"',
            ["baseStepSize 'fast'", "not a finite number"],
        ),
        ('stopTime="0.001"', 'stopTime="-1"', ["stop time -1 s"]),
        (
            WAY,
            WAY.replace("second ", "third "),
            ["drive.way -> third load.length", "no member named 'third load'"],
        ),
        (WAY, WAY.replace("way", "wax"), ["drive has no output named 'wax'", "did you mean way"]),
        (
            WAY,
            WAY.replace('startConnector="way"', ""),
            ["a Connection has no attribute 'startConnector'"],
        ),
        (
            'suppressUnitConversion="true"',
            "",
            ["drive.way -> second load.length", "'m' to 'mm'", "suppressUnit"],
        ),
        ('factor="1000.0"', 'factor="x"', ["factor 'x' of a LinearTransformation"]),
        (
            "ssc:LinearTransformation",
            "ssc:IntegerMappingTransformation",
            ["MappingTransformation, in Connection"],
        ),
        (WIRE, WIRE + WIRE, ["load.force has two sources, drive.force and drive.force"]),
        (
            'startConnector="room"',
            'startConnector="roof"',
            ["roof -> load.warm", "leads from no input of the system"],
        ),
        (
            'startElement="load" startConnector="tension" endConnector="pull"',
            'startElement="load" startConnector="tension" endConnector="tension"',
            ["tension", "two sources"],
        ),
        (
            '<ssd:Connection startElement="load" startConnector="tension" endConnector="pull" />',
            "",
            ["system output pull is connected with nothing"],
        ),
        (
            '<ssd:Connection startConnector="command" endElement="drive" endConnector="command" />',
            (
                '<ssd:Connection startConnector="command" endElement="drive"'
                ' endConnector="command"><ssc:LinearTransformation factor="2"/></ssd:Connection>'
            ),
            ["command -> drive.command", "is not known"],
        ),
        (
            "</ssd:Elements>",
            '<ssd:System name="inner"/></ssd:Elements>',
            ["inner is a system within the system"],
        ),
        (
            "</ssd:Elements>",
            '<ssd:SignalDictionaryReference name="bus"/></ssd:Elements>',
            ["bus is a SignalDictionaryReference"],
        ),
        ("?>", "?><!DOCTYPE x []>", ["document type declaration"]),
        ("</ssd:Elements>", "", ["SystemStructure.ssd cannot be read: it is not well-formed XML"]),
    ],
)
def test_descriptions_that_cannot_be_followed(system, tmp_path, old, new, parts):
    ssp.write(system, tmp_path / "with.ssp", connectors=True)
    refused_one(
        repacked(tmp_path / "with.ssp", lambda text: text.replace(old, new)), tmp_path / "u", *parts
    )


def declared(owner, connector, **changes):
    """The description with another declaration of a connector: of a member, or of the system."""

    def change(description):
        root = ElementTree.fromstring(description)
        parts = [
            node
            for node in root.iter()
            if node.tag.endswith(("}Component", "}System")) and node.get("name") == owner
        ]
        (found,) = parts[0].findall(f"{{*}}Connectors/{{*}}Connector[@name='{connector}']")
        for key in {"name", "kind"} & set(changes):
            found.set(key, changes[key])
        if "type" in changes:
            found[0].tag = found[0].tag.replace("Real", changes["type"])
        if "unit" in changes:
            found[0].set("unit", changes["unit"])
        return ElementTree.tostring(root, encoding="unicode")

    return change


@pytest.mark.parametrize(
    ("owner", "name", "changes", "parts"),
    [
        (
            "load",
            "force",
            {"unit": "mm"},
            ["member load: connector 'force'", "declared in 'mm'", "in the FMU it is in 'N'"],
        ),
        ("load", "force", {"unit": "kN"}, ["member load: connector 'force'", "'kN'", "'N'"]),
        (
            "drive",
            "way",
            {"unit": "mm"},
            ["member drive: connector 'way'", "declared in 'mm'", "in 'm'"],
        ),
        (
            "drive",
            "count",
            {"unit": "furlongs"},
            ["member drive: connector 'count'", "'furlongs'", "'1'"],
        ),
        (
            "load",
            "force",
            {"type": "Integer"},
            ["connector 'force'", "declared as Integer", "in the FMU it is Real"],
        ),
        (
            "load",
            "force",
            {"type": "String"},
            ["connector 'force'", "declared as String", "in the FMU it is Real"],
        ),
        (
            "load",
            "force",
            {"kind": "output"},
            ["connector 'force'", "declared as output", "in the FMU it is input"],
        ),
        (
            "load",
            "force",
            {"kind": "inout"},
            ["connector 'force'", "declared as inout", "in the FMU it is input"],
        ),
        (
            "load",
            "force",
            {"name": "froce"},
            ["member load: connector 'froce'", "no variable of this name", "force"],
        ),
        (
            "sample",
            "pull",
            {"unit": "mm"},
            ["'pull' of the system, that is load.tension,", "'mm'", "'N'"],
        ),
        (
            "sample",
            "room",
            {"type": "Boolean"},
            ["'room' of the system, that is load.warm,", "Boolean", "Real"],
        ),
        (
            "sample",
            "nothing",
            {"kind": "inout"},
            ["connector 'nothing' of the system is inout", "input, output"],
        ),
    ],
)
def test_connectors_that_are_not_those_of_the_fmus(system, tmp_path, owner, name, changes, parts):
    ssp.write(system, tmp_path / "with.ssp", connectors=True)
    refused(
        repacked(tmp_path / "with.ssp", declared(owner, name, **changes)), tmp_path / "u", *parts
    )


def test_connectors_of_the_system_in_the_annotation_are_held_against_the_fmus_too(
    archive, tmp_path
):
    pull = '<ssd:Connector name="pull" kind="output">'
    other = repacked(archive, lambda text: text.replace(pull, f"{pull}<ssc:Integer/>"))
    refused(
        other, tmp_path / "u", "connector 'pull' of the system, that is load.tension,", "Integer"
    )


def test_a_connector_may_name_the_unit_of_the_fmu_otherwise_or_leave_it_out(
    system, archive, tmp_path
):
    other = repacked(archive, declared("load", "force", unit="kg*m/s**2"), name="a.ssp")
    assert contents(ssp.read(other, tmp_path / "u")) == contents(system)
    bare = repacked(
        archive, lambda text: re.sub(r'<ssc:\w+( unit="[^"]*")? />', "", text), name="b.ssp"
    )
    assert contents(ssp.read(bare, tmp_path / "v")) == contents(system)


def test_a_second_system(archive, tmp_path):
    other = repacked(
        archive, lambda text: text.replace("</ssd:System>", '</ssd:System><ssd:System name="b"/>')
    )
    refused(other, tmp_path / "u", "more than one System in SystemStructure.ssd")


def test_another_root(archive, tmp_path):
    refused(
        repacked(archive, lambda text: "<a/>"),
        tmp_path / "u",
        "is a a, not a SystemStructureDescription",
    )


def test_no_system(archive, tmp_path):
    empty = f'<ssd:SystemStructureDescription {NAMESPACES} version="1.0"/>'
    refused(
        repacked(archive, lambda text: empty), tmp_path / "u", "no System in SystemStructure.ssd"
    )


def test_a_system_without_defaults(archive, tmp_path):
    def change(text):
        return text[: text.index("<ssd:DefaultExperiment")] + "</ssd:SystemStructureDescription>"

    found = ssp.read(repacked(archive, change), tmp_path / "u")
    plain = System("any", (), ())
    assert (found.step, found.stop) == (plain.step, plain.stop)


def test_the_duration_counts_from_the_start(archive, tmp_path):
    other = repacked(
        archive,
        lambda text: text.replace('startTime="0.0" stopTime="0.001"', 'startTime="2" stopTime="5"'),
    )
    assert ssp.read(other, tmp_path / "u").stop == 3.0


# --- archives that nobody should open
# ---------------------------------------------------------------------------------
