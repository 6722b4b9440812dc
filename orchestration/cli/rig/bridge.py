"""``ppy rig bridge``: plain ZeroMQ on this machine, carried on to a server with CURVE."""

from __future__ import annotations

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.rig.options import BridgeCommand


@command(BridgeCommand)
def bridge(options: BridgeCommand) -> None:
    """Carry proxies that cannot encrypt to a server with keys.

    Plain on this machine only, CURVE beyond it.
    """
    from orchestration.reporting import note, out, warn
    from orchestration.rig import LOOPBACK, Bridge, read_endpoint, until_interrupted

    endpoint = options["endpoint"]
    port = options["port"]
    remote = read_endpoint(endpoint, options["credentials"], warn)
    local = f"tcp://{LOOPBACK}:{port}"
    if remote.requests == local:
        raise UserError(
            f"--endpoint {endpoint}: this is the bridge itself; --port chooses another port for it"
        )
    with until_interrupted():
        carries = Bridge(remote, port, note)
        out.print(f"{local} is carried on to {remote.requests} (Ctrl-C ends it)")
        carries.run()
