"""``ppy rig keys``: keys for a rig's server and its clients."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orchestration.cli.options import option


def keys(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where the key files go, or are.")
    ],
    client: Annotated[
        str | None,
        option(
            "--client", metavar="NAME", help="Make keys for one more client of the server there."
        ),
    ] = None,
) -> None:
    """Make CURVE keys: rig-server.toml for the server, rig-client.toml for its client; nothing is overwritten."""
    from orchestration.reporting.console import note, wrote
    from orchestration.rig.keys import add_client, make_keys

    if client is not None:
        wrote(add_client(folder, client), "keys of the client; let nobody else read it")
        note("a server that is running lets the client in when it has been started again")
        return
    server, first = make_keys(folder)
    wrote(server, "stays with the server")
    wrote(first, "keys of the client; let nobody else read it")
