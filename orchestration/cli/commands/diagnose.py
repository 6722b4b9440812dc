"""``ppy diagnose``, of one model or of the members of a system, and ``ppy laws``."""

from __future__ import annotations

from collections.abc import Sequence

import typer

from orchestration.cli.command import command
from orchestration.cli.commands.options import DiagnoseCommand, LawsCommand
from orchestration.cli.isolation import isolating


@command(DiagnoseCommand)
def diagnose(options: DiagnoseCommand) -> None:
    """Name what a model gets wrong on a record, extend it, and measure the gain on unseen data.

    ``ppy laws`` searches the laws of the model alone, without known effects.
    """
    with isolating(options["isolate"]):
        # imported only where it is needed, for it takes half a second
        from orchestration.cli import diagnose as work

        if options["workers"] is not None:
            verdicts = work.run_each(options, options["workers"])
            _require(options["require"], *verdicts)
        elif options["system"] is not None:
            work.run_system(options, options["system"])
        else:
            result = work.run_diagnosis(options)
            _require(options["require"], result.verdict)


def _require(verdicts: Sequence[str], *reached: str) -> None:
    """Exit with status 1 if a diagnosis does not reach one of the required verdicts."""
    from orchestration.reporting.console import warn

    others = [verdict for verdict in reached if verdict not in verdicts]
    if verdicts and others:
        warn(
            f"--require {','.join(verdicts)}: the verdict is {' and '.join(dict.fromkeys(others))}"
        )
        raise typer.Exit(1)


@command(LawsCommand)
def laws(options: LawsCommand) -> None:
    """Search the laws of a model for missing dependences on signals, with the curve of each."""
    from orchestration.cli import diagnose as work

    work.run_laws(options)
