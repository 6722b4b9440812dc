"""Claims: quantities of several commands are read with their units, and refused in a line."""

import pytest

from tests.support.command import here, refused

SIMULATE = ("simulate", "ppy_actuator", "--set", "current=0.5", "--set", "force=1")


@pytest.mark.parametrize(
    ("stop", "step", "points"),
    [
        ("30", "1", 31),
        ("30s", "500ms", 61),
        ("0.5 min", "1[s]", 31),
        ("500 ms", "1e-1", 6),
        ("1h", "1min", 61),
    ],
)
def test_times_have_units_and_plain_numbers_are_seconds(stop, step, points, tmp_path):
    printed = here(*SIMULATE, "--stop", stop, "--step", step, cwd=tmp_path).stdout
    assert f"ppy_actuator: {points} points from 0 s" in printed


@pytest.mark.parametrize(
    ("option", "given", "parts"),
    [
        ("--stop", "3V", ["'--stop'", "'3V'", "'V' cannot be converted to 's'"]),
        ("--step", "10mm", ["'--step'", "'mm'", "'s'"]),
        ("--stop", "3 fortnightly", ["'--stop'", "unknown unit 'fortnightly'"]),
        ("--stop", "soon", ["'--stop'", "'soon' is not a number with an optional unit"]),
        ("--stop", "1Hz", ["'Hz' cannot be converted to 's'"]),
    ],
)
def test_a_wrong_unit_is_one_line(option, given, parts, tmp_path):
    refused(tmp_path, *SIMULATE, option, given, parts=parts)
