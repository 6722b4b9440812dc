"""``ppy rig demo``: measure on a rig, learn what the model misses, run the extended model beside the rig."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orchestration.cli.options import option


def demo(
    out: Annotated[
        Path, option("--out", metavar="FOLDER", help="Everything that is made goes here.")
    ] = Path("hil-output"),
    seed: Annotated[
        int, typer.Option("--seed", help="Which emulated rig, and which effect is hidden in it.")
    ] = 1,
) -> None:
    """Close the loop once, in real time, on an emulated rig in which an effect is hidden."""
    from orchestration.cli.rig.demonstration import run

    run(out, seed)
