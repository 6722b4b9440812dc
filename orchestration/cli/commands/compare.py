"""``ppy compare``: a model and a record, with recalibration; or a result and a reference."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.cli.command import command, refuse
from orchestration.cli.commands.options import CompareCommand, ReferenceOptions
from orchestration.cli.isolation import isolating
from orchestration.cli.outputs import JSON, check_outputs, write_files, write_json
from orchestration.cli.verdicts import Case, conclude
from orchestration.reporting.console import out, progress, tell_repairs, warn

if TYPE_CHECKING:
    from orchestration.identify import Comparison, Fit

_WRITES = ("out", "json", "junit", "plot", "report")
_OF_FILES = ("record", *ReferenceOptions.__annotations__, *_WRITES)


@command(CompareCommand)
def compare(options: CompareCommand) -> None:
    """Compare a model with a measured record: fit in percent, RMS error, whiteness.

    With a REFERENCE it compares two files instead: every sample of the first one must be in a tube
    around the second one, so wide in time and so high in value as --tube says. Exit status 1 if one
    is not, 2 if nothing could be compared.
    """
    if options["reference"] is not None:
        _compare_files(options["record"], options["reference"], options)
        return
    files = "is for two files: ppy compare RESULT REFERENCE"
    refuse(CompareCommand, options, files, ("tube", "report"))
    from orchestration.cli.models import note_neutral, open_measured
    from orchestration.identify import comparison as work

    names = options["fit"]
    check_outputs(options, {"the record": options["record"]}, out=JSON)
    with isolating(options["isolate"]):
        model, record, parameters = open_measured(options, options["runtime"])
        if names:
            note_neutral(model, parameters)
        with progress() as tell:
            comparison = work.compare(model, record, parameters, names, tell)
        show(comparison.fit, comparison)
        _write(comparison, options)
        cases = _cases(comparison, options["require"])
        conclude("ppy compare", cases, options["junit"])


def _compare_files(result: Path, reference: Path, options: CompareCommand) -> None:
    """Compare a result with a reference; exit with status 1 if a signal differs."""
    from orchestration.cli import regression as shown
    from orchestration.experiment.regression import compare as work
    from orchestration.records import read_samples

    of_models = (name for name in options if name not in _OF_FILES)
    reason = "is for a model and a record; these are two files"
    refuse(CompareCommand, options, reason, of_models)
    check_outputs(options, {"the result": result, "the reference": reference}, out=JSON)
    one, other = read_samples(result), read_samples(reference)
    tell_repairs([*one.repairs, *other.repairs])
    regression = work(one, other, options["tube"] or {})
    shown.show(regression)
    shown.write(regression, options["report"], options["plot"])
    for path in (options["out"], options["json"]):
        write_json(path, shown.as_json(regression))
    conclude("ppy compare", shown.cases(regression), options["junit"])


def _cases(comparison: Comparison, percent: float | None) -> list[Case]:
    """Return a case for each output, which fails if it does not reach the required fit."""
    cases = []
    for name, judgement in comparison.latest.items():
        fit = judgement.fit_percent
        # a fit that is not a number is too low as well
        low = percent is not None and not fit >= percent
        failure = f"--require {percent:g}%: {name} fits {fit:.4g} %" if low else ""
        if failure:
            warn(failure)
        cases.append(Case(comparison.model.name, name, failure))
    return cases


def _write(comparison: Comparison, options: CompareCommand) -> None:
    """Write the figures and the picture of a comparison."""
    effects = comparison.model.effects
    figures = comparison.to_dict() | ({"with": list(effects)} if effects else {})
    for path in (options["out"], options["json"]):
        write_json(path, figures)
    write_files(options, plot=comparison.plot)


def show(fit: Fit | None, *comparisons: Comparison) -> None:
    """Print how well records are followed, the fitted parameters, and what is doubtful of them."""
    from orchestration.identify import overview

    out.print(overview(*comparisons))
    for warning in fit.all_warnings if fit else ():
        warn(warning)
