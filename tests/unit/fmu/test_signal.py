"""Values that a user gives to a variable: bounds in other units, words, and units where there are
none.
"""

from __future__ import annotations

import dataclasses
import math
import re

import pytest

from fmus import component
from fmus.kit.errors import UserError
from orchestration.fmu.model import find_model
from orchestration.fmu.signal import Signal, numeric, read_setting
from tests.support.archive import edited

INDUCTANCE = Signal("L", "real", "H", "H", 1e-3, 1e-5, 10.0)
WEIGHT = Signal("remaining_weight", "real", "1", "%", 0.1, 1e-6, 0.999)
SWITCH = Signal("on", "boolean", "1", "1", 0.0, -math.inf, math.inf)
BITS = Signal("bits", "integer", "1", "1", 16, 4, 24)


@pytest.mark.parametrize(
    ("given", "signal", "value"),
    [
        ("10uH", INDUCTANCE, 1e-5),
        ("10000mH", INDUCTANCE, 10.0),
        ("99.9%", WEIGHT, 0.999),
        ("1e-4 %", WEIGHT, 1e-6),
        ("True", SWITCH, 1.0),
        ("false", SWITCH, 0.0),
        ("1", SWITCH, 1.0),
        ("24", BITS, 24.0),
    ],
)
def test_the_bounds_themselves_are_allowed_in_any_unit(given, signal, value):
    assert read_setting(given, signal, "--set") == value


@pytest.mark.parametrize(
    ("given", "signal", "message"),
    [
        ("9.99uH", INDUCTANCE, "out of range"),
        ("99.91%", WEIGHT, "out of range"),
        ("100%", SWITCH, "on is boolean and has no unit"),
        ("16 bits", BITS, "bits is integer and has no unit"),
        ("25", BITS, "out of range"),
        ("yes", SWITCH, "nor true or false"),
        ("2", SWITCH, "neither true"),
    ],
)
def test_others_are_refused(given, signal, message):
    with pytest.raises(UserError, match=message):
        read_setting(given, signal, "--set")


FORMER = {
    "Ohm": "ohm",
    "N.s/m": "N*s/m",
    "A/(V.s)": "A/V/s",
    "N.m": "N*m",
    "N.m/rad": "N*m/rad",
    "N.m.s/rad": "N*m*s/rad",
    "kg.m2": "kg*m^2",
    "m/s2": "m/s/s",
    "rad/s2": "rad/s/s",
}


def former(name: str, contents: bytes) -> tuple[str, bytes]:
    """The description as it was before units were Modelica's."""
    if name != "modelDescription.xml":
        return name, contents
    text = re.sub(r'(?<=unit=")([^"]*)(?=")', lambda m: FORMER.get(m[1], m[1]), contents.decode())
    return name, re.sub(
        r'(?<=<Unit name=")([^"]*)(?=")', lambda m: FORMER.get(m[1], m[1]), text
    ).encode()


@pytest.mark.parametrize(
    "name", ["ppy_actuator", "foot_dynamic", "galvanostat", "degradation_estimator"]
)
def test_former_and_present_fmus_are_read_alike_and_as_declared(fmu, tmp_path, name):
    present = find_model(str(fmu(name, "native")))
    before = edited(fmu(name, "native"), tmp_path / f"{name}.fmu", former)
    for kind in ("inputs", "outputs", "parameters"):
        ours, theirs = getattr(present, kind), getattr(find_model(str(before)), kind)
        assert {n: dataclasses.astuple(s) for n, s in ours.items()} == {
            n: dataclasses.astuple(s) for n, s in theirs.items()
        }
        declared = {v.name: v for v in component(name).layout.variables}
        for variable, signal in ours.items():
            if signal.type == "real":
                unit = declared[variable].unit
                assert (signal.unit, signal.display) == (
                    unit,
                    declared[variable].display or unit,
                ), variable


def test_unit_that_nobody_knows_is_left_as_it_is(fmu, tmp_path):
    def strange(name: str, contents: bytes) -> tuple[str, bytes]:
        return name, contents.replace(
            b'"Ohm"', b'"rev/min.x"'
        ) if name == "modelDescription.xml" else contents

    assert find_model(
        str(edited(fmu("ppy_actuator", "native"), tmp_path / "x.fmu", strange))
    ).parameters["R1"].unit == ("rev/min.x")


def test_what_computes_takes_no_text():
    with pytest.raises(UserError, match="endpoint = 'x': is a text"):
        numeric({"R1": 0.5, "endpoint": "x"})
