"""``ppy design``: a controller for a component, an FMU or a system."""

from __future__ import annotations

from orchestration.api.declaration import only
from orchestration.api.options import DesignKeywords
from orchestration.cli.command import command
from orchestration.cli.commands.linearise import model_or_system
from orchestration.cli.commands.options import DesignCommand
from orchestration.cli.commands.sweep import ranges_of
from orchestration.cli.outputs import check_outputs, show_and_write


@command(DesignCommand)
def design(options: DesignCommand) -> None:
    """Design a controller for a component, an FMU or a system, from its linear model.

    The phase margin is that of the loop with hold, delay and filter. --over and --fitted make a
    band of margins and responses.
    """
    from orchestration.api import design as work
    from orchestration.reporting.console import progress, wrote

    name = options["model"]
    folder = options["out"]
    check_outputs(options, {"the fit": options["fitted"]}, folder=folder)
    chosen = only(DesignKeywords, options)
    chosen["over"] = ranges_of(options["over"]) or None
    with progress(f"designing a controller for {name}"):
        found = work(model_or_system(name, options["laid_over"]), **chosen)
    show_and_write(found, options, plot=found.plot)
    if folder is not None:
        for path in found.write(folder):
            wrote(path)
