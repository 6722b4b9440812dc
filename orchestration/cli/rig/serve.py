"""``ppy rig serve``: a rig, or something that stands for one, at the other end of the cable."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fmus.kit.errors import UserError
from orchestration.cli.options import option


def serve(
    backend: Annotated[
        str,
        option(
            "--backend", metavar="NAME", help="emulator, replay, nidaqmx, visa, or FILE.py:Class."
        ),
    ] = "emulator",
    options: Annotated[
        list[str] | None,
        option("--option", metavar="KEY=VALUE", help="Handed on to the backend; repeatable."),
    ] = None,
    rate: Annotated[float, typer.Option("--rate", help="Samples per second, up to 1000.")] = 30.0,
    watchdog: Annotated[
        float,
        typer.Option("--watchdog", help="How long the rig goes on without a fresh command, in s."),
    ] = 0.2,
    lockstep: Annotated[
        bool,
        typer.Option("--lockstep", help="The rig waits for the client; emulator and replay only."),
    ] = False,
    endpoint: Annotated[
        str | None,
        option(
            "--endpoint",
            metavar="tcp://HOST:PORT",
            help="Where to bind; telemetry is one port higher.",
        ),
    ] = None,
    host: Annotated[
        str | None,
        option(
            "--bind", metavar="HOST", help="Address to bind to; beyond 127.0.0.1 with --keys only."
        ),
    ] = None,
    port: Annotated[
        int | None,
        option("--port", metavar="N", help="Port, 5570 if not given; 0 is any free one."),
    ] = None,
    keys: Annotated[
        Path | None,
        option("--keys", metavar="FILE", help="Key file of the server, of ppy rig keys."),
    ] = None,
    log: Annotated[
        Path | None, option("--log", metavar="FILE", help="Add every line to this file, too.")
    ] = None,
    priority: Annotated[
        int | None,
        option(
            "--device-priority",
            metavar="N",
            help="Real-time priority of the device's process, 1 to 99.",
        ),
    ] = None,
    cpu: Annotated[
        int | None,
        option("--device-cpu", metavar="N", help="Core that the device's process stays on."),
    ] = None,
) -> None:
    """Serve a rig: commands within limits, measured values with their age, and a safe state when anything fails.

    Ends in the safe state on Ctrl-C and SIGTERM; SIGUSR1 and ppy rig stop are an emergency stop.
    """
    from fmus.rig_proxy.protocol import ENDPOINT
    from orchestration.rig.endpoint import host_and_port
    from orchestration.rig.server.front import serve as work
    from orchestration.rig.server.settings import Settings, read_options

    if endpoint is not None and (host is not None or port is not None):
        raise UserError("--endpoint says all that --bind and --port do; give one of them")
    default = host_and_port(endpoint or ENDPOINT)
    settings = Settings(
        backend,
        read_options(options or []),
        rate,
        watchdog,
        lockstep,
        default[0] if host is None else host,
        default[1] if port is None else port,
        keys,
        log,
        priority,
        cpu,
    )
    if work(settings):
        raise typer.Exit(1)
