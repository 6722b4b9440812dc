"""Claims: tasks in a user's words lead to a command, which exists with its options."""

from __future__ import annotations

import pytest

from orchestration.cli.tasks import _TASKS, tasks
from tests.support.command import works
from tests.support.commands import COMMANDS

NAMES = {name.split()[0] for name in COMMANDS} | {"design"}


@pytest.mark.parametrize(
    ("words", "command"),
    [
        ("folder of records", "diagnose"),
        ("tune a loop", "design"),
        ("battery", "diagnose"),
        ("parameter estimation", "identify"),
        ("impedance spectroscopy", "frequency"),
        ("phase margins", "design"),
        ("Monte Carlo", "sweep"),
        ("friction", "diagnose"),
        ("validation of models", "compare"),
    ],
)
def test_the_words_of_a_task_find_its_command_first(words, command):
    _, found = tasks(words, NAMES)[0]
    assert found.split()[1] == command


def test_a_command_that_is_not_there_is_not_named():
    assert all("design" not in command for _, command in tasks("tune a loop", {"rig"}))
    assert tasks("xyzzy", NAMES) == []


def test_every_command_exists_and_has_the_options_that_are_named():
    for line in _TASKS.values():
        words = line.split()[1:]
        command = COMMANDS.get(" ".join(words[:2])) or COMMANDS.get(words[0])
        if command is None:
            assert words[0] == "design", line
            continue
        known = {flag for one in command.params for flag in (*one.opts, *one.secondary_opts)}
        assert {word for word in words if word.startswith("--")} <= known, line


def test_the_help_lists_them_by_words(tmp_path):
    assert "ppy rig stop" in works("--help", "emergency", cwd=tmp_path)
    assert "ppy --help lists" in works("--help", "xyzzy", cwd=tmp_path)
