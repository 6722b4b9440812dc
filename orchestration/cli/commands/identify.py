"""``ppy identify``: parameters of a model from a record."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.commands.compare import show
from orchestration.cli.commands.options import IdentifyCommand
from orchestration.cli.ending import end_interrupted
from orchestration.cli.isolation import isolating
from orchestration.cli.outputs import check_outputs, typed_command, write_files, write_json
from orchestration.reporting.console import note, out, progress

if TYPE_CHECKING:
    from orchestration.identify import Comparison, Fit, JointComparison


@command(IdentifyCommand)
def identify(options: IdentifyCommand) -> None:
    """Identify parameters of a component, any FMU or a system from a record."""
    profiled = _profiled(options)
    records = {
        f"the record{f' {k}' if k > 1 else ''}": path
        for k, path in enumerate(options["records"], 1)
    }
    check_outputs(options, records, ssv=(".ssv",))
    with isolating(options["isolate"]):
        found = _fitted(options, profiled)
        one_or_all: Comparison | JointComparison = found
        if len(found.comparisons) == 1:
            (one_or_all,) = found.comparisons.values()
        posterior = None
        if options["posterior"] is not None and not found.fit.is_interrupted:
            with progress() as tell:
                posterior = found.fit.posterior(options["posterior"], progress=tell)
        figures = one_or_all.to_dict()
        show(found.fit, *found.comparisons.values())
        if posterior is not None:
            out.print(*posterior.overview(), sep="\n")
            figures["fitted"]["posterior"] = posterior.to_dict()
        write_json(options["json"], figures)
        _write(one_or_all, found.fit, options)
        if posterior is not None:
            write_files(options, corner=posterior.plot)
        if found.fit.is_interrupted:
            end_interrupted("the values are the best so far")


def _fitted(options: IdentifyCommand, profiled: list[str]) -> JointComparison:
    """Fit the parameters, and then profile some of them."""
    from orchestration.cli.models import note_neutral, open_runs
    from orchestration.identify import comparison as work
    from orchestration.identify import read_assumptions

    model, records, parameters = open_runs(options)
    note_neutral(model, parameters)
    assumptions = read_assumptions(model, options)
    with progress() as tell:
        found = work.compare_fitted(
            model,
            records,
            parameters,
            options["fit"],
            assumptions,
            progress=tell,
            workers=options["workers"],
        )
        if found.fit.is_interrupted:
            return found
        if profiled:
            tell(f"fitting again, with {', '.join(profiled)} held")
        for k, name in enumerate(profiled):
            found.fit.profile(name, partial(tell.done, k, len(profiled)))
    return found


def _write(found: Comparison | JointComparison, fit: Fit, options: IdentifyCommand) -> None:
    """Write the parameter set, the pictures and the page."""
    from orchestration.identify import parameter_set

    shared = {name: value for name, value in fit.values.items() if "@" not in name}

    def write_set(path: Path) -> None:
        doc = f"identified from {', '.join(p.name for p in options['records'])}"
        parameter_set.write(path, shared, fit.declared, doc)
        if len(shared) < len(fit.values):
            note(f"{path} has the shared parameters; those of single records are in --json")

    # there are none after an interrupt
    profiles = {"profile_plot": fit.plot_profiles} if fit.profiles else {}
    report = partial(found.report, command=typed_command())
    write_files(options, ssv=write_set, plot=found.plot, **profiles, report=report)


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
    if options["corner"] is not None and options["posterior"] is None:
        raise UserError("--corner: there is nothing to draw without --posterior")
    return profiled or []
