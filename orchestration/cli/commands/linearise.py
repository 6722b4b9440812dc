"""``ppy linearise``: a component, an FMU or a system as a linear model about an operating point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.api.declaration import only
from orchestration.api.options import LineariseKeywords, MappingOption
from orchestration.cli.command import command, refuse
from orchestration.cli.commands.options import LineariseCommand
from orchestration.cli.commands.sweep import ranges_of
from orchestration.cli.outputs import check_outputs, show_and_write

if TYPE_CHECKING:
    from orchestration.fmu import Model


@command(LineariseCommand)
def linearise(options: LineariseCommand) -> None:
    """Linearise a component, an FMU or a system about an operating point, or cut a loop of it."""
    from orchestration.api import linearise as work
    from orchestration.cli.models import read_inputs
    from orchestration.reporting.console import progress

    name = options["model"]
    reads = {"the record": options["input_file"], "the fit": options["fitted"]}
    check_outputs(options, reads, mat=(".mat",))
    if options["input_file"] is None:
        refuse(MappingOption, options, "is about a record; give the record with --input")
    chosen = only(LineariseKeywords, options)
    chosen["over"] = ranges_of(options["over"]) or None
    with progress(f"linearising {name}"):
        model = model_or_system(name, options["laid_over"])
        stimulus = None
        if options["input_file"] is not None and isinstance(model, str):
            raise UserError(f"--input is of one model; {name} is a system")
        if not isinstance(model, str) and (record := read_inputs(options, model.inputs)):
            chosen["time"] = record.time
            stimulus = record.signals
        linear = work(model, stimulus, **chosen)
    show_and_write(linear, options, mat=linear.to_mat, plot=linear.plot)


def model_or_system(name: str, laid_over: Sequence[str]) -> Model | str:
    """Return a model with effects laid over it, or the name or file of a system.

    Raises
    ------
    UserError
        If there is no such model or effect, or effects are for a system.
    """
    from orchestration.experiment.subjects import is_system
    from orchestration.fmu.model import declared_model

    if is_system(name):
        if laid_over:
            raise UserError(f"--with is of one model; {name} is a system")
        return name
    return declared_model(name, laid_over)
