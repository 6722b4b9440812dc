"""``ppy rig serve``: a rig, or something that stands for one, at the other end of the cable."""

from __future__ import annotations

import typer

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.rig.options import ServeCommand


@command(ServeCommand)
def serve(options: ServeCommand) -> None:
    """Serve a rig: commands within limits, and measured values with their age.

    It is in a safe state when anything fails, and ends there on Ctrl-C and SIGTERM; SIGUSR1 and
    ppy rig stop are an emergency stop.
    """
    from fmus.rig_proxy import ENDPOINT
    from orchestration.rig import parse_address
    from orchestration.rig.server import ServerSettings, read_options
    from orchestration.rig.server import serve as work

    endpoint = options["endpoint"]
    host = options["host"]
    port = options["port"]
    if endpoint is not None and (host is not None or port is not None):
        raise UserError("--endpoint says all that --bind and --port do; give one of them")
    default = parse_address(endpoint or ENDPOINT)
    settings = ServerSettings(
        backend=options["backend"],
        options=read_options([*options["backend_options"]]),
        rate=options["rate"],
        watchdog=options["watchdog"],
        lockstep=options["lockstep"],
        host=default[0] if host is None else host,
        port=default[1] if port is None else port,
        keys=options["keys"],
        log=options["log"],
        priority=options["priority"],
        cpu=options["cpu"],
    )
    if work(settings):
        raise typer.Exit(1)
