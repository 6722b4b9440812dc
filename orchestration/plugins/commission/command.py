"""Command ``ppy rig commission``, which is an entry point.

No ``from __future__ import annotations``, with which the options in annotations could not be read.
"""

import sys
from pathlib import Path
from typing import Annotated, TypedDict

import typer

from fmus.kit import UserError
from orchestration.api.declaration import Option, words_of
from orchestration.cli.command import command
from orchestration.cli.commands.options import ServeCommand
from orchestration.cli.options import JsonOption
from orchestration.cli.outputs import PAGE, check_outputs, typed_command, write_json


class CommissionOptions(TypedDict, total=False):
    """Options of a commissioning: the protocol, and the share by which the rig is moved."""

    out: Annotated[
        Path, Option("Page of the protocol.", default=Path("protocol.html"), metavar="FILE.html")
    ]
    level: Annotated[
        float,
        Option("Share of each input's range that is commanded.", default=0.1, least=0.01, most=1.0),
    ]
    yes: Annotated[bool, Option("Move a real device without a question.", default=False)]
    credentials: Annotated[
        Path | None, Option("Key file of a client (ppy rig keys).", metavar="FILE")
    ]


class CommissionCommand(ServeCommand, CommissionOptions, JsonOption, total=False):
    """Options of ``ppy rig commission``."""


@command(CommissionCommand)
def commission(options: CommissionCommand) -> None:
    """Try every protection of a rig on the real device, and write a protocol to sign.

    It serves the rig itself, moves it by a share of its range, stops it, and kills each process of
    the server in turn. The exit status is 1 if a protection failed.
    """
    from orchestration.plugins.commission import INTERRUPTED, ServedRig, read_device
    from orchestration.plugins.commission import commission as work
    from orchestration.reporting import write_page
    from orchestration.reporting.console import alarm, out, wrote
    from orchestration.rig import on_termination
    from orchestration.rig.server import read_options

    if options["lockstep"]:
        raise UserError("--lockstep: protections are tried in real time only; leave it out")
    if options["archive"] is not None:
        raise UserError("--archive: a commissioning keeps a protocol in its place; leave it out")
    path = options["out"]
    check_outputs(options, out=PAGE)
    device = read_device(options["backend"], read_options([*options["backend_options"]]))
    with on_termination(_interrupt):
        served = ServedRig(
            device,
            words_of(ServeCommand, options),
            options["level"],
            _ask,
            options["credentials"],
        )
        try:
            if device.names and not options["yes"]:
                _raise_if_refused(served.describe(served.targets))
        except BaseException:
            served.close()
            raise
        protocol = work(
            served, lambda line: out.print(f"{line.verdict}: {line.title}: {line.finding.measured}")
        )
        write_page(protocol, path, typed_command())
        wrote(path, protocol.summary)
    write_json(options["json"], protocol.to_json())
    if protocol.interrupted == INTERRUPTED:
        raise KeyboardInterrupt
    if protocol.interrupted:
        alarm(protocol.interrupted)
    if protocol.interrupted or protocol.has_failed:
        raise typer.Exit(1)


def _interrupt() -> None:
    raise KeyboardInterrupt


def _raise_if_refused(targets: str) -> None:
    """Raise UserError unless the operator agrees to a movement of the rig."""
    answer = _ask(f"The rig will move to {targets}, and each process of its server is killed once.")
    if answer is None:
        raise UserError("nobody can be asked whether the rig may move; --yes says that it may")
    if not answer:
        raise UserError("nothing was moved")


def _ask(question: str) -> bool | None:
    """Put a question to the operator; None without a terminal."""
    from orchestration.reporting.console import err

    if not sys.stdin.isatty():
        return None
    err.print(f"{question} Type yes or no.", soft_wrap=True)
    answers = {"yes": True, "no": False}
    while (answer := sys.stdin.readline().strip().lower()) not in answers:
        if not answer:
            return None
        err.print("Type yes or no.")
    return answers[answer]
