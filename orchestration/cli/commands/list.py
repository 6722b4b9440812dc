"""``ppy list``: the components there are."""

from __future__ import annotations

from orchestration.cli.command import command
from orchestration.cli.options import JsonOption
from orchestration.cli.outputs import JSON, STANDARD_OUTPUT, Outputs, write_json


@command(JsonOption)
def list_components(options: JsonOption) -> None:
    """List the components."""
    from fmus.kit import registry
    from fmus.kit.declare import summary

    path = options["json"]
    Outputs(writes={"--json": path}, endings={"--json": JSON}).check()
    summaries = {name: summary(registry.component(name)) for name in registry.models()}
    width = max(map(len, summaries))
    for name, text in summaries.items():
        if path != STANDARD_OUTPUT:
            print(f"{name:{width}}  {text}")
    write_json(path, [{"name": name, "summary": text} for name, text in summaries.items()])
