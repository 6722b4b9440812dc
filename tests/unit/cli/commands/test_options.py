"""Claims: every option of every command has help, and the defaults of what it is handed to."""

from __future__ import annotations

import typer

from orchestration.cli import app


def commands(group, *words):
    for name in group.list_commands(None):
        below = group.get_command(None, name)
        if hasattr(below, "list_commands"):
            yield from commands(below, *words, name)
        else:
            yield " ".join((*words, name)), below


def test_every_option_of_every_command_has_help():
    found = dict(commands(typer.main.get_command(app.app)))
    assert len(found) > 25
    for name, one in found.items():
        for parameter in one.params:
            assert getattr(parameter, "help", None), f"{name} {parameter.name}"
