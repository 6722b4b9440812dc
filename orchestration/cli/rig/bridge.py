"""``ppy rig bridge``: plain ZeroMQ on this machine, carried on to a server with CURVE."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fmus.kit.errors import UserError
from fmus.rig_proxy.protocol import PORT
from orchestration.cli.options import RigEndpoint, option


def bridge(
    endpoint: RigEndpoint,
    credentials: Annotated[
        Path, option("--credentials", metavar="FILE", help="Key file of a client (ppy rig keys).")
    ],
    port: Annotated[
        int,
        typer.Option("--port", min=1, max=65534, help="On this machine; telemetry is one higher."),
    ] = PORT,
) -> None:
    """Carry proxies that cannot encrypt to a server with keys: plain on this machine only, CURVE beyond it."""
    from orchestration.reporting.console import note, out, warn
    from orchestration.rig.bridge import LOOPBACK, Bridge
    from orchestration.rig.ending import until_told
    from orchestration.rig.endpoint import read_endpoint

    remote, local = read_endpoint(endpoint, credentials, warn), f"tcp://{LOOPBACK}:{port}"
    if remote.requests == local:
        raise UserError(
            f"--endpoint {endpoint}: this is the bridge itself; --port chooses another port for it"
        )
    with until_told():
        carries = Bridge(remote, port, note)
        out.print(f"{local} is carried on to {remote.requests} (Ctrl-C ends it)")
        carries.run()
