"""Claims: quantities of several commands are read with their units, and refused in a line."""

import pytest

from fmus.kit import UserError
from fmus.kit.build import host_platform
from fmus.kit.build.toolchain import ZIG_TARGETS
from orchestration.api.declaration import options_of
from orchestration.cli.options import IsolationOptions, PlatformsOption, platform_list
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


def isolation_option(name, text):
    return options_of(IsolationOptions)[name].form.parse(text)


@pytest.mark.parametrize(
    ("text", "size"), [("800MB", 8e8), ("1 GiB", 2.0**30), ("3e8", 3e8), ("256000 kb", 2.56e8)]
)
def test_an_amount_of_memory_is_read_in_bytes(text, size):
    assert isolation_option("memory_limit", text) == size


@pytest.mark.parametrize("text", ["255MB", "2 TB", "much", "-1GB", "1e99", "1.2.3GB", ""])
def test_an_amount_that_is_none_or_too_little_is_refused_with_the_least(text):
    with pytest.raises(ValueError, match=r"an amount of memory such as 2GB .*, at least 256MB"):
        isolation_option("memory_limit", text)


def test_a_timeout_is_above_nothing():
    assert isolation_option("step_timeout", "2min") == 120.0
    for text in ("0s", "-1s", "1e9"):
        with pytest.raises(ValueError, match="a time above 0, such as 10s or 2min"):
            isolation_option("step_timeout", text)


def test_platforms_are_those_named_all_or_that_of_this_machine():
    read = options_of(PlatformsOption)["platforms"].read
    assert platform_list(read(None)) == [host_platform()]
    assert platform_list(read("all")) is None
    assert platform_list(read("linux64,all")) is None
    assert platform_list(read("win64, linux64")) == ["win64", "linux64"]
    every = ",".join(ZIG_TARGETS)
    assert platform_list(read(every)) == [*ZIG_TARGETS]
    with pytest.raises(UserError, match=r"linux32: there are linux64, .*, all"):
        read("all,linux32")
