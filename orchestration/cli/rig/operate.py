"""``ppy rig stop``, ``acknowledge`` and ``status``: what an operator asks of a server that runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from orchestration.cli.command import command
from orchestration.cli.outputs import STANDARD_OUTPUT, write_json
from orchestration.cli.rig.options import (
    AcknowledgeCommand,
    ServerOptions,
    StatusCommand,
    StopCommand,
)

if TYPE_CHECKING:
    from orchestration.rig import Endpoint


@command(StopCommand)
def stop(options: StopCommand) -> None:
    """Stop the rig at once: its safe state, until ppy rig acknowledge."""
    from orchestration.rig import ask

    reason = options["reason"]
    answer = ask(_server(options), "stop", options["timeout"], reason=reason)
    _show(answer, options["json"])


@command(AcknowledgeCommand)
def acknowledge(options: AcknowledgeCommand) -> None:
    """Let the rig be used again after a safe state; the client has to connect anew."""
    from orchestration.rig import operator

    answer = operator.acknowledge(_server(options), options["timeout"])
    _show(answer, options["json"])
    if answer["state"] == "safe":
        raise typer.Exit(1)


@command(StatusCommand)
def status(options: StatusCommand) -> None:
    """Say how the rig is: idle, running or safe, who commands it, and what was dropped."""
    from orchestration.rig import ask

    _show(ask(_server(options), "status", options["timeout"]), options["json"])


def _server(options: ServerOptions) -> Endpoint:
    from orchestration.reporting import warn
    from orchestration.rig import read_endpoint

    return read_endpoint(options["endpoint"], options["credentials"], warn)


def _show(answer: Any, path: Path | None) -> None:
    """Print an answer of the server, and write it as JSON if wanted."""
    from orchestration.rig import summarise_status

    if path != STANDARD_OUTPUT:
        print(summarise_status(answer))
    write_json(path, answer)
