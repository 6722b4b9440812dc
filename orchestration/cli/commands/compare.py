"""``ppy compare``: comparison of a model with a record, and its recalibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from orchestration.cli.command import command
from orchestration.cli.commands.options import CompareCommand
from orchestration.cli.isolation import isolating
from orchestration.cli.outputs import JSON, Outputs, standard_output_for, write_json

if TYPE_CHECKING:
    from orchestration.identify import Comparison


@command(CompareCommand)
def compare(options: CompareCommand) -> None:
    """Compare a model with a measured record: fit in percent, RMS error, whiteness."""
    from orchestration.cli.models import model_file, note_neutral, open_measured
    from orchestration.identify import comparison as work
    from orchestration.reporting import pictures
    from orchestration.reporting.console import progress

    names = options["fit"]
    Outputs(
        {"the record": options["record"], "the model": model_file(options["model"])},
        {"--out": options["out"], "--json": options["json"], "--plot": options["plot"]},
        {"--out": JSON, "--json": JSON, "--plot": pictures.FORMATS},
    ).check()
    with isolating(options["isolate"]):
        model, record, parameters = open_measured(options, options["runtime"])
        if names:
            note_neutral(model, parameters)
        with progress() as tell:
            comparison = work.compare(model, record, parameters, names, tell)
        with standard_output_for(options["json"]):
            show(comparison)
            _write(comparison, options)
    if options["require"] is not None:
        _require(comparison, options["require"])


def _require(comparison: Comparison, percent: float) -> None:
    """Exit with status 1 if an output does not reach the required fit."""
    from orchestration.reporting.console import warn

    judged = comparison.before if comparison.after is None else comparison.after
    fits = {name: judgement.fit_percent for name, judgement in judged.items()}
    # a fit that is not a number is too low as well
    too_low = {name: fit for name, fit in fits.items() if not fit >= percent}
    for name, fit in too_low.items():
        warn(f"--require {percent:g}%: {name} fits {fit:.4g} %")
    if too_low:
        raise typer.Exit(1)


def _write(comparison: Comparison, options: CompareCommand) -> None:
    """Write the figures and the picture of a comparison."""
    from orchestration.reporting.console import wrote

    effects = comparison.model.effects
    figures = comparison.to_dict() | ({"with": list(effects)} if effects else {})
    for path in (options["out"], options["json"]):
        write_json(path, figures)
    if options["plot"] is not None:
        comparison.plot(options["plot"])
        wrote(options["plot"])


def show(comparison: Comparison) -> None:
    """Print a comparison: fit per output, and the fitted parameters with their intervals."""
    from orchestration.identify import overview
    from orchestration.reporting.console import out, warn

    out.print(overview(comparison))
    for warning in comparison.fit.all_warnings if comparison.fit else ():
        warn(warning)
