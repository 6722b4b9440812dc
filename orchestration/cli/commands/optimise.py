"""``ppy optimise``: parameters of a component at which outputs are best."""

from __future__ import annotations

from orchestration.api.declaration import only
from orchestration.api.options import OptimiseKeywords
from orchestration.cli.command import command
from orchestration.cli.commands.options import OptimiseCommand
from orchestration.cli.commands.sweep import ranges_of
from orchestration.cli.ending import kept_in
from orchestration.cli.outputs import check_outputs, part_of, write_files, write_json


@command(OptimiseCommand)
def optimise(options: OptimiseCommand) -> None:
    """Search the parameters of a component for the best of an output, or for a front of two.

    Each point of a front is the best of the first objective at a level of the second.
    """
    from orchestration.api import optimise as work
    from orchestration.api import values_of
    from orchestration.fmu.model import declared_model
    from orchestration.journal import removed_after
    from orchestration.reporting import console

    check_outputs(options)
    over = ranges_of(options["over"])
    model = declared_model(options["model"], options["laid_over"])
    chosen = only(OptimiseKeywords, options)
    chosen["settings"] = values_of(model, options["settings"], options["preset"])
    folder = part_of(options["json"])
    chosen["folder"] = folder
    with (
        kept_in(folder, "--json", "points"),
        console.progress(f"optimising {options['model']}") as tell,
    ):
        chosen["progress"] = tell.done
        front = work(model, over, **chosen)
    with removed_after(folder):
        console.out.print(str(front))
        write_json(options["json"], front.to_dict())
        write_files(options, plot=front.plot)
