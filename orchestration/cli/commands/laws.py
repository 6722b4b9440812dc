"""``ppy laws`` as it is called."""

from __future__ import annotations

import shlex
import sys

from orchestration.cli.command import command
from orchestration.cli.commands.options import LawsCommand
from orchestration.cli.outputs import standard_output_for


@command(LawsCommand)
def laws(options: LawsCommand) -> None:
    """Ask every law of a model what it lacks on a record: which signal, and by which curve."""
    from orchestration.cli import diagnose as work

    with standard_output_for(options["json"]):
        work.run_laws(options, shlex.join(["ppy", *sys.argv[1:]]))
