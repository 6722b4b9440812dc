"""Claims: a system that cannot run is refused in one line with both ends; one that can is accepted,
oddities told.
"""

from __future__ import annotations

import math
import os
from dataclasses import replace

import fmpy
import pytest

from fmus.kit import units
from fmus.kit.errors import UserError
from orchestration.system import Connection, Member, Port, System, connect
from orchestration.system.checking import check, conversion, open_inputs, warnings
from tests.support.system.samples import pair, tiny_fmu, without_starts


@pytest.fixture
def system(tmp_path):
    """drive.force -> load.force; everything else of the load has a value."""
    return System(
        "sample",
        pair(tmp_path),
        connect("drive.force -> load.force"),
        {"command": (Port("drive", "command"),)},
        {"tension": Port("load", "tension")},
    )


def refused(system, *parts):
    """The system must be refused, in one line with its name."""
    with pytest.raises(UserError) as caught:
        check(system)
    text = str(caught.value)
    assert text.startswith(f"system {system.name}: ")
    assert "\n" not in text
    for part in parts:
        assert part in text, text


def free(system, name):
    """The system without the value of an input of the load."""
    drive, load = system.members
    given = {key: value for key, value in load.parameters.items() if key != name}
    return replace(system, members=(drive, replace(load, parameters=given)))


def wired(system, text, factor=1.0, offset=0.0):
    """The system with one more connection, in the place of a value."""
    (one,) = connect(text)
    added = replace(one, factor=factor, offset=offset)
    return replace(free(system, one.target.variable), connections=(*system.connections, added))


def test_a_good_system_passes(system):
    check(system)


@pytest.mark.parametrize(
    ("connection", "parts"),
    [
        (
            "drive.force -> load.length",
            ["drive.force -> load.length", "'N' of drive.force", "'mm' of load.length"],
        ),
        (
            "drive.way -> load.length",
            ["drive.way is in 'm'", "load.length in 'mm'", "it needs factor 1000"],
        ),
        ("drive.heat -> load.warm", ["'degC'", "'K'", "it needs factor 1 and offset 273.15"]),
        (
            "drive.odd -> load.length",
            ["'furlongish' of drive.odd cannot become 'mm' of load.length"],
        ),
        ("drive.count -> load.hold", ["drive.count is integer", "load.hold is boolean"]),
        ("drive.ready -> load.level", ["drive.ready is boolean", "load.level is integer"]),
        ("drive.force -> load.level", ["drive.force is real", "load.level is integer"]),
        (
            "drive.command -> load.length",
            ["drive.command -> load.length", "drive.command is an input", "an output is"],
        ),
        ("drive.gain -> load.length", ["drive.gain is a parameter where an output is needed"]),
        ("drive.force -> load.tension", ["load.tension is an output where an input is needed"]),
        ("drive.force -> load.mass", ["load.mass is a parameter where an input is needed"]),
        ("drive.frce -> load.length", ["drive has no output named 'frce'", "did you mean force"]),
        ("drive.force -> load.lenth", ["load has no input named 'lenth'", "did you mean length"]),
        (
            "driv.force -> load.length",
            ["driv.force -> load.length", "no member named 'driv'", "did you mean drive"],
        ),
        ("drive.force -> drive.command", ["a member cannot be connected with itself"]),
    ],
)
def test_connections_that_do_not_fit(system, connection, parts):
    refused(wired(system, connection), *parts)


@pytest.mark.parametrize(
    ("connection", "factor", "offset"),
    [
        ("drive.way -> load.length", 1000.0, 0.0),
        ("drive.heat -> load.warm", 1.0, 273.15),
        ("drive.force -> load.length", 0.5, 0.0),  # a compliance of 0.5 mm/N
        ("drive.odd -> load.odd", 1.0, 0.0),
        ("drive.count -> load.level", 1.0, 0.0),
        ("drive.ready -> load.hold", 1.0, 0.0),
    ],
)
def test_connections_that_fit(system, connection, factor, offset):
    fits = wired(system, connection, factor, offset)
    check(fits)
    assert [text for text in warnings(fits) if "->" in text] == []


@pytest.mark.parametrize("factor", [math.nan, math.inf])
def test_a_factor_that_is_no_number(system, factor):
    refused(
        wired(system, "drive.way -> load.length", factor),
        "drive.way -> load.length",
        f"factor {factor}",
    )


def test_a_factor_of_what_is_counted(system):
    refused(
        wired(system, "drive.count -> load.level", 2.0),
        "factor 2 is for real variables, these are integer",
    )


def test_a_factor_against_the_units_is_told(system):
    (text,) = [t for t in warnings(wired(system, "drive.way -> load.length", 0.001)) if "->" in t]
    assert (
        text == "drive.way -> load.length: from 'm' to 'mm' the units ask for factor 1000, given is"
        " factor 0.001"
    )


@pytest.mark.parametrize(
    ("unit", "to"), [("m", "mm"), ("degC", "K"), ("K", "degF"), ("rpm", "rad/s"), ("N", "N")]
)
@pytest.mark.parametrize("value", [-3.0, 0.0, 1e3])
def test_factor_and_offset_are_those_of_the_units(unit, to, value):
    factor, offset = conversion(unit, to)
    assert factor * value + offset == pytest.approx(
        float(units.convert(value, unit, to)), rel=1e-12, abs=1e-12
    )


def test_what_cannot_be_converted_has_no_factor():
    assert conversion("N", "mm") is None
    assert conversion("Hz", "rad/s") is None


def test_an_input_that_nothing_feeds_stays_at_the_start_value_of_its_fmu(system):
    unfed = free(system, "length")
    check(unfed)
    assert [str(port) for port in open_inputs(unfed)] == ["load.length"]
    assert open_inputs(system) == {}
    assert warnings(unfed)[-1] == (
        "nothing feeds load.length; it stays at 0 mm, the start value of its FMU"
    )


def test_an_input_without_a_source_and_without_a_start_value(system):
    for member in system.members:
        without_starts(member.fmu)
    check(system)
    refused(
        free(system, "hold"),
        "load.hold is not connected",
        "no input of the system feeds it",
        "no value",
    )
    refused(replace(system, connections=()), "load.force is not connected")
    refused(replace(system, inputs={}), "drive.command is not connected")


def test_two_sources_for_one_input(system):
    twice = (*system.connections, Connection(Port("drive", "force"), Port("load", "force"), 2.0))
    refused(
        replace(system, connections=twice),
        "load.force has two sources, drive.force and drive.force",
    )
    both = {**system.inputs, "pull": (Port("load", "force"),)}
    refused(
        replace(system, inputs=both),
        "load.force has two sources, drive.force and system input pull",
    )
    two = {**system.inputs, "again": (Port("drive", "command"),)}
    refused(
        replace(system, inputs=two),
        "drive.command has two sources, system input command and system input again",
    )


def test_inputs_and_outputs_of_the_system_must_be_of_its_members(system):
    refused(
        replace(system, inputs={"command": (Port("drive", "force"),)}),
        "drive.force is an output where an input",
    )
    refused(
        replace(system, outputs={"tension": Port("load", "force")}),
        "load.force is an input where an output",
    )
    refused(replace(system, outputs={"tension": Port("lod", "tension")}), "no member named 'lod'")
    one = (Port("drive", "command"), Port("load", "length"))
    refused(
        replace(free(system, "length"), inputs={"both": one}),
        "input both feeds drive.command of unit 'A' and load.length of unit 'mm'",
    )
    mixed = (Port("load", "length"), Port("load", "level"))
    bare = free(free(system, "length"), "level")
    refused(
        replace(bare, inputs={**system.inputs, "both": mixed}),
        "of type 'real' and load.level of type 'integer'",
    )


def test_an_input_of_the_system_that_feeds_nothing_is_told(system):
    idle = replace(system, inputs={**system.inputs, "idle": ()})
    check(idle)
    assert "system input idle feeds nothing" in warnings(idle)


@pytest.mark.parametrize(
    ("values", "parts"),
    [
        ({"gian": 1.0}, ["member drive", "'gian' is no parameter or input", "did you mean gain"]),
        ({"force": 1.0}, ["'force' is an output and cannot be set"]),
        ({"gain": math.nan}, ["member drive: gain", "nan is not a finite number"]),
        ({"steps": 1.5}, ["member drive: steps", "1.5 is not a whole number"]),
        ({"armed": 2.0}, ["member drive: armed", "2 is neither true (1) nor false (0)"]),
    ],
)
def test_values_that_cannot_be_set(system, values, parts):
    drive, load = system.members
    refused(replace(system, members=(replace(drive, parameters=values), load)), *parts)


def test_a_value_out_of_range(fmu):
    member = Member(
        "films", fmu("ppy_actuator", "native"), {"C": 0.0, "current": 0.0, "force": 0.0}
    )
    refused(System("one", (member,), ()), "member films: C: 0 F is out of range", "1e-09")


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"step": 0.0}, "step 0 s"),
        ({"stop": math.nan}, "stop time nan s"),
        ({"members": ()}, "no members"),
        (
            {"outputs": {"command": Port("load", "tension")}},
            "two system connectors are named 'command'",
        ),
        (
            {"outputs": {"": Port("load", "tension")}},
            "'' is no name for one of its system connectors",
        ),
    ],
)
def test_what_a_system_as_a_whole_must_have(system, change, part):
    refused(replace(system, **change), part)


@pytest.mark.parametrize("name", ["", " drive"])
def test_names_of_members(system, name):
    refused(
        replace(system, members=(replace(system.members[0], name=name), *system.members)),
        repr(name),
    )


def test_two_members_of_one_name(system):
    refused(
        replace(system, members=(*system.members, system.members[0])),
        "two members are named 'drive'",
    )


def test_an_fmu_that_is_missing_or_none(system, tmp_path):
    drive, load = system.members
    gone = replace(drive, fmu=tmp_path / "gone.fmu")
    refused(replace(system, members=(gone, load)), "member drive", "gone.fmu: no such file")
    (tmp_path / "text.fmu").write_text("text", encoding="utf-8")
    refused(
        replace(system, members=(replace(drive, fmu=tmp_path / "text.fmu"), load)),
        "member drive",
        "not an FMU",
    )


def test_an_fmu_that_was_replaced_is_read_again(system, tmp_path):
    check(system)
    tiny_fmu(system.members[0].fmu, "input command Real A", "output force Real V")
    os.utime(system.members[0].fmu, ns=(1, 1))
    refused(system, "unit 'V' of drive.force cannot become 'N' of load.force")


def test_an_fmu_without_a_binary_for_this_machine_is_told(system):
    assert warnings(system) == [
        f"{name}: {name}.fmu has no binary for {fmpy.platform}; it has none"
        for name in ("drive", "load")
    ]


def test_an_fmu_with_one_is_not(fmu):
    member = Member("films", fmu("ppy_actuator", "native"), {"current": 0.0, "force": 0.0})
    assert warnings(System("one", (member,), ())) == []
