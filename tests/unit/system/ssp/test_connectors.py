"""Claims: a connector has the type of its variable, in the words of its version of FMI; the units
and enumerations that connectors name are defined, each once.
"""

from __future__ import annotations

import zipfile
from types import SimpleNamespace
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest

from orchestration.system import Member, Port, System, ssp
from orchestration.system.ssp.connectors import Definitions, connector, type_of
from tests.support.fmi3_fmus import LAG, description, pack, wide_body
from tests.support.system.archive import DESCRIPTION
from tests.support.system.samples import tiny_fmu


def enumeration(name, **items):
    listed = [SimpleNamespace(name=item, value=value) for item, value in items.items()]
    return SimpleNamespace(name=name, items=listed)


def local(node):
    return node.tag.rpartition("}")[2]


@pytest.fixture
def member(tmp_path):
    def packed(name, body=None):
        files = {"modelDescription.xml": description(name, body)}
        return Member(name, pack(tmp_path / f"{name}.fmu", files))

    return packed


@pytest.mark.parametrize(
    ("name", "kind"),
    [("f32_out", "Float32"), ("u64_out", "UInt64"), ("bool_in", "Boolean"), ("word", "String")],
)
def test_a_variable_of_fmi_3_has_its_own_type(member, name, kind):
    assert local(type_of(member("types"), name, Definitions())) == kind


def test_an_element_has_the_type_of_its_array(member):
    wide = member(
        "wide",
        wide_body(2).replace("Float64 name=", "Float32 name=").replace("</Float64>", "</Float32>"),
    )
    assert local(type_of(wide, "y[2]", Definitions())) == "Float32"


def test_variables_of_fmi_2_keep_their_words(tmp_path):
    fmu = tiny_fmu(tmp_path / "a.fmu", "output x Real mm", "output n Integer", "output b Boolean")
    definitions = Definitions()
    types = [type_of(Member("a", fmu), name, definitions) for name in "xnb"]
    assert [local(each) for each in types] == ["Real", "Integer", "Boolean"]
    assert [each.attrib for each in types] == [{"unit": "mm"}, {}, {}]
    assert definitions.units == {"mm"}


def test_a_unit_that_cannot_be_defined_is_left_out(tmp_path):
    fmu = tiny_fmu(tmp_path / "a.fmu", "output odd Real furlongish")
    definitions = Definitions()
    assert type_of(Member("a", fmu), "odd", definitions).attrib == {}
    assert definitions.units == set()


def test_a_unit_of_fmi_3(member):
    definitions = Definitions()
    assert type_of(member("lag", LAG), "u", definitions).attrib == {"unit": "A"}
    assert definitions.units == {"A"}


def test_enumerations_of_one_name_and_other_items_are_told_apart():
    definitions = Definitions()
    mood = enumeration("Mood", glad="1", sad="-4")
    other = enumeration("Mood", glad="2")
    named = [definitions.name_of(each) for each in (mood, other, mood, other)]
    assert named == ["Mood", "Mood_2", "Mood", "Mood_2"]


@pytest.mark.parametrize(
    "unknown",
    [None, enumeration("Empty"), enumeration("Far", away=str(2**31)), enumeration("?", a="b")],
)
def test_an_enumeration_that_ssp_cannot_define_has_no_name(unknown):
    definitions = Definitions()
    assert definitions.name_of(unknown) is None
    assert definitions.enumerations == {}


def test_a_connector_of_an_array():
    node = connector("u", "input", Element("type"), (2, 3))
    assert [local(each) for each in node] == ["type", "Dimension", "Dimension"]
    assert [each.get("size") for each in node[1:]] == ["2", "3"]
    assert len(connector("u", "input", None)) == 0


def test_the_system_has_the_types_of_its_members_and_their_enumerations(member, tmp_path):
    types = member("types")
    outputs = {name: Port("types", name) for name in ("u64_out", "mood_out", "f32_out")}
    system = System("s", (types,), (), {"mood": (Port("types", "mood_in"),)}, outputs)
    ssp.write(system, tmp_path / "a.ssp", connectors=True)
    with zipfile.ZipFile(tmp_path / "a.ssp") as archive:
        root = ElementTree.fromstring(archive.read(DESCRIPTION))
    own = root.findall("{*}System/{*}Connectors/{*}Connector")
    assert {node.get("name"): local(node[0]) for node in own} == {
        "u64_out": "UInt64",
        "mood_out": "Enumeration",
        "f32_out": "Float32",
        "mood": "Enumeration",
    }
    assert {node.get("name") for node in root.iterfind(".//{*}Enumeration")} == {"Mood"}
    (mood,) = root.findall("{*}Enumerations/{*}Enumeration")
    assert {item.get("name"): item.get("value") for item in mood} == {"glad": "1", "sad": "-4"}
