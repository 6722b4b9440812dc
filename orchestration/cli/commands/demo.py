"""``ppy demo`` as it is called."""

from __future__ import annotations

from orchestration.cli.command import command
from orchestration.cli.commands.options import DemoCommand
from orchestration.cli.outputs import Outputs


@command(DemoCommand)
def demo(options: DemoCommand) -> None:
    """Do everything once: build, simulate, compare with an emulated rig, diagnose, report."""
    from studies.demo import everything as work

    Outputs(folders={"--out": options["out"]}).check()
    work.run(options["out"])
