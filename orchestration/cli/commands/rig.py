"""``ppy rig``: the other end of the cable; its commands are in :mod:`orchestration.cli.rig`."""

from __future__ import annotations

import typer

from orchestration.cli.rig import bridge, demo, keys, operate, record, serve, watch

rig = typer.Typer(
    name="rig",
    add_completion=False,
    rich_markup_mode="rich",
    help="The other end of the cable: serve a rig to proxies, watch it, record from it, stop it.",
)
rig.command("serve")(serve.serve)
rig.command("watch")(watch.watch)
rig.command("record")(record.record)
rig.command("stop")(operate.stop)
rig.command("acknowledge")(operate.acknowledge)
rig.command("status")(operate.status)
rig.command("keys")(keys.keys)
rig.command("bridge")(bridge.bridge)
rig.command("demo")(demo.demo)
