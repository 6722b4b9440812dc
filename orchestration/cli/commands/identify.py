"""``ppy identify``: parameters of a model from a record."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.commands.compare import show
from orchestration.cli.commands.options import IdentifyCommand
from orchestration.cli.isolation import isolating
from orchestration.cli.outputs import (
    JSON,
    PAGE,
    Outputs,
    standard_output_for,
    typed_command,
    write_json,
)

if TYPE_CHECKING:
    from orchestration.identify import Comparison


@command(IdentifyCommand)
def identify(options: IdentifyCommand) -> None:
    """Identify parameters of a component, any FMU or a system from a record."""
    from orchestration.cli.models import model_file
    from orchestration.reporting import pictures

    profiled = _profiled(options)
    Outputs(
        {"the record": options["record"], "the model": model_file(options["model"])},
        {
            "--ssv": options["ssv"],
            "--json": options["json"],
            "--plot": options["plot"],
            "--profile-plot": options["profile_plot"],
            "--report": options["report"],
        },
        {
            "--ssv": (".ssv",),
            "--json": JSON,
            "--plot": pictures.FORMATS,
            "--profile-plot": pictures.FORMATS,
            "--report": PAGE,
        },
    ).check()
    with isolating(options["isolate"]):
        comparison = _fitted(options, profiled)
        with standard_output_for(options["json"]):
            show(comparison)
            write_json(options["json"], comparison.to_dict())
            _write(comparison, options)


def _fitted(options: IdentifyCommand, profiled: list[str]) -> Comparison:
    """Fit the parameters, and then profile some of them."""
    from orchestration.cli.models import note_neutral, open_measured
    from orchestration.identify import comparison as work
    from orchestration.reporting.console import progress

    names = options["fit"]
    model, record, parameters = open_measured(options)
    note_neutral(model, parameters)
    with progress() as tell:
        comparison = work.compare(model, record, parameters, names, tell, options["workers"])
        assert comparison.fit is not None
        if profiled:
            tell(f"fitting again, with {', '.join(profiled)} held")
        for k, name in enumerate(profiled):
            comparison.fit.profile(name, partial(tell.done, k, len(profiled)))
    return comparison


def _write(comparison: Comparison, options: IdentifyCommand) -> None:
    """Write the parameter set, the pictures and the page."""
    from orchestration.identify import parameter_set
    from orchestration.reporting.console import wrote

    ssv = options["ssv"]
    plot = options["plot"]
    report = options["report"]
    profile_plot = options["profile_plot"]
    assert comparison.fit is not None
    if ssv is not None:
        doc = f"identified from {comparison.record.source.name} for {comparison.model.title}"
        parameter_set.write(ssv, comparison.fit.values, comparison.model.constants, doc)
        wrote(ssv)
    if plot is not None:
        comparison.plot(plot)
        wrote(plot)
    if profile_plot is not None:
        comparison.fit.plot_profiles(profile_plot)
        wrote(profile_plot)
    if report is not None:
        wrote(comparison.report(report, typed_command()))


def _profiled(options: IdentifyCommand) -> list[str]:
    """Return the parameters to profile; they are refused before any work is done."""
    names = options["fit"]
    profiled = options["profile"]
    if profiled == []:
        raise UserError(f"--profile '': name some of the fitted parameters, {','.join(names)}")
    for name in profiled or ():
        if name not in names:
            raise UserError(f"--profile: {name} is not fitted; --fit has {','.join(names)}")
    if options["profile_plot"] is not None and not profiled:
        raise UserError("--profile-plot: there is nothing to draw without --profile")
    return profiled or []
