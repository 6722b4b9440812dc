"""Claims: an option is named as who reads of it can write it, in a shell or in Python.

What Python is told is run as Python, and what a shell is told is split as a shell does.
"""

from __future__ import annotations

import ast
import re
import shlex
from pathlib import Path

import pytest

import orchestration
from orchestration.api import options
from orchestration.api.declaration import options_of
from orchestration.reporting import flag, in_shell, option

ROOM = Path(orchestration.__file__).parent
SHELL_ONLY = (
    "cli",
    "rig",
    "sweeps/storage/zarr_store.py",
    "api/command.py",
    "api/options.py",
    "reporting/phrasing.py",
)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("mapping", {"U cell": "voltage[mV]"}, ["--map", "U cell=voltage[mV]"]),
        ("settings", {"R1": 0.5, "k1": "6 N/mm"}, ["--set", "R1=0.5", "--set", "k1=6 N/mm"]),
        ("hold", ["R1", "C"], ["--hold", "R1,C"]),
        ("effects", [], ["--effects", "none"]),
        ("kind", "sobol", ["--design", "sobol"]),
        ("samples", 128, ["--samples", "128"]),
        ("interpolate", False, ["--no-interpolate"]),
        ("interpolate", True, ["--interpolate"]),
        ("noise_orders", [1, 2], ["--noise-orders", "1,2"]),
    ],
)
def test_an_option_with_a_value_can_be_written_as_it_stands(name, value, words):
    call = ast.parse(f"f({option(name, value)})", mode="eval").body
    (keyword,) = call.keywords
    assert (keyword.arg, ast.literal_eval(keyword.value)) == (name, value)
    with in_shell():
        assert shlex.split(option(name, value)) == words


def test_an_option_by_itself():
    assert option("settings") == "settings="
    with in_shell():
        assert option("settings") == "--set"
    assert option("settings") == "settings="  # after it


def test_what_is_a_method_of_a_result_in_python():
    assert option("fmu", "better.fmu") == "fmu('better.fmu')"
    with in_shell():
        assert option("fmu", "better.fmu") == "--fmu better.fmu"


def test_flags_are_those_of_the_command_line():
    classes = [one for one in vars(options).values() if hasattr(one, "__total__")]
    declared = [option for one in classes for option in options_of(one).values()]
    assert len(declared) > 100
    for one in declared:
        if one.on_command_line and not one.flag:
            assert one.flags == [flag(one.name)]
        elif one.on_command_line:  # a switch
            assert one.flags[-1] == flag(f"no_{one.name}")


@pytest.mark.slow
def test_no_message_names_a_flag_by_itself():
    """Texts outside the rooms of the command line are made with `option`."""
    flags = {
        one.flags[0]
        for cls in vars(options).values()
        if hasattr(cls, "__total__")
        for one in options_of(cls).values()
        if one.on_command_line
    }
    named = []
    for path in ROOM.rglob("*.py"):
        place = path.relative_to(ROOM).as_posix()
        if place.startswith(SHELL_ONLY):
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        named += [
            f"{place}:{line}"
            for line, text in texts(tree)
            if flags & {*re.findall(r"--[a-z-]+", text)}
        ]
    assert named == [], named


def texts(tree):
    """Yield line and text of every string of a module that is no docstring."""
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and id(node) not in docstrings:
            yield node.lineno, str(node.value)
