"""Claims: a system with FMUs of FMI 3.0 is written as SSP 2.0, and reads back the same; an array is
one connector, and one connection where all of it is connected.
"""

from __future__ import annotations

import re
import time
import zipfile
from xml.etree import ElementTree

import pytest

from fmus.kit import UserError
from orchestration.system import Member, Port, System, connect, ssp
from orchestration.system.ssp.arrays import wires
from tests.support.fmi3_fmus import build_wide, foreign, pack, wide_body
from tests.support.fmi3_fmus import description as description_of
from tests.support.hosts import build_one_state_fmu
from tests.support.system.archive import DESCRIPTION
from tests.support.system.ssp_files import contents

SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"


@pytest.fixture
def system(tmp_path):
    wide = build_wide(2, tmp_path)
    members = (
        Member("old", build_one_state_fmu(tmp_path)),
        Member("types", foreign("types"), {"u8_in": 3.0, "words[1]": "y z", "words[2]": "x"}),
        Member("counted", foreign("types")),
        Member("rows", foreign("arrays"), {"u[1]": 0.5, "u[2]": -0.25}),
        Member("wide", wide),
        Member("other", wide),
    )
    links = connect(
        "rows.y[1] -> wide.u[1]",
        "rows.y[2] -> wide.u[2]",
        "wide.y[1] -> other.u[2]",
        "old.x -> other.u[1]",
        "types.i32_out -> counted.i16_in",
    )
    inputs = {"drive": (Port("rows", "u[1]"), Port("old", "u"))}
    return System(
        "mixed", members, links, inputs, {"end": Port("wide", "y[2]")}, step=0.1, stop=1.0
    )


def description(path):
    with zipfile.ZipFile(path) as archive:
        return archive.read(DESCRIPTION).decode()


@pytest.mark.parametrize("connectors", [False, True])
def test_it_reads_back_the_same(system, tmp_path, connectors):
    ssp.write(system, tmp_path / "a.ssp", connectors)
    found = ssp.read(tmp_path / "a.ssp", tmp_path / "unpacked")
    assert contents(found) == contents(system)


def test_its_version_is_that_of_its_newest_member(system, tmp_path):
    ssp.write(system, tmp_path / "a.ssp")
    assert ElementTree.fromstring(description(tmp_path / "a.ssp")).get("version") == "2.0"
    old = System("old", system.members[:1], (), {}, step=0.1, stop=1.0)
    ssp.write(old, tmp_path / "b.ssp")
    assert ElementTree.fromstring(description(tmp_path / "b.ssp")).get("version") == "1.0"


def test_types_and_sizes_are_those_of_the_variables(system, tmp_path):
    ssp.write(system, tmp_path / "a.ssp")
    root = ElementTree.fromstring(description(tmp_path / "a.ssp"))
    components = {node.get("name"): node for node in root.iter(f"{SSD}Component")}

    def connectors(name):
        return {
            node.get("name"): (node[0].tag.partition("}")[2], [d.get("size") for d in node[1:]])
            for node in components[name].iter(f"{SSD}Connector")
        }

    types = connectors("types") | connectors("counted")
    assert types["f32_out"] == ("Float32", [])
    assert types["u64_out"] == ("UInt64", [])
    assert types["i16_in"] == ("Int16", [])
    assert types["mood_out"] == ("Enumeration", [])
    assert connectors("wide") == {"u": ("Float64", ["2"]), "y": ("Float64", ["2"])}
    assert connectors("old") == {"x": ("Real", [])}


def test_arrays_that_are_connected_whole_are_one_connection(system, tmp_path):
    ssp.write(system, tmp_path / "a.ssp")
    root = ElementTree.fromstring(description(tmp_path / "a.ssp"))
    top = root.find(f"{SSD}System/{SSD}Connections")
    names = ("startConnector", "startIndices", "endConnector", "endIndices")
    assert [[wire.get(name) for name in names] for wire in top] == [
        ["y", None, "u", None],
        ["y", "1", "u", "2"],
        ["x", None, "u", "1"],
        ["i32_out", None, "i16_in", None],
    ]


@pytest.mark.slow
def test_connections_of_most_elements_take_no_longer_than_of_all(tmp_path):
    count = 20_000
    fmu = pack(
        tmp_path / "wide.fmu", {"modelDescription.xml": description_of("wide", wide_body(count))}
    )
    links = connect(*(f"a.y[{k}] -> b.u[{k}]" for k in range(1, count)))
    members = {name: Member(name, fmu) for name in ("a", "b")}
    begun = time.perf_counter()
    found = wires(links, members)
    assert [wire.target.indices for wire in found] == [(k,) for k in range(1, count)]
    assert time.perf_counter() - begun < 60.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('size="2"', 'size="3"', "declared as 3 elements, but in the FMU it has 2$"),
        ("<ssc:Float32", "<ssc:Int8", "'f32_out' is declared as Int8, but in the FMU it is Real"),
        ('startConnector="y" ', 'startConnector="x" ', "rows.x -> wide.u: from 3 elements to 2"),
        ('version="2.0"', 'version="3.0"', "SSP version 3.0; this program knows SSP 1.0 and 2.0"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_line(system, tmp_path, old, new, message):
    ssp.write(system, tmp_path / "a.ssp")
    text = description(tmp_path / "a.ssp")
    assert re.search(old, text)
    with zipfile.ZipFile(tmp_path / "a.ssp") as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    files[DESCRIPTION] = text.replace(old, new, 1).encode()
    with zipfile.ZipFile(tmp_path / "b.ssp", "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    with pytest.raises(UserError, match=message) as caught:
        ssp.read(tmp_path / "b.ssp", tmp_path / "unpacked")
    assert "\n" not in str(caught.value)
