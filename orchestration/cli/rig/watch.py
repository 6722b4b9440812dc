"""``ppy rig watch``: a live view of a rig in a browser."""

from __future__ import annotations

from orchestration.cli.command import command
from orchestration.cli.rig.options import WatchCommand


@command(WatchCommand)
def watch(options: WatchCommand) -> None:
    """Show a rig in a browser: signals, limits, ages, state, and a stop button.

    It can command nothing but stop.
    """
    import webbrowser
    from threading import Thread

    from orchestration.reporting import out, warn
    from orchestration.rig import ask, read_endpoint, until_interrupted
    from orchestration.rig.watch import Feed, Listener, PageServer

    remote = read_endpoint(options["endpoint"], options["credentials"], warn)
    feed = Feed()

    def stop() -> dict[str, object]:
        return ask(remote, "stop", reason="stop button of ppy rig watch")

    with (
        until_interrupted(),
        Listener(remote, feed),
        PageServer(options["port"], remote.requests, feed, stop) as page,
    ):
        out.print(f"watching {remote.requests} at {page.address} (Ctrl-C ends it)")
        if options["browser"]:
            Thread(target=webbrowser.open, args=(page.address,), daemon=True).start()
        page.serve_forever(poll_interval=0.1)
