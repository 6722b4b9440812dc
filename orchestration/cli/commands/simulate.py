"""``ppy simulate``: a model over a record's inputs or constant ones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from fmus.kit.errors import UserError
from orchestration.cli.isolation import Isolate, MemoryLimit, StepTimeout, hearing_ctrl_c, limits
from orchestration.cli.options import (
    Map,
    Model,
    Picture,
    Preset,
    Runtime,
    Set,
    Step,
    Stop,
    With,
    comma_list,
    option,
)
from orchestration.cli.outputs import SIGNALS, Outputs

if TYPE_CHECKING:
    from orchestration.fmu.model import Model as FoundModel
    from orchestration.fmu.signal import Value
    from orchestration.fmu.simulate import Array


def simulate(
    model: Model,
    input_file: Annotated[
        Path | None, option("--input", help="Record with the inputs, held between samples.")
    ] = None,
    effects: With = None,
    settings: Set = None,
    preset: Preset = None,
    mapping: Map = None,
    stop: Stop = None,
    step: Step = None,
    out: Annotated[
        Path | None,
        option(
            "--out", metavar="FILE", help="Inputs and outputs, with units: .csv, .nc or .parquet."
        ),
    ] = None,
    plot: Picture = None,
    runtime: Runtime = "native",
    isolate: Isolate = None,
    step_timeout: StepTimeout = None,
    memory_limit: MemoryLimit = None,
) -> None:
    """Simulate a component or any FMU."""
    from orchestration.cli.models import model_file, open_model
    from orchestration.fmu import simulate as work
    from orchestration.reporting import pictures
    from orchestration.reporting.console import note, progress, wrote

    if mapping and input_file is None:
        raise UserError("--map renames the columns of a record; give the record with --input")
    Outputs(
        {"the record": input_file, "the model": model_file(model)},
        {"--out": out, "--plot": plot},
        {"--out": SIGNALS, "--plot": pictures.FORMATS},
    ).check()
    opened = open_model(model, runtime, comma_list(effects, "--with"))
    parameters = opened.settings(settings or [], preset)
    isolation = limits(opened.foreign, isolate, step_timeout, memory_limit)
    time, inputs = _stimulus(opened, input_file, mapping or [], parameters, stop, step)
    try:
        with hearing_ctrl_c(isolation), progress() as tell:
            tell(f"simulating {opened.title}")
            outputs = work.simulate(
                opened,
                time,
                inputs,
                parameters,
                lambda done: tell.done(done, time.size),
                note,
                isolation,
            )
    except work.Unfinished as stopped:
        if out is None:
            raise
        part, there = out.with_name(f"{out.stem}.part{out.suffix}"), len(stopped.time)
        _write(
            part,
            opened,
            stopped.time,
            {name: values[:there] for name, values in inputs.items()},
            stopped.outputs,
        )
        raise UserError(
            f"{stopped}; what was computed until {stopped.time[-1]:g} s is in {part}"
        ) from stopped
    _show(opened, time, outputs)
    if out is not None:
        _write(out, opened, time, inputs, outputs)
        wrote(out)
    if plot is not None:
        work.plot(plot, opened, time, {**inputs, **outputs}, opened.title)
        wrote(plot)


def _stimulus(
    model: FoundModel,
    file: Path | None,
    mapping: list[str],
    parameters: Mapping[str, Value],
    stop: float | None,
    step: float | None,
) -> tuple[Array, dict[str, Array]]:
    """Communication points, shape (n,) in s, and inputs over them: a record's, else constant ones as they are set."""
    import numpy as np

    from orchestration.cli.models import check_inputs
    from orchestration.fmu import simulate as work
    from orchestration.fmu.archive import read_description
    from orchestration.records import parse_mapping, read_record
    from orchestration.reporting.console import tell_repairs

    recorded: dict[str, Array] = {}
    if file is not None:
        units_of = {s.name: s.unit for s in model.inputs.values()}
        record = read_record(file, units_of, mapping=parse_mapping(mapping), inputs=list(units_of))
        tell_repairs(record.repairs)
        check_inputs(model, record.signals, parameters)
        time = work.points(record.time, stop, step)
        recorded = {signal: work.held(record, signal, time) for signal in record.signals}
    else:
        usual: Any = read_description(model.path).defaultExperiment
        last = stop if stop is not None else float(getattr(usual, "stopTime", None) or 10.0)
        time = work.grid(0.0, last, step if step is not None else _step(usual, last))
    constant = {
        n: np.full(time.size, value) for n, value in parameters.items() if n in model.inputs
    }
    return time, constant | recorded


def _step(usual: Any, last: float) -> float:
    return float(getattr(usual, "stepSize", None) or last / 1000)


def _show(model: FoundModel, time: Array, outputs: Mapping[str, Array]) -> None:
    from fmus.kit.units import shown
    from orchestration.reporting.console import out, plain_table

    columns = ("smallest", "largest", "last")
    table = plain_table(None, "output", *columns, right=columns)
    for name, values in outputs.items():
        table.add_row(
            name, *(shown(v, model.outputs[name]) for v in (values.min(), values.max(), values[-1]))
        )
    out.print(f"{model.title}: {time.size} points from {time[0]:g} s to {time[-1]:g} s")
    out.print(table)


def _write(
    path: Path,
    model: FoundModel,
    time: Array,
    inputs: Mapping[str, Array],
    outputs: Mapping[str, Array],
) -> None:
    """Write inputs and outputs in the format of the file's ending."""
    signals = {**model.inputs, **model.outputs}
    values = {**inputs, **outputs}
    if path.suffix.lower() == ".csv":  # half a second sooner than through a dataset
        from orchestration.records import write_record

        write_record(path, time, values, {name: signals[name].unit for name in values})
        return
    from orchestration.experiment import results

    results.write(results.dataset(time, values, signals, inputs, {"title": model.title}), path)
