"""Claims: what is written is SSP 1.0 and reads back the same; what is read is judged before anything is unpacked.

Oracles: the XML schemas of SSP 1.0 that fmpy ships, and fmpy's own reader.
"""

from __future__ import annotations

import io
import re
import stat
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import fmpy.ssp.ssd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

from fmus.kit.errors import UserError
from orchestration.fmu import bounded
from orchestration.system import Connection, Member, Port, System, connect, ssp
from orchestration.system.check import check
from orchestration.system.ssp import package
from tests.support.system.archive import BINDINGS, DESCRIPTION, INLINE, NAMESPACES, SET, repacked
from tests.support.system.samples import pair, tiny_fmu

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"


def contents(system):
    """The system with the bytes of its FMUs in place of their paths, and without classes."""
    bare = tuple(
        replace(m, cls=None, fmu=m.fmu.read_bytes(), parameters=dict(m.parameters))
        for m in system.members
    )
    return replace(system, members=bare)


def validate(text, schema):
    """Hold XML against a schema of the standard."""
    found = etree.XMLSchema(file=str(SCHEMAS / schema))
    assert found.validate(etree.fromstring(text)), found.error_log


@pytest.fixture
def system(tmp_path):
    """Everything that a system can have: all types, a factor with an offset, an input that feeds two members."""
    drive, load = pair(tmp_path / "fmus")
    other = Member("second load", load.fmu, {"level": 1.0, "hold": 0.0, "warm": 3.0, "odd": 2.0})
    wires = (
        *connect("drive.force -> load.force", "drive.force -> second load.force"),
        Connection(Port("drive", "way"), Port("second load", "length"), 1000.0, -0.1),
    )
    drive = replace(drive, parameters={"gain": 0.1, "steps": -3.0, "armed": 1.0})
    warm = replace(load, parameters={k: v for k, v in load.parameters.items() if k != "warm"})
    second = replace(other, parameters={k: v for k, v in other.parameters.items() if k != "warm"})
    inputs = {
        "command": (Port("drive", "command"),),
        "room": (Port("load", "warm"), Port("second load", "warm")),
        "nothing": (),
    }
    outputs = {"pull": Port("load", "tension"), "tension": Port("second load", "tension")}
    return System(
        "sample", (drive, warm, second), wires, inputs, outputs, 'a "doc" & <more>', 0.1 + 0.2, 1e-3
    )


@pytest.fixture
def archive(system, tmp_path):
    """The system as a file."""
    ssp.write(system, tmp_path / "sample.ssp")
    return tmp_path / "sample.ssp"


def refused(path, folder, *parts):
    """The file must be refused in one line that begins with its name, and nothing be unpacked outside of the folder."""
    around = sorted(path.parent.rglob("*"))
    with pytest.raises(UserError) as caught:
        check(ssp.read(path, folder))
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(str(path))
    for part in parts:
        assert part in text, text
    assert [p for p in sorted(path.parent.rglob("*")) if folder not in (p, *p.parents)] == around


# --- there and back ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("connectors", [False, True])
def test_what_is_written_reads_back_the_same(system, tmp_path, connectors):
    ssp.write(system, tmp_path / "a.ssp", connectors)
    found = ssp.read(tmp_path / "a.ssp", tmp_path / "unpacked")
    assert contents(found) == contents(system)
    assert list(found.inputs) == list(system.inputs)
    assert list(found.outputs) == list(system.outputs)
    assert all(tmp_path / "unpacked" in member.fmu.parents for member in found.members)


def test_a_bare_description_with_its_files_beside_it(system, tmp_path):
    (tmp_path / "bare").mkdir()
    ssp.write(system, tmp_path / "bare" / "sample.ssd")
    assert contents(ssp.read(tmp_path / "bare" / "sample.ssd", tmp_path / "unused")) == contents(
        system
    )
    assert not (tmp_path / "unused").exists()
    (tmp_path / "bare" / "resources" / "drive.fmu").write_bytes(b"somebody else's")
    with pytest.raises(UserError, match=r"drive\.fmu is there with other contents"):
        ssp.write(system, tmp_path / "bare" / "sample.ssd")
    assert (tmp_path / "bare" / "resources" / "drive.fmu").read_bytes() == b"somebody else's"


@pytest.mark.parametrize("connectors", [False, True])
def test_the_description_is_valid(system, tmp_path, connectors):
    ssp.write(system, tmp_path / "a.ssp", connectors)
    with zipfile.ZipFile(tmp_path / "a.ssp") as found:
        validate(found.read(DESCRIPTION), "SystemStructureDescription.xsd")
        files = [name for name in found.namelist() if name.endswith(".ssv")]
        for name in files:
            validate(found.read(name), "SystemStructureParameterValues.xsd")
    assert files == [f"resources/{name}.ssv" for name in ("drive", "load", "second_load")]


def test_fmpy_reads_what_is_written(system, tmp_path):
    ssp.write(system, tmp_path / "a.ssp", connectors=True)
    read = fmpy.ssp.ssd.read_ssd(str(tmp_path / "a.ssp"))
    top = read.system
    assert [e.name for e in top.elements] == ["drive", "load", "second load"]
    assert [e.source for e in top.elements] == [
        f"resources/{name}.fmu" for name in ("drive", "load", "load")
    ]
    assert {c.name: c.kind for c in top.connectors} == {
        "command": "input",
        "room": "input",
        "nothing": "input",
        "pull": "output",
        "tension": "output",
    }
    wires = {
        (c.startElement, c.startConnector, c.endElement, c.endConnector) for c in top.connections
    }
    assert ("drive", "way", "second load", "length") in wires
    assert (None, "room", "load", "warm") in wires
    assert ("load", "tension", None, "pull") in wires
    assert len(wires) == len(system.connections) + 3 + 2
    (binding,) = top.elements[0].parameterBindings
    values = {p.name: (p.type, p.value, p.unit) for p in binding.parameterValues[0].parameters}
    assert values == {
        "gain": ("Real", "0.1", "N/A"),
        "steps": ("Integer", "-3", None),
        "armed": ("Boolean", "true", None),
    }
    assert {unit.name: unit for unit in read.units}["mm"].factor == pytest.approx(1e-3)


def test_the_same_system_gives_the_same_bytes(system, tmp_path):
    for name in ("a.ssp", "b.ssp"):
        ssp.write(system, tmp_path / name)
    assert (tmp_path / "a.ssp").read_bytes() == (tmp_path / "b.ssp").read_bytes()
    again = ssp.read(tmp_path / "a.ssp", tmp_path / "u")
    ssp.write(again, tmp_path / "c.ssp")
    assert (tmp_path / "c.ssp").read_bytes() == (tmp_path / "a.ssp").read_bytes()


def test_different_fmus_of_one_name_are_kept_apart(tmp_path):
    one, other = (tiny_fmu(tmp_path / k / "same.fmu", f"output {k} Real") for k in ("x", "y"))
    system = System("two", (Member("a", one), Member("b", other), Member("c", one)), ())
    ssp.write(system, tmp_path / "two.ssp")
    found = ssp.read(tmp_path / "two.ssp", tmp_path / "u")
    assert contents(found) == contents(system)
    assert [m.fmu.name for m in found.members] == ["same.fmu", "same_2.fmu", "same.fmu"]


def test_names_of_files_are_the_same_as_uri_and_as_path_and_apart_without_case(tmp_path):
    fmus = [
        tiny_fmu(tmp_path / k / f"{name}.fmu", f"output {k} Real", "parameter p Real")
        for k, name in (("x", "größe 1"), ("y", "GRÖßE 1"), ("z", "%20"))
    ]
    names = ("a b", "A B", "a_b", "ü#?&")
    members = tuple(
        Member(n, f, {"p": k}) for k, (n, f) in enumerate(zip(names, [*fmus, fmus[0]], strict=True))
    )
    system = System("names", members, ())
    ssp.write(system, tmp_path / "names.ssp")
    assert contents(ssp.read(tmp_path / "names.ssp", tmp_path / "u")) == contents(system)
    with zipfile.ZipFile(tmp_path / "names.ssp") as found:
        files = found.namelist()
    assert len({name.casefold() for name in files}) == len(files) == 1 + 3 + 4
    assert all(re.fullmatch(r"[A-Za-z0-9_./-]+", name) for name in files)


NAMES = st.text("abz_ é&<\"'%#?", min_size=1, max_size=5).filter(lambda name: name == name.strip())
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def random_systems(draw, fmu):
    """Members ``x -> y`` (gain k), each input fed by an output, by the system, or by a value."""
    names = draw(st.lists(NAMES, min_size=1, max_size=5, unique=True))
    members, connections, inputs = [], [], {}
    for name in names:
        values = {"k": draw(NUMBERS)} if draw(st.booleans()) else {}
        source = draw(st.sampled_from([None, "", *(other for other in names if other != name)]))
        if source is None:
            values["x"] = draw(NUMBERS)
        elif source == "":
            inputs[f"to {name}"] = (Port(name, "x"),)
        else:
            connections.append(
                Connection(Port(source, "y"), Port(name, "x"), draw(NUMBERS), draw(NUMBERS))
            )
        members.append(Member(name, fmu, values))
    outputs = {f"of {name}": Port(name, "y") for name in draw(st.sets(st.sampled_from(names)))}
    positive = st.floats(1e-6, 1e6)
    return System(
        draw(NAMES),
        tuple(members),
        tuple(connections),
        inputs,
        outputs,
        draw(st.text("a b")).strip(),
        draw(positive),
        draw(positive),
    )


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data(), connectors=st.booleans())
def test_random_systems_there_and_back(tmp_path, data, connectors):
    fmu = tmp_path / "gain.fmu"
    if not fmu.exists():
        tiny_fmu(fmu, "input x Real", "output y Real", "parameter k Real")
    system = data.draw(random_systems(fmu))
    ssp.write(system, tmp_path / "random.ssp", connectors)
    with zipfile.ZipFile(tmp_path / "random.ssp") as found:
        validate(found.read(DESCRIPTION), "SystemStructureDescription.xsd")
    assert contents(ssp.read(tmp_path / "random.ssp", tmp_path / "u")) == contents(system)


@pytest.mark.parametrize("name", ["a.zip", "a", "a.fmu"])
def test_the_ending_tells_the_form(system, tmp_path, name):
    with pytest.raises(UserError, match=r"\.ssp or \.ssd"):
        ssp.write(system, tmp_path / name)
    assert not (tmp_path / name).exists()


def test_a_system_that_makes_no_sense_is_not_written(system, tmp_path):
    (tmp_path / "a.ssp").write_text("earlier", encoding="utf-8")
    with pytest.raises(UserError, match=r"load\.force is not connected"):
        ssp.write(replace(system, connections=system.connections[1:]), tmp_path / "a.ssp")
    assert (tmp_path / "a.ssp").read_text(encoding="utf-8") == "earlier"


# --- parameters of others ---------------------------------------------------------------------------------------------


def bound(text):
    """The description with other parameters for the drive."""

    def change(description):
        root = ElementTree.fromstring(description)
        drive = root.find(".//{*}Component")
        drive.remove(drive.find("{*}ParameterBindings"))
        new = ElementTree.fromstring(f"<x {NAMESPACES}>{BINDINGS.format(text)}</x>")
        drive.append(new[0])
        return ElementTree.tostring(root, encoding="unicode")

    return change


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


# --- structure of others ----------------------------------------------------------------------------------------------

WAY = 'startElement="drive" startConnector="way" endElement="second load" endConnector="length"'
WIRE = '<ssd:Connection startElement="drive" startConnector="force" endElement="load" endConnector="force" />'


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
            'version="2.0" name="sample"',
            ["SSP version 2.0", "knows SSP 1.0"],
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
        (WIRE, "", ["load.force is not connected"]),
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
            '<ssd:Connection startConnector="command" endElement="drive" endConnector="command">'
            '<ssc:LinearTransformation factor="2"/></ssd:Connection>',
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


@pytest.mark.parametrize(
    ("before", "element", "part"),
    [
        ("<ssd:Elements>", "<ssd:Foo/>", "Foo, in System sample,"),
        ("<ssd:Elements>", "<Foo/>", "Foo, in System sample,"),
        ("<ssd:Connections>", "<ssd:SignalDictionaries/>", "SignalDictionaries, in System sample,"),
        ("<ssd:DefaultExperiment", "<ssd:Foo/>", "Foo, in SystemStructureDescription sample,"),
        ("<ssd:Connection ", '<ssd:Connection2 name="x"/>', "Connection2 x, in Connections,"),
        ("<ssd:Component ", '<ssd:Foo name="x"/>', "Foo x, in Elements,"),
        (
            "<ssc:LinearTransformation",
            "<ssd:Delay/>",
            "Delay, in Connection drive way second load length,",
        ),
    ],
)
def test_elements_that_are_not_understood(system, tmp_path, before, element, part):
    ssp.write(system, tmp_path / "with.ssp", connectors=True)
    other = repacked(tmp_path / "with.ssp", lambda text: text.replace(before, element + before, 1))
    refused(other, tmp_path / "u", part, "this program")


def test_elements_of_a_parameter_set_that_are_not_understood(archive, tmp_path):
    values = INLINE.format('<ssv:Parameter name="gain"><ssv:Real value="1"/></ssv:Parameter>')
    other = repacked(
        archive, bound(values.replace("</ssv:Parameters>", "<ssv:Alias/></ssv:Parameters>"))
    )
    refused(other, tmp_path / "u", "Alias, in Parameters, is not known to this program")


def test_how_things_look_and_what_others_noted_are_passed_over(system, archive, tmp_path):
    note = '<ssd:Annotations><ssc:Annotation type="any"><ssd:Foo/><Foo/></ssc:Annotation></ssd:Annotations>'

    def change(text):
        text = text.replace(
            "</ssd:Connector>", f'<ssd:ConnectorGeometry x="0" y="0"/>{note}</ssd:Connector>'
        )
        text = text.replace(
            "</ssd:Component>", f'<ssd:ElementGeometry x1="0"/>{note}</ssd:Component>'
        )
        text = text.replace(
            "</ssd:Elements>", f"</ssd:Elements>{note}<ssd:SystemGeometry/><ssd:GraphicalElements/>"
        )
        return text.replace("<ssd:DefaultExperiment", "<ssd:Enumerations/><ssd:DefaultExperiment")

    assert contents(ssp.read(repacked(archive, change), tmp_path / "u")) == contents(system)


def test_a_second_system(archive, tmp_path):
    other = repacked(
        archive, lambda text: text.replace("</ssd:System>", '</ssd:System><ssd:System name="b"/>')
    )
    refused(other, tmp_path / "u", "more than one System in SystemStructure.ssd")


def refused_one(path, folder, *parts):
    """Refused by the reader or by the check of what it read, which begins with the name of the system."""
    with pytest.raises(UserError) as caught:
        check(ssp.read(path, folder))
    text = str(caught.value)
    assert text.startswith((str(path), "system sample: "))
    assert "\n" not in text
    for part in parts:
        assert part in text, text


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


# --- archives that nobody should open ---------------------------------------------------------------------------------


def link(name):
    """An entry that is a symbolic link."""
    entry = zipfile.ZipInfo(name)
    entry.create_system, entry.external_attr = 3, (stat.S_IFLNK | 0o777) << 16
    return entry


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ("../outside.txt", "'../outside.txt' leads out of the archive"),
        ("resources/../../outside.txt", "leads out"),
        ("/outside.txt", "leads out"),
        ("C:/outside.txt", "leads out"),
        ("..\\outside.txt", "leads out"),
        (link("resources/link"), "'resources/link' is a symbolic link"),
    ],
)
def test_members_that_escape(archive, tmp_path, entry, part):
    refused(repacked(archive, None, [(entry, "x")]), tmp_path / "u", part)
    assert not (tmp_path / "u").exists()


def test_an_fmu_whose_members_escape(archive, tmp_path):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as bad:
        bad.writestr("../outside.txt", "x")
    extra = [("resources/bad.fmu", buffer.getvalue())]
    other = repacked(
        archive, lambda text: text.replace("resources/drive.fmu", "resources/bad.fmu"), extra
    )
    refused(other, tmp_path / "u", "member drive", "resources/bad.fmu: '../outside.txt' leads out")


def test_a_bomb(archive, tmp_path, monkeypatch):
    other = repacked(archive, None, [("resources/zeros", bytes(10**6))])
    assert other.stat().st_size < 10**5
    monkeypatch.setattr(bounded, "UNPACKED", 10**6)
    refused(other, tmp_path / "u", "unpacks to", "at most 1e+06 are unpacked")
    assert not (tmp_path / "u").exists()


def test_a_description_without_end(archive, tmp_path, monkeypatch):
    monkeypatch.setattr(package, "TEXT", 1000)
    refused(archive, tmp_path / "u", "SystemStructure.ssd has", "at most 1000 are read")


def test_entities_do_not_grow(archive, tmp_path):
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><x>&b;</x>'
    refused(repacked(archive, lambda text: bomb), tmp_path / "u", "document type declaration")


@pytest.mark.parametrize(
    ("data", "part"),
    [
        (b"", "not a zip archive"),
        (b"PK\x03\x04 and no more", "not a zip archive"),
        (None, "a folder, not a system"),
    ],
)
def test_files_that_are_no_systems(tmp_path, data, part):
    path = tmp_path / "bad.ssp"
    path.mkdir() if data is None else path.write_bytes(data)
    refused(path, tmp_path / "u", part)


def test_a_zip_without_a_description(tmp_path):
    with zipfile.ZipFile(tmp_path / "bad.ssp", "w") as bad:
        bad.writestr("letter.txt", "Dear reader")
    refused(tmp_path / "bad.ssp", tmp_path / "u", "no SSP", DESCRIPTION)


def test_a_damaged_description(archive, tmp_path):
    data = bytearray(archive.read_bytes())
    start = data.index(DESCRIPTION.encode()) + len(DESCRIPTION)
    data[start + 20] ^= 0xFF
    (tmp_path / "bad.ssp").write_bytes(data)
    refused(tmp_path / "bad.ssp", tmp_path / "u", DESCRIPTION, "cannot be read")


def test_a_bare_description_cannot_lead_out(system, tmp_path):
    (tmp_path / "bare").mkdir()
    bare = tmp_path / "bare" / "sample.ssd"
    ssp.write(system, bare)
    (tmp_path / "bare" / "resources" / "drive.fmu").rename(tmp_path / "drive.fmu")
    refused(bare, tmp_path / "u", "member drive", "resources/drive.fmu is missing")
    bare.write_text(
        bare.read_text(encoding="utf-8").replace("resources/drive.fmu", "../drive.fmu"),
        encoding="utf-8",
    )
    refused(bare, tmp_path / "u", "member drive", "'../drive.fmu' leads out")
