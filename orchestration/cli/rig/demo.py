"""``ppy rig demo``: record from a rig, diagnose, run the extended model beside the rig."""

from __future__ import annotations

from orchestration.cli.command import command
from orchestration.cli.rig.options import RigDemoCommand


@command(RigDemoCommand)
def demo(options: RigDemoCommand) -> None:
    """Close the loop once, in real time, on an emulated rig in which an effect is hidden."""
    from studies.demo import on_rig

    on_rig.run(options["out"], options["seed"])
