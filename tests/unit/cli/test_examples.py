"""Claims: the help of every command ends with two worked examples, each whole in a line."""

from __future__ import annotations

import pytest

from orchestration.cli.examples import EXAMPLES
from tests.support.command import ppy
from tests.support.commands import COMMANDS


def test_every_command_has_two_examples_that_fit_a_line():
    assert set(EXAMPLES) == set(COMMANDS), "every command, and no other, has examples"
    for command, examples in EXAMPLES.items():
        assert len(set(examples)) == 2, f"{command}: two, and two that differ"
        assert any(example.startswith(f"ppy {command}") for example in examples), command
        for example in examples:
            assert example.startswith("ppy ")
            assert len(example) <= 78, example


@pytest.mark.parametrize("command", ["diagnose", "rig serve", "system list"])
def test_the_help_shows_them(command, tmp_path):
    done = ppy(*command.split(), "--help", cwd=tmp_path, environment={"COLUMNS": "80"})
    lines = [line.strip() for line in done.stdout.splitlines()]
    place = lines.index("Examples")
    assert tuple(lines[place + 1 : place + 3]) == EXAMPLES[command]
