"""``ppy simulate``: a model or a system over a record's inputs or constant ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from fmus.kit.errors import UserError, error_context
from orchestration.api.options import MappingOption, source_of
from orchestration.cli.command import command, refuse
from orchestration.cli.commands.options import SimulateCommand
from orchestration.cli.isolation import hearing_ctrl_c, limits
from orchestration.cli.outputs import SIGNALS, check_outputs, write_files
from orchestration.reporting.console import note, progress, tell_repairs, wrote
from orchestration.reporting.console import out as terminal

if TYPE_CHECKING:
    from fmus.kit.arrays import Array
    from orchestration.api import Simulation
    from orchestration.fmu import Model, Value
    from orchestration.records import Record


_OF_ONE_FMU = (
    *("tolerance", "model_exchange", "units", "outputs"),
    *("log_calls", "state_in", "state_out"),
)
_SYSTEMS = (".ssp", ".ssd")  # as in system.ssp, which takes half a second to load


@command(SimulateCommand)
def simulate(options: SimulateCommand) -> None:
    """Simulate a component, any FMU, or a system of FMUs."""
    from fmus.kit import registry
    from orchestration.system import NAMES

    if options["input_file"] is None:
        refuse(MappingOption, options, "is about a record; give the record with --input")
    reads = {"the record": options["input_file"], "the state to go on from": options["state_in"]}
    check_outputs(options, reads, out=SIGNALS, log_calls=(), state_out=())
    name = options["model"]
    if Path(name).suffix.lower() in _SYSTEMS or (name in NAMES and name not in registry.models()):
        refuse(SimulateCommand, options, "is for one FMU; this is a system", _OF_ONE_FMU)
        _simulate_system(options)
    else:
        _simulate_model(options)


def _simulate_system(options: SimulateCommand) -> None:
    from orchestration.cli.experiments import (
        experiment_on_system,
        raise_if_incomplete,
        run_and_write,
    )

    raise_if_incomplete(run_and_write(experiment_on_system(options), options["model"], options))


def _simulate_model(options: SimulateCommand) -> None:
    """Simulate a model; print, write and draw the results, also those of a run that ends early."""
    from orchestration.api import Simulation, values_of
    from orchestration.cli.experiments import split_moves
    from orchestration.cli.models import build_model
    from orchestration.fmu.model import declared_model
    from orchestration.fmu.simulation import LimitOutputs, UnfinishedSimulation

    out = options["out"]
    found = declared_model(options["model"], options["laid_over"])
    declared = found.with_options(options).with_texts(options["outputs"])
    moved, settings = split_moves(options["settings"] or {}, declared.driven, declared.parameters)
    parameters = values_of(declared, settings, options["preset"])
    recorded = _read_inputs(declared, parameters, options)
    _refuse_settings_of_state(declared, [*parameters, *moved], options)
    model = build_model(declared, options["runtime"])
    stimulus = _stimulus(model, recorded, parameters, moved, options)
    try:
        time, outputs = _run(model, stimulus, parameters, options)
    except UnfinishedSimulation as stopped:
        if out is None:
            raise
        part = out.with_name(f"{out.stem}.part{out.suffix}")
        inputs = _at(stimulus.time, stopped.time, stimulus.inputs)
        _write(Simulation(model, stopped.time, inputs, stopped.outputs), part)
        raise UserError(
            f"{stopped}; what was computed until {stopped.time[-1]:g} s is in {part}"
        ) from stopped
    inputs = _at(stimulus.time, time, stimulus.inputs)
    result = Simulation(model, time, inputs, outputs)
    limit_outputs = LimitOutputs.among(model.outputs, model.parameters)
    for line in limit_outputs.remarks(time, outputs, parameters):
        note(line)
    terminal.print(*result.overview(), sep="\n")
    write_files(options, out=partial(_write, result), plot=result.plot)
    for path in (options["log_calls"], options["state_out"]):
        if path is not None and path.exists():
            wrote(path)


def _refuse_settings_of_state(
    model: Model, parameters: Iterable[str], options: SimulateCommand
) -> None:
    """Raise UserError if a parameter is set that a state has already."""
    if options["state_in"] is None:
        return
    for name in parameters:
        if name not in model.inputs:
            raise UserError(
                f"--set {name}: it is part of the state in {options['state_in']}; only inputs can"
                " be set beside --state-in"
            )


class _Stimulus(NamedTuple):
    """The inputs of a simulation.

    Attributes
    ----------
    time : ndarray, shape (m,)
        Communication points in s, at which inputs may change.
    inputs : dict of str to ndarray, shape (m,)
        Held from each point to the next.
    wanted : ndarray, shape (n,)
        The points whose outputs are shown.
    """

    time: Array
    inputs: dict[str, Array]
    wanted: Array


def _at(points: Array, time: Array, signals: Mapping[str, Array]) -> dict[str, Array]:
    """Return signals (m,) of points in time as they are at other points, held in between."""
    from orchestration.fmu.simulation import points_before

    index = points_before(points, time)
    return {name: values[index] for name, values in signals.items()}


def _run(
    model: Model, stimulus: _Stimulus, parameters: Mapping[str, Value], options: SimulateCommand
) -> tuple[Array, dict[str, Array]]:
    """Run a model; return the points in time, fewer if it requests an end, and its outputs."""
    from orchestration.fmu.simulation import EndedSimulation, RunFiles, simulate

    isolation = limits(model.foreign, options)
    given = (options["log_calls"], options["state_in"], options["state_out"])
    # an FMU may change the working folder
    files = RunFiles(*(path and path.absolute() for path in given))
    try:
        with hearing_ctrl_c(isolation), progress(f"simulating {model.title}") as tell:
            outputs = simulate(
                model,
                stimulus.time,
                stimulus.inputs,
                parameters,
                progress=lambda done: tell.done(done, stimulus.time.size),
                note=note,
                isolation=isolation,
                files=files,
            )
    except EndedSimulation as ended:
        note(f"{ended}; the results end at {ended.time[-1]:g} s")
        if options["state_out"] is not None:
            note(f"no state is written to {options['state_out']}: the simulation has ended")
        return ended.time, ended.outputs
    return stimulus.wanted, _at(stimulus.time, stimulus.wanted, outputs)


def _read_inputs(
    model: Model, parameters: Mapping[str, Value], options: SimulateCommand
) -> Record | None:
    """Read the record of inputs, if one is given."""
    from orchestration.cli.models import check_inputs
    from orchestration.records import read_record
    from orchestration.records.tables import Words

    file = options["input_file"]
    if file is None:
        return None
    if not model.inputs:
        raise UserError(
            f"--input {file}: {model.name} has no inputs; leave it out, and set --stop and --step"
        )
    units = {signal.name: signal.unit_of_records for signal in model.inputs.values()}
    texts = {name: Words() for name, signal in model.inputs.items() if signal.type == "string"}
    items = {name: dict(signal.items) for name, signal in model.inputs.items() if signal.items}
    record = read_record(
        source_of(file, options),
        units,
        mapping=options["mapping"],
        inputs=list(units),
        words={**items, **texts},
        jumps=True,
    )
    for name in texts.keys() & record.signals.keys():
        coded = record.signals[name]
        record.signals[name] = texts[name].texts(coded)  # type: ignore[assignment]
    tell_repairs(record.repairs)
    check_inputs(model, record.signals, parameters)
    return record


def _stimulus(
    model: Model,
    record: Record | None,
    parameters: Mapping[str, Value],
    moved: Mapping[str, str],
    options: SimulateCommand,
) -> _Stimulus:
    """Return the inputs: those of a record or, without one, constant at the values that were set.

    What is moved, ``VALUE@TIME`` by name, is driven like them. Steps end where a recorded input
    changes, too.
    """
    import numpy as np

    from orchestration.api import forms, points_of
    from orchestration.fmu import simulation as work

    recorded: dict[str, Array] = {}
    state = options["state_in"]
    start = work.RunFiles(state_in=state).start
    if record is None:
        time = wanted = points_of(model, None, options["stop"], options["step"], start)
    else:
        stop, step = (forms.optional_seconds(options[name]) for name in ("stop", "step"))
        wanted = work.points(record.time, stop, step)
        if start is not None:
            if not wanted[0] <= start < wanted[-1]:
                raise UserError(
                    f"{state} is a state at {start:g} s, which is not within {wanted[0]:g} s to"
                    f" {wanted[-1]:g} s, the times of the record"
                )
            wanted = np.append(start, wanted[wanted > start])
        time = work.with_changes(record, wanted)
        recorded = {signal: work.held(record, signal, time) for signal in record.signals}
    constant = {
        name: np.full(time.size, value)
        for name, value in parameters.items()
        if name in model.inputs
    }
    driven = _moved(model, parameters, moved, time - wanted[0])
    return _Stimulus(time, constant | recorded | driven, wanted)


def _moved(
    model: Model, parameters: Mapping[str, Value], moved: Mapping[str, str], time: Array
) -> dict[str, Array]:
    """Return the values (n,) of inputs and tunable parameters that are moved."""
    from orchestration.experiment import parse
    from orchestration.experiment.preparation import check_values, stimulus_values

    experiment = parse({"component": model.title, "inputs": moved}, "--set", ".")
    values = {}
    for name in moved:
        signal = model.driven[name]
        start = float(parameters.get(name, signal.start))
        with error_context("--set"):
            values[name] = stimulus_values(
                experiment, name, signal.unit, time, lambda x: note(f"--set: {x}"), start=start
            )
        check_values(signal, values[name], f"--set {name}")
    return values


def _write(result: Simulation, path: Path) -> None:
    """Write inputs and outputs in the format of the file's ending."""
    if path.suffix.lower() == ".csv":  # half a second sooner than through a dataset
        result.to_csv(path)
        return
    from orchestration.experiment import results

    signals = {**result.model.driven, **result.model.outputs}
    values = {**result.inputs, **result.outputs}
    about = {"title": result.model.title}
    results.write(results.dataset(result.time, values, signals, result.inputs, about), path)
