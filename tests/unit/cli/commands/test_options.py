"""Claims: every option of every command has help, and the defaults of what it is handed to."""

from __future__ import annotations

from dataclasses import fields

from orchestration.api.declaration import options_of
from orchestration.cli.commands.options import VERDICTS, ServeCommand
from orchestration.discrepancy import Verdict
from orchestration.rig.server import ServerSettings
from tests.support.commands import COMMANDS


def test_every_option_of_every_command_has_help():
    assert len(COMMANDS) > 25
    for name, one in COMMANDS.items():
        for parameter in one.params:
            assert getattr(parameter, "help", None), f"{name} {parameter.name}"


def test_the_verdicts_that_can_be_required_are_those_that_there_are():
    assert set(VERDICTS) == set(Verdict)


def test_a_server_has_the_defaults_of_its_settings():
    """Where to bind is put together from three options, and what is to be served has to be said."""
    usual = {field.name: field.default for field in fields(ServerSettings)}
    options = options_of(ServeCommand)
    for name in ("rate", "watchdog", "lockstep", "keys", "log", "priority", "cpu"):
        assert options[name].default == usual[name], name
