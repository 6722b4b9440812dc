"""Claims: every command that reads a default experiment refuses numbers that are none, and negative
ones, in a line that names the file, the attribute, the value and what is allowed.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from orchestration.fmu.archive.default_experiment import experiment_faults
from tests.support.archive import edited
from tests.support.command import here, refused


def faults(attributes):
    return [*experiment_faults(ElementTree.fromstring(f"<f><DefaultExperiment {attributes}/></f>"))]


@pytest.mark.parametrize(
    "attributes",
    ["", 'startTime="-5" stopTime="0" stepSize="0"', 'stopTime="1e3" tolerance="1E-6"'],
)
def test_what_can_be_used_is_no_fault(attributes):
    assert faults(attributes) == []
    assert [*experiment_faults(ElementTree.fromstring("<f/>"))] == []


@pytest.mark.parametrize("name", ["stepSize", "tolerance"])
@pytest.mark.parametrize("value", ["NaN", "-1", "INF", "-INF", "soon", ""])
def test_each_attribute_is_told_with_its_value_and_what_is_allowed(name, value):
    told = f"DefaultExperiment: {name} '{value}' is not a finite number of 0 or more"
    assert faults(f'{name}="{value}"') == [told]


@pytest.mark.parametrize("name", ["startTime", "stopTime"])
def test_a_time_may_be_negative_but_is_a_number(name):
    assert faults(f'{name}="-2"') == []
    assert faults(f'{name}="NaN"') == [f"DefaultExperiment: {name} 'NaN' is not a finite number"]


@pytest.mark.parametrize(
    "command",
    [
        "simulate x.fmu --set current=0.5 --set force=1",
        "simulate x.fmu --set current=0.5 --set force=1 --stop 1 --step 0.1",
        "info x.fmu",
        "linearise x.fmu",
        "sweep x.fmu --over R1=0.3..0.7:3",
        "run x.toml",
        "build x.fmu",
    ],
)
@pytest.mark.parametrize(("name", "value"), [("stopTime", "NaN"), ("stepSize", "-1")])
def test_every_command_refuses_it_in_a_line(command, name, value, fmu, tmp_path):
    def edit(path, contents):
        if path != "modelDescription.xml":
            return path, contents
        return path, re.sub(rf'{name}="[^"]*"'.encode(), f'{name}="{value}"'.encode(), contents)

    edited(fmu("ppy_actuator", "native"), tmp_path / "x.fmu", edit)
    (tmp_path / "x.toml").write_text(
        'component = "x.fmu"\n[inputs]\ncurrent = 0.5\nforce = 1\n', encoding="utf-8"
    )
    told = f"DefaultExperiment: {name} '{value}' is not a finite number"
    assert refused(tmp_path, *command.split(), parts=["x.fmu", told])
    checked = here("check", "x.fmu", cwd=tmp_path)
    assert checked.returncode == 1
    assert told in checked.stdout
