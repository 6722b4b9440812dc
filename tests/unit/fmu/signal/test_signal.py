"""Variables read from a description: as they are declared, and as former FMUs named their units."""

from __future__ import annotations

import dataclasses
import re

import pytest

from fmus import component
from orchestration.fmu.model import find_model
from tests.support.archive import edited

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


def test_a_unit_that_nobody_knows_is_what_its_definition_says(fmu, tmp_path):
    """Without one it stays as it is."""

    def strange(name: str, contents: bytes) -> tuple[str, bytes]:
        return name, contents.replace(b'"Ohm"', b'"rev/min.x"')

    def undefined(name: str, contents: bytes) -> tuple[str, bytes]:
        return name, re.sub(rb"(?s)<UnitDefinitions>.*</UnitDefinitions>", b"", contents)

    defined = edited(fmu("ppy_actuator", "native"), tmp_path / "x.fmu", strange)
    bare = edited(defined, tmp_path / "y.fmu", undefined)
    for path, unit in ((defined, "ohm"), (bare, "rev/min.x")):
        assert find_model(str(path)).parameters["R1"].unit == unit
