"""``ppy demo`` as it is called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orchestration.cli.outputs import Outputs


def demo(
    out: Annotated[
        Path, typer.Option(help="Folder for FMUs, pictures, the record and the report.")
    ] = Path("demo-output"),
) -> None:
    """Do everything once: build, run the thesis's experiments, compare with an emulated rig, recalibrate, report."""
    from orchestration.cli import demo as work

    Outputs(folders={"--out": out}).check()
    work.run(out)
