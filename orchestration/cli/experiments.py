"""Experiments of commands: execution, display and files; and experiments on a system alone."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError
from orchestration.cli.command import refuse
from orchestration.cli.commands.options import SimulateCommand
from orchestration.cli.ending import kept_in
from orchestration.cli.isolation import limits
from orchestration.cli.outputs import part_of, write_files
from orchestration.cli.real_time import IncompleteRecord, keep, status_line
from orchestration.reporting.console import err, note, out, progress, wrote

if TYPE_CHECKING:
    import xarray

    from orchestration.cli.commands.options import RunCommand
    from orchestration.experiment import Experiment, ExperimentResult
    from orchestration.experiment.live import Live
    from orchestration.fmu import Signal
    from orchestration.fmu.isolation import Limits


def run_and_write(
    experiment: Experiment,
    name: str,
    options: RunCommand | SimulateCommand,
    live: Live | None = None,
) -> ExperimentResult:
    """Run an experiment; print the result, and write and draw it by the options.

    Parameters
    ----------
    experiment : Experiment
    name : str
        File or name of the experiment, for messages.
    options : RunCommand or SimulateCommand
    live : Live, optional
        Options of a run in real time.

    Raises
    ------
    UserError
        If something does not fit, an FMU fails before the first point, or a file cannot be written.
    """
    from orchestration.experiment import results
    from orchestration.experiment.reading import movable
    from orchestration.journal import removed_after
    from orchestration.reporting import write_page

    out = options["out"]
    plot = options["plot"]
    folder = part_of(out) if experiment.variants else None
    with kept_in(folder, "--out", "variants") if experiment.variants else nullcontext():
        data = _run_with_progress(experiment, name, options, live, folder)
    _show(data)
    if out is not None:
        with removed_after(folder):
            if live is None:
                results.write(movable(data, out.parent), out)
            else:
                keep(data, out, live)
        wrote(out, "" if data.attrs["complete"] else "incomplete")
    is_page = plot is not None and plot.suffix.lower() == ".html"
    write_files(options, plot=partial(write_page, data) if is_page else data.plot)
    return data


def raise_if_incomplete(data: xarray.Dataset, live: Live | None = None) -> None:
    """Raise the error of an incomplete result, which is already written.

    Raises
    ------
    UserError
        If the run failed; `IncompleteRecord` if it was in real time.
    KeyboardInterrupt
        If it was interrupted.
    """
    if "failure" in data.attrs:
        raise (UserError if live is None else IncompleteRecord)(data.attrs["failure"])
    if not data.attrs["complete"]:
        raise KeyboardInterrupt


def _run_with_progress(
    experiment: Experiment,
    name: str,
    options: RunCommand | SimulateCommand,
    live: Live | None,
    folder: Path | None,
) -> ExperimentResult:
    """Run an experiment with a progress bar, or in real time with a status line."""
    from orchestration.experiment import results
    from orchestration.experiment import run as make

    out = options["out"]

    def fits(sketch: xarray.Dataset) -> None:
        if out is not None:
            results.check(sketch, out)

    def isolation(foreign: bool) -> Limits | None:
        return limits(foreign and live is None, options)

    run = partial(make, experiment, name, note=note, fits=fits, isolation=isolation)
    if live is None:
        with progress(f"running {name} (FMUs that are not in the cache are built first)") as tell:
            return run(progress=tell.done, folder=folder)
    # no bar: its thread would take time when the next step should begin
    err.print(
        f"running {name} in real time (FMUs that are not in the cache are built first)",
        soft_wrap=True,
    )
    until = f"until {out} is written, what is recorded goes to {live.journal}"
    note("without --out nothing is kept" if out is None else until)
    with status_line(live) as telling:
        return run(live=telling)


def _show(data: xarray.Dataset) -> None:
    """Print the state of a result, its pace, and the extremes of its signals and cycles."""
    from orchestration.experiment import page
    from orchestration.reporting import plain_table

    out.print(page.state(data))
    if "deadlines" in data.attrs:
        out.print(page.pace(data))
    columns = ("smallest", "largest", "last")
    out.print(plain_table(None, "signal", *columns, right=columns, rows=page.extremes(data)))
    cycles = page.cycles(data)
    if cycles:
        of_cycles = page.CYCLE_COLUMNS
        out.print(plain_table(None, *of_cycles, right=of_cycles[1:], rows=cycles))


def experiment_on_system(options: SimulateCommand) -> Experiment:
    """Return the simulation of a system that options describe as an experiment.

    Raises
    ------
    UserError
        If the system or the record cannot be read, or an option is about one model.
    """
    from orchestration.experiment import parse
    from orchestration.experiment.subjects import open_subject

    name = options["model"]
    reason = f"is about one model; {name} is a system"
    refuse(SimulateCommand, options, reason, ("laid_over", "preset"))
    tables: dict[str, Any] = {"system": name}
    own = {key: options[key] for key in ("step", "runtime")} | {"duration": options["stop"]}
    tables |= {key: value for key, value in own.items() if value is not None}
    with open_subject(parse(tables, name, "."), name) as system:
        inputs, duration = _recorded_inputs(options, system.inputs)
        if duration is not None:
            tables.setdefault("duration", duration)
        settings = options["settings"] or {}
        moved, fixed = split_moves(settings, system.driven, system.parameters)
        inputs |= {key: value for key, value in fixed.items() if key in system.inputs} | moved
        parameters = {key: value for key, value in fixed.items() if key not in system.inputs}
    return parse(tables | {"inputs": inputs, "parameters": parameters}, name, ".")


def split_moves(
    settings: Mapping[str, float | str],
    driven: Mapping[str, Signal],
    parameters: Mapping[str, Signal],
) -> tuple[dict[str, str], dict[str, float | str]]:
    """Split settings into those that move in a run and those of one value.

    Returns
    -------
    moved : dict of str to str
        ``VALUE@TIME`` or ``VALUE@TIME@SLEW`` by name of an input or a tunable parameter.
    fixed : dict of str to float or str

    Raises
    ------
    UserError
        If a parameter moves that is not tunable.
    """
    moved = {}
    fixed = {}
    for name, value in settings.items():
        is_move = "@" in str(value)
        if is_move and name in driven:
            moved[name] = str(value)
        elif is_move and name in parameters and parameters[name].type != "string":
            raise UserError(
                f"--set {name}={value}: {name} is not tunable: it has one value in a run"
            )
        else:
            fixed[name] = value
    return moved, fixed


def _recorded_inputs(
    options: SimulateCommand, inputs: Mapping[str, Signal]
) -> tuple[dict[str, Any], float | None]:
    """Return the stimuli of a system that a record has, and its end in s; None without a record."""
    from orchestration.api.options import ReadingOptions
    from orchestration.cli.models import read_inputs
    from orchestration.records.tables import split_header_cell

    refuse(ReadingOptions, options, "is for a record of one model; this is a system")
    record = read_inputs(options, inputs)
    if record is None:
        return {}, None
    mapping = options["mapping"] or {}
    formulas = [target for target in mapping.values() if split_header_cell(target)[0] not in inputs]
    if formulas:
        raise UserError(f"--map {formulas[0]}: a formula is for a record of one model")
    columns = {split_header_cell(target)[0]: column for column, target in mapping.items()}
    own_units = {name: split_header_cell(mapping[column])[1] for name, column in columns.items()}
    stimuli = {
        name: {
            "kind": "file",
            "file": str(options["input_file"]),
            "column": columns.get(name),
            "unit": own_units.get(name),
        }
        for name in record.signals
    }
    return stimuli, float(record.time[-1])
