"""``ppy rig watch``: a live view of a rig in a browser."""

from __future__ import annotations

from typing import Annotated

import typer

from fmus.rig_proxy.protocol import ENDPOINT
from orchestration.cli.options import Credentials, RigEndpoint


def watch(
    endpoint: RigEndpoint = ENDPOINT,
    credentials: Credentials = None,
    port: Annotated[
        int,
        typer.Option(
            "--port", min=0, max=65535, help="Of the page, on this machine; 0 takes a free one."
        ),
    ] = 8765,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
) -> None:
    """Show a rig in a browser: signals, limits, ages, state, and a stop button. It can command nothing but stop."""
    import webbrowser
    from threading import Thread

    from orchestration.reporting.console import out, warn
    from orchestration.rig.ending import until_told
    from orchestration.rig.endpoint import read_endpoint
    from orchestration.rig.operator import ask
    from orchestration.rig.watch.feed import Feed
    from orchestration.rig.watch.listen import Listener
    from orchestration.rig.watch.serve import PageServer

    remote, feed = read_endpoint(endpoint, credentials, warn), Feed()

    def stop() -> dict[str, object]:
        return ask(remote, "stop", reason="stop button of ppy rig watch")

    with (
        until_told(),
        Listener(remote, feed),
        PageServer(port, remote.requests, feed, stop) as page,
    ):
        out.print(f"watching {remote.requests} at {page.address} (Ctrl-C ends it)")
        if browser:
            Thread(target=webbrowser.open, args=(page.address,), daemon=True).start()
        page.serve_forever(poll_interval=0.1)
