"""Claims: what is written is valid, read by others, and reads back the same; the same system gives
the same bytes.
"""

from __future__ import annotations

import re
import zipfile
from dataclasses import replace

import fmpy.ssp.ssd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fmus.kit.errors import UserError
from orchestration.system import Connection, Member, Port, System, ssp
from tests.support.system.archive import DESCRIPTION
from tests.support.system.samples import tiny_fmu
from tests.support.system.ssp_files import contents, validate


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


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
    twice = (*system.connections, system.connections[0])
    with pytest.raises(UserError, match=r"load\.force has two sources"):
        ssp.write(replace(system, connections=twice), tmp_path / "a.ssp")
    assert (tmp_path / "a.ssp").read_text(encoding="utf-8") == "earlier"
