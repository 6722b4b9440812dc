"""Claims: the options of every command are shown in panels that say what they are about."""

from __future__ import annotations

from orchestration.cli.panels import panel_of
from tests.support.command import ppy
from tests.support.commands import COMMANDS


def test_every_option_has_a_panel():
    for name, command in COMMANDS.items():
        for option in command.params:
            if option.param_type_name == "option" and option.name != "help":
                assert panel_of(option.name), f"{name} {option.opts[0]}"
                assert option.rich_help_panel == panel_of(option.name)


def test_panels_are_shown(tmp_path):
    text = ppy("simulate", "--help", cwd=tmp_path).stdout
    titles = [line.strip("╭─╮ ") for line in text.splitlines() if line.startswith("╭")]
    assert set(titles) == {
        "Arguments",
        "Options",
        "Record",
        "Model",
        "Time",
        "Signals",
        "Results",
        "FMUs of others",
    }


def test_an_option_that_nobody_knows_has_none():
    assert panel_of("nonsense") is None
