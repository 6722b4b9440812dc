"""Claims: values of members of FMI 3.0 are written with their types, of arrays all, and of
enumerations by the names of their items; those of FMI 2.0 as SSP 1.0 has them.

Oracle: the text of the standard, and its schema.
"""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from fmus.kit.errors import UserError
from orchestration.system import Member
from orchestration.system.ssp.parameters import write_parameters
from tests.support.fmi3_fmus import description, pack
from tests.support.system.samples import tiny_fmu
from tests.support.system.ssp_files import schemas_of_2, validate


@pytest.fixture
def written(tmp_path):
    """Write values of one of the models; type, attributes, sizes and listed values by name."""

    def write(model, values):
        fmu = pack(tmp_path / f"{model}.fmu", {"modelDescription.xml": description(model)})
        text = write_parameters(Member("m", fmu, values))
        validate(text, "SystemStructureParameterValues.xsd", schemas_of_2())
        assert b"<ssv:ParameterSet " in text  # also if nothing was written in the process before
        root = ElementTree.fromstring(text)
        assert root.get("version") == "2.0"
        return {
            node.get("name"): (
                node[0].tag.rpartition("}")[2],
                dict(node[0].attrib),
                [size.get("size") for size in node[1:]],
                [value.get("value") for value in node[0]],
            )
            for node in root.iterfind(".//{*}Parameter")
        }

    return write


def test_scalars(written):
    values = {"f32_in": 0.5, "u8_in": 3.0, "bool_in": 1.0, "word": "a b", "mood_in": -4.0}
    assert written("types", values) == {
        "f32_in": ("Float32", {"value": "0.5", "unit": "1"}, [], []),
        "u8_in": ("UInt8", {"value": "3"}, [], []),
        "bool_in": ("Boolean", {"value": "true"}, [], []),
        "word": ("String", {"value": "a b"}, [], []),
        "mood_in": ("Enumeration", {"value": "sad"}, [], []),
    }


def test_arrays_are_whole_with_the_start_values_of_the_other_elements(written):
    values = {"whole[2,1]": 7.0, "words[2]": "x y", "bits[3]": 1.0, "whole[1,2]": 0.0}
    assert written("types", values) == {
        "whole": ("Int32", {"value": "1 0 3 7 5 6"}, ["2", "3"], []),
        "words": ("String", {}, ["2"], ["de", "x y"]),
        "bits": ("Boolean", {"value": "false false true"}, ["3"], []),
    }


def test_a_unit_is_that_of_the_variable(written):
    assert written("lag", {"tau": 0.25})["tau"] == (
        "Float64",
        {"value": "0.25", "unit": "s"},
        [],
        [],
    )


def test_a_number_that_is_no_item_is_refused_in_a_line(written):
    with pytest.raises(UserError, match=r"^member m: mood_in: 3 is no item .*; items are 1, -4$"):
        written("types", {"mood_in": 3.0})


def test_a_member_of_fmi_2_is_written_as_ssp_1(tmp_path):
    fmu = tiny_fmu(tmp_path / "a.fmu", "parameter k Real mm", "parameter odd Real furlongish")
    text = write_parameters(Member("a", fmu, {"k": 2.0, "odd": 1.0}))
    validate(text, "SystemStructureParameterValues.xsd")
    root = ElementTree.fromstring(text)
    assert root.get("version") == "1.0"
    assert [dict(node[0].attrib) for node in root.iterfind(".//{*}Parameter")] == [
        {"value": "2.0", "unit": "mm"},
        {"value": "1.0"},
    ]
