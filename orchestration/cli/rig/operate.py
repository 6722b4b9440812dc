"""``ppy rig stop``, ``acknowledge`` and ``status``: what an operator asks of a server that runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from fmus.rig_proxy.protocol import ENDPOINT
from orchestration.cli.options import Credentials, Json, RigEndpoint, option
from orchestration.cli.outputs import STANDARD_OUTPUT, write_json
from orchestration.reporting.console import warn

Timeout = Annotated[
    float,
    typer.Option("--timeout", min=0.05, max=60.0, help="How long to wait for an answer, in s."),
]


def stop(
    endpoint: RigEndpoint = ENDPOINT,
    credentials: Credentials = None,
    timeout: Timeout = 2.0,
    reason: Annotated[
        str, option("--reason", metavar="TEXT", help="For the log.")
    ] = "ppy rig stop",
    result: Json = None,
) -> None:
    """Stop the rig at once: its safe state, until ppy rig acknowledge."""
    from orchestration.rig.endpoint import read_endpoint
    from orchestration.rig.operator import ask

    _tell(ask(read_endpoint(endpoint, credentials, warn), "stop", timeout, reason=reason), result)


def acknowledge(
    endpoint: RigEndpoint = ENDPOINT,
    credentials: Credentials = None,
    timeout: Timeout = 5.0,
    result: Json = None,
) -> None:
    """Let the rig be used again after a safe state; the client has to connect anew."""
    from orchestration.rig import operator
    from orchestration.rig.endpoint import read_endpoint

    answer = operator.acknowledge(read_endpoint(endpoint, credentials, warn), timeout)
    _tell(answer, result)
    if answer["state"] == "safe":
        raise typer.Exit(1)


def status(
    endpoint: RigEndpoint = ENDPOINT,
    credentials: Credentials = None,
    timeout: Timeout = 2.0,
    result: Json = None,
) -> None:
    """Say how the rig is: idle, running or safe, who commands it, and what was dropped."""
    from orchestration.rig.endpoint import read_endpoint
    from orchestration.rig.operator import ask

    _tell(ask(read_endpoint(endpoint, credentials, warn), "status", timeout), result)


def _tell(answer: Any, result: Path | None) -> None:
    from orchestration.rig.operator import summary

    if result != STANDARD_OUTPUT:
        print(summary(answer))
    write_json(result, answer)
