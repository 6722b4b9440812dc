"""``ppy list``: the available components."""

from __future__ import annotations

from orchestration.cli.command import command
from orchestration.cli.options import JsonOption
from orchestration.cli.outputs import check_outputs, write_json


@command(JsonOption)
def list_components(options: JsonOption) -> None:
    """List the components."""
    from fmus.kit import UserError, registry
    from fmus.kit.declare import summary
    from orchestration.reporting.console import out, warn

    path = options["json"]
    check_outputs(options)
    summaries = {}
    for name in registry.models():
        try:
            summaries[name] = summary(registry.component(name))
        except UserError as error:  # of a package of somebody else
            warn(f"{name} is left out: {error}")
    width = max(map(len, summaries))
    for name, text in summaries.items():
        out.print(f"{name:{width}}  {text}")
    write_json(path, [{"name": name, "summary": text} for name, text in summaries.items()])
