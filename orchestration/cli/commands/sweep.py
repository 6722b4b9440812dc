"""``ppy sweep``: a model over many values of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from fmus.kit import UserError
from orchestration.api.declaration import only, options_of
from orchestration.api.options import (
    GridOptions,
    SweepDesignOptions,
    SweepEngineOptions,
    SweepFileKeywords,
    SweepKeywords,
    ToleranceOption,
)
from orchestration.cli.command import command
from orchestration.cli.commands.options import DatasetOption, ReportOption, SweepCommand
from orchestration.cli.ending import kept_in
from orchestration.cli.isolation import given_limits
from orchestration.cli.options import IsolationOptions, PlotOption, RunnableArgument
from orchestration.cli.outputs import check_outputs, part_of, typed_command, write_files
from orchestration.reporting import plain_table
from orchestration.reporting.console import note, progress, wrote
from orchestration.reporting.console import out as terminal

if TYPE_CHECKING:
    import xarray

    from orchestration.fmu import Model, Value
    from orchestration.sweeps import Design, SweepResult, Task
    from orchestration.sweeps.fitted import SweepFit

    Work = Callable[..., SweepResult]

_DATASET = (".nc", ".zarr")
_ZARR = ".zarr"
_ENGINE_NAMES = {"fmu": "FMU", "compiled": "compiled"}
# options of the command line where a file describes the sweep
_BESIDE_FILE = (
    RunnableArgument,
    SweepEngineOptions,
    DatasetOption,
    PlotOption,
    ReportOption,
    IsolationOptions,
)


@command(SweepCommand)
def sweep(options: SweepCommand, context: typer.Context) -> None:
    """Run a component, any FMU or a system over many values, or a sweep of a TOML file."""
    from orchestration.api import sweep_file

    _check_outputs(options)
    model = options["model"]
    folder = part_of(options["out"])
    how = only(SweepFileKeywords, options)
    how["folder"] = folder
    how["limits"] = given_limits(options["isolate"], options)
    how["check"] = partial(_check_results, options)
    if Path(model).suffix.lower() == ".toml":
        _refuse_beside_file(context)
        work: Work = partial(sweep_file, Path(model), note=note)
    else:
        work = _sweep_of_options(options)
    with kept_in(folder, "--out", "cases"), progress(f"sweeping {model}") as tell:
        how["progress"] = tell.done
        data = work(**how)
    _show(data)
    _finish(data, folder, options)
    if "failure" in data and (data["failure"] != "").all():
        raise UserError(f"not one of the {data['failure'].size:,} cases could be run")


def _check_outputs(options: SweepCommand) -> None:
    """Refuse paths that cannot be written, or that would overwrite another file."""
    from orchestration.sweeps.storage import zarr_store

    out = options["out"]
    store = out if out is not None and out.suffix.lower() == _ZARR else None
    files: dict[str, Any] = {**options, "out": None if store else out}
    check_outputs(files, {"the fit": options["fitted"]}, folder=store, out=_DATASET)
    if store is not None:
        zarr_store.check(store)


def _check_results(options: SweepCommand, task: Task, cases: Design) -> None:
    """Refuse a sweep whose result could not be written or drawn."""
    from orchestration.sweeps.execution import check_memory
    from orchestration.sweeps.sensitivity import check_picture

    out = options["out"]
    if out is None or out.suffix.lower() != _ZARR:
        check_memory(task, cases)
    if options["plot"] is not None:
        check_picture(cases.kind, task.keep)


def _finish(data: SweepResult, folder: Path | None, options: SweepCommand) -> None:
    """Print the summary of a sweep, write it and draw it."""
    from orchestration.sweeps.curves import omissions as omissions_of_sweep
    from orchestration.sweeps.page import sweep_page
    from orchestration.sweeps.sensitivity import analysis_of, merge_analysis

    out = options["out"]
    tables = []
    analysis = analysis_of(data.attrs["design"])
    shown = data
    whole: xarray.Dataset = data
    omissions: Callable[[xarray.Dataset], list[str]] = omissions_of_sweep
    try:
        if analysis is not None:
            shown = analysis.analyse(data)
            omissions = analysis.omissions
            tables = [analysis.table(shown)]
            terminal.print(*tables)
            whole = merge_analysis(data, shown)
    finally:  # cases are kept where there is nothing to be said of them
        if out is not None:
            _write_result(whole, out, folder)
    write_files(
        options,
        plot=shown.plot,
        report=lambda path: sweep_page(data, shown.draw, tables, typed_command()).write(path),
    )
    for line in omissions(shown) if options["plot"] is not None else ():
        note(line)


def _sweep_of_options(options: SweepCommand) -> Work:
    """Return the sweep that options describe."""
    from orchestration.api import sweep as run_sweep
    from orchestration.cli.models import open_model
    from orchestration.sweeps.fitted import read_fitted

    opened = open_model(options["model"], options["runtime"], options["laid_over"])
    model = opened.with_units(options["units"] or {})
    fit = None if options["fitted"] is None else read_fitted(options["fitted"], model)
    cases: SweepKeywords = {
        **only(GridOptions, options),
        **only(ToleranceOption, options),
        **only(SweepDesignOptions, options),
    }
    over = ranges_of(options["over"]) if fit is None else _draw_cases(fit, options["over"], cases)
    settings = _settings(model, over, options)
    if fit is not None:
        for line in fit.differences(settings):
            note(line)
    cases["settings"] = settings
    cases["units"] = None  # they are in the model
    return partial(run_sweep, model, over, **cases)


def _settings(model: Model, over: Container[str], options: SweepCommand) -> dict[str, Value]:
    """Return the values that a preset and settings give, in the model's units.

    A swept parameter loses its value of the preset, unless the design varies one parameter at a
    time: the others are then at these values.
    """
    from orchestration.api import values_of
    from orchestration.sweeps.sensitivity import one_at_a_time

    held = options["kind"] == one_at_a_time.TORNADO
    usual = values_of(model, None, options["preset"])
    kept = {name: value for name, value in usual.items() if held or name not in over}
    return kept | values_of(model, options["settings"])


def _draw_cases(fit: SweepFit, over: Sequence[str], cases: SweepKeywords) -> dict[str, Any]:
    """Return parameters drawn from a fit, and change the options `cases` to prediction bands."""
    from orchestration.sweeps.reductions import TRACE
    from orchestration.sweeps.sensitivity import BANDS

    if over or cases["kind"] != "grid":
        raise UserError(
            f"--fitted {fit.path}: parameters are drawn from it; leave out --over and --design"
        )
    drawn = fit.draws(cases["samples"], cases["seed"])
    cases["kind"] = BANDS
    cases["samples"] = None
    cases["keep"] = [TRACE] if cases["keep"] is None else cases["keep"]
    return drawn


def _refuse_beside_file(context: typer.Context) -> None:
    """Refuse options about the sweep where a file describes it."""
    allowed = {"context", *options_of(*_BESIDE_FILE)}
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name not in allowed and source is not None and source.name == "COMMANDLINE":
            raise UserError(f"{parameter.opts[0]}: the file says what is run; change it there")


def ranges_of(over: Sequence[str]) -> dict[str, Any]:
    """Return the range of each parameter by its name.

    Parameters
    ----------
    over : sequence of str
        Values of ``--over``.

    Raises
    ------
    UserError
        If one is not of the form, or a parameter is named twice.
    """
    ranges: dict[str, Any] = {}
    for text in over:
        name, equals, values = (part.strip() for part in text.rpartition("="))
        if not equals:
            raise UserError(f"--over {text!r}: write name=from..to:count or name=value, value, ...")
        if name in ranges:
            raise UserError(f"--over names {name} twice")
        ranges[name] = values
    return ranges


def _write_result(data: xarray.Dataset, out: Path, parts: Path | None) -> None:
    """Write the result, and only then remove the folder with its parts."""
    from orchestration.experiment import results
    from orchestration.journal import removed_after
    from orchestration.sweeps.storage import zarr_store

    with removed_after(parts):
        (zarr_store if out.suffix.lower() == _ZARR else results).write(data, out)
    wrote(out)


def _show(data: xarray.Dataset) -> None:
    """Print the range of each number over all cases, and the number of cases that failed."""
    from orchestration.sweeps.page import case_count, extremes

    terminal.print(
        f"{data.attrs['model']}: {case_count(data):,} cases, {_ENGINE_NAMES[data.attrs['engine']]}"
    )
    columns = ("smallest", "largest")
    table = plain_table(None, "over all cases", *columns, "unit", right=columns)
    for row in extremes(data):
        table.add_row(row.name, f"{row.smallest:.6g}", f"{row.largest:.6g}", row.unit)
    terminal.print(table)
    if "failure" in data:
        reasons = data["failure"].values.ravel()
        failed = reasons[reasons != ""]
        note(f"{len(failed)} cases failed; the first: {failed[0]}")
    for line in data.attrs.get("remarks", "").splitlines():
        note(line)
