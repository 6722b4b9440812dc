"""Claims: every option of every command has help, and the defaults of what it is handed to."""

from __future__ import annotations

from dataclasses import fields

import typer

from orchestration.api.declaration import options_of
from orchestration.cli import app
from orchestration.cli.commands.options import ServeCommand
from orchestration.rig.server import ServerSettings


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


def test_a_server_has_the_defaults_of_its_settings():
    """Where to bind is put together from three options, and what is to be served has to be said."""
    usual = {field.name: field.default for field in fields(ServerSettings)}
    options = options_of(ServeCommand)
    for name in ("rate", "watchdog", "lockstep", "keys", "log", "priority", "cpu"):
        assert options[name].default == usual[name], name
