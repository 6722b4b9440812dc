"""``ppy rig stop``, ``acknowledge`` and ``status``: what an operator asks of a server that runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from fmus.rig_proxy.protocol import ENDPOINT
from orchestration.cli.options import option
from orchestration.reporting.console import warn

Endpoint = Annotated[str, typer.Option("--endpoint", metavar="tcp://HOST:PORT", help="Where the server is.")]
Credentials = Annotated[Path | None, option("--credentials", metavar="FILE", help="Key file of a client.")]
Timeout = Annotated[float, typer.Option("--timeout", min=0.05, max=60.0, help="How long to wait for an answer, in s.")]
AsJson = Annotated[bool, option("--json", help="Print the answer as JSON.")]


def stop(
    endpoint: Endpoint = ENDPOINT,
    credentials: Credentials = None,
    timeout: Timeout = 2.0,
    reason: Annotated[str, option("--reason", metavar="TEXT", help="For the log.")] = "ppy rig stop",
    as_json: AsJson = False,
) -> None:
    """Stop the rig at once: its safe state, until ppy rig acknowledge."""
    from orchestration.rig.endpoint import endpoint as read
    from orchestration.rig.operator import ask

    _tell(ask(read(endpoint, credentials, warn), "stop", timeout, reason=reason), as_json)


def acknowledge(
    endpoint: Endpoint = ENDPOINT, credentials: Credentials = None, timeout: Timeout = 5.0, as_json: AsJson = False
) -> None:
    """Let the rig be used again after a safe state; the client has to connect anew."""
    from orchestration.rig import operator
    from orchestration.rig.endpoint import endpoint as read

    answer = operator.acknowledge(read(endpoint, credentials, warn), timeout)
    _tell(answer, as_json)
    if answer["state"] == "safe":
        raise typer.Exit(1)


def status(
    endpoint: Endpoint = ENDPOINT, credentials: Credentials = None, timeout: Timeout = 2.0, as_json: AsJson = False
) -> None:
    """Say how the rig is: idle, running or safe, who commands it, and what was dropped."""
    from orchestration.rig.endpoint import endpoint as read
    from orchestration.rig.operator import ask

    _tell(ask(read(endpoint, credentials, warn), "status", timeout), as_json)


def _tell(answer: Any, as_json: bool) -> None:
    from orchestration.rig.operator import summary

    print(json.dumps(answer) if as_json else summary(answer))
