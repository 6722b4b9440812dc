"""Claims: what is written is SSP 1.0 and reads back the same; what is read is judged before
anything is unpacked.

Oracles: the XML schemas of SSP 1.0 that fmpy ships, and fmpy's own reader.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from orchestration.system import System, ssp
from tests.support.system.archive import NAMESPACES, repacked
from tests.support.system.ssp_files import contents, refused, refused_one


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
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


def test_the_times_are_those_of_the_file(archive, tmp_path):
    other = repacked(
        archive,
        lambda text: text.replace('startTime="0.0" stopTime="0.001"', 'startTime="2" stopTime="5"'),
    )
    found = ssp.read(other, tmp_path / "u")
    assert (found.start, found.stop, found.duration) == (2.0, 5.0, 3.0)
