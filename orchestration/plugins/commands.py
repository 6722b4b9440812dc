"""Command ``ppy rig opcua``, which is an entry point.

No ``from __future__ import annotations``, with which the options in annotations could not be read.
"""

from pathlib import Path
from typing import Annotated

from fmus.kit.extras import require
from orchestration.api.declaration import Option
from orchestration.cli.command import command
from orchestration.cli.commands.options import ServerOptions


class OpcuaCommand(ServerOptions, total=False):
    """Options of ``ppy rig opcua``."""

    host: Annotated[
        str,
        Option(
            "Address to bind to; beyond 127.0.0.1 the rig cannot be driven.",
            default="127.0.0.1",
            flag="--bind",
            metavar="HOST",
        ),
    ]
    port: Annotated[int, Option("Port of the server of OPC UA.", default=4840, least=1, most=65535)]
    password: Annotated[
        Path | None,
        Option(
            'File with password = "...", with which a user may drive; without it nobody may.',
            metavar="FILE.toml",
        ),
    ]
    lease: Annotated[
        float,
        Option(
            "How long the rig is driven without another write, in s.",
            default=2.0,
            least=0.1,
            most=3600.0,
        ),
    ]


@command(OpcuaCommand)
def opcua(options: OpcuaCommand) -> None:
    """Show a rig in OPC UA, and let it be driven from there.

    Everybody may read and call Stop. With --password a user who knows it may write inputs, within
    all limits of the rig; for that --credentials has to hold a key that may command.
    """
    require("asyncua", "zmq")
    import asyncio
    import logging

    from orchestration.plugins.driver import Driver, read_password
    from orchestration.reporting.console import note, out, warn
    from orchestration.rig import ask, read_endpoint, until_interrupted

    credentials = options["credentials"]
    password = read_password(options["password"], options["host"], warn)
    remote = read_endpoint(options["endpoint"], credentials, warn)
    rig = ask(remote, "status")
    from orchestration.plugins.opcua import Bridge  # which takes seconds to import

    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # it tells every refusal
    driver = Driver(remote, rig, credentials, options["lease"], note)
    bridge = Bridge(remote, rig, driver, password, note)
    address = f"opc.tcp://{options['host']}:{options['port']}/rig"
    ready = f"ready: {address} shows the rig at {remote.requests} (Ctrl-C ends it)"
    with until_interrupted():
        asyncio.run(bridge.run(address, lambda: out.print(ready)))
