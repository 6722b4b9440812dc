"""``ppy rig keys``: keys for a rig's server and its clients."""

from __future__ import annotations

from orchestration.cli.command import command
from orchestration.cli.rig.options import KeysCommand


@command(KeysCommand)
def keys(options: KeysCommand) -> None:
    """Make CURVE keys: rig-server.toml for the server, rig-client.toml for its client.

    Nothing is overwritten.
    """
    from orchestration.reporting import note, wrote
    from orchestration.rig import add_client, make_keys

    folder = options["folder"]
    client = options["client"]
    if client is not None:
        wrote(add_client(folder, client), "keys of the client; let nobody else read it")
        note("a server that is running lets the client in when it has been started again")
        return
    server, first = make_keys(folder)
    wrote(server, "stays with the server")
    wrote(first, "keys of the client; let nobody else read it")
