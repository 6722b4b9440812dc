"""``ppy diagnose`` as it is called: of one model, or of the members of a system."""

from __future__ import annotations

import shlex
import sys

from orchestration.cli.command import command
from orchestration.cli.commands.options import DiagnoseCommand
from orchestration.cli.isolation import isolating
from orchestration.cli.outputs import standard_output_for


@command(DiagnoseCommand)
def diagnose(options: DiagnoseCommand) -> None:
    """Name what a model gets wrong on a record, extend it, and measure the gain on unseen data."""
    with isolating(options["isolate"]):
        from orchestration.cli import diagnose as work

        with standard_output_for(options["json"]):
            if options["system"] is not None:
                work.run_system(options, options["system"])
            else:
                work.run_diagnosis(options, shlex.join(["ppy", *sys.argv[1:]]))
