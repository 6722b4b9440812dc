"""``ppy sweep``: a model over many values of its parameters."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fmus.kit.errors import UserError
from orchestration.cli.isolation import Isolate, MemoryLimit, StepTimeout, told
from orchestration.cli.options import (
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
from orchestration.cli.outputs import Outputs

if TYPE_CHECKING:
    import xarray

    from orchestration.sweeps.design import Design
    from orchestration.sweeps.fitted import Fitted
    from orchestration.sweeps.task import Task

_DATASET, _ZARR, _TOML = (".nc", ".zarr"), ".zarr", (".toml",)
_RAN = {"fmu": "FMU", "compiled": "compiled"}
Over = Annotated[
    list[str] | None,
    option(
        "--over",
        metavar="NAME=FROM..TO:COUNT",
        help="What a parameter, or an input that is held, goes through: R1=0.3..0.7:41, C=1e-3..1e-1:7 log, "
        "k1=6.3N/mm, 9N/mm; R1=0.3..0.7 for a design that chooses the values. Repeatable.",
    ),
]
DesignKind = Annotated[
    str,
    typer.Option(
        "--design",
        help="grid, list (first values together, then second ones), draws (a list drawn at "
        "random: bands), latin-hypercube, sobol; sobol-indices, tornado: which parameters matter.",
    ),
]
Samples = Annotated[
    int | None,
    option(
        "--samples",
        metavar="N",
        help="Cases of latin-hypercube and sobol; of "
        "sobol-indices for each parameter, and twice as many.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Of what is chosen at random.")]
Kept = Annotated[
    str | None, option("--outputs", help="Which outputs are kept, e.g. voltage,charge.")
]
FittedFile = Annotated[
    Path | None,
    option(
        "--fitted",
        metavar="FILE",
        help="Draw parameters from a fit (ppy identify --json): --samples of them, and bands of the outputs.",
    ),
]
Keep = Annotated[
    str | None,
    option(
        "--keep",
        help="What of each: last,smallest,largest as a rule, mean, rms, trace (all of it; of --fitted).",
    ),
]
Engine = Annotated[
    str,
    typer.Option(
        "--engine",
        help="auto, fmu, or compiled: the equations of a component, faster, same numbers.",
    ),
]
Workers = Annotated[int, typer.Option("--workers", metavar="N", help="Processes that run cases.")]
Scheduler = Annotated[
    str | None,
    option(
        "--scheduler", metavar="ADDRESS", help="Run on a Dask cluster, such as tcp://10.0.0.5:8786."
    ),
]
Out = Annotated[
    Path | None,
    option(
        "--out",
        metavar="FILE",
        help="Result with units: .nc, or .zarr for more than fits into memory. Interrupted, the same command goes on.",
    ),
]


def sweep(
    context: typer.Context,
    model: Model,
    over: Over = None,
    design: DesignKind = "grid",
    fitted: FittedFile = None,
    samples: Samples = None,
    seed: Seed = 0,
    outputs: Kept = None,
    keep: Keep = None,
    effects: With = None,
    settings: Set = None,
    preset: Preset = None,
    stop: Stop = None,
    step: Step = None,
    engine: Engine = "auto",
    workers: Workers = 1,
    scheduler: Scheduler = None,
    out: Out = None,
    plot: Picture = None,
    runtime: Runtime = "native",
    isolate: Isolate = None,
    step_timeout: StepTimeout = None,
    memory_limit: MemoryLimit = None,
) -> None:
    """Run a component or any FMU over many values of its parameters, or a sweep that a TOML file describes."""
    from orchestration.reporting import console

    _check_outputs(model, fitted, out, plot)
    folder = out and out.with_name(f"{out.name}.part")
    how: dict[str, Any] = {
        "engine": engine,
        "workers": workers,
        "scheduler": scheduler,
        "folder": folder,
        "isolate": isolate,
        "limits": told(isolate, step_timeout, memory_limit),
        "check": _check(out, plot),
    }
    if Path(model).suffix.lower() in _TOML:
        _refuse_beside_file(context)
        work = _of_file(Path(model))
    else:
        what = {
            "stop": stop,
            "step": step,
            "kind": design,
            "samples": samples,
            "seed": seed,
            "fitted": fitted,
            "outputs": comma_list(outputs, "--outputs"),
            "keep": comma_list(keep, "--keep") if keep is not None else None,
        }
        work = _of_options(
            model, over or [], runtime, comma_list(effects, "--with"), settings or [], preset, what
        )
    with console.progress() as tell:
        tell(f"sweeping {model}")
        data = work(progress=tell.done, **how)
    _show(data)
    _finish(data, out, folder, plot)
    if "failure" in data and (data["failure"] != "").all():
        raise UserError(f"not one of the {data['failure'].size:,} cases could be run")


def _check_outputs(model: str, fitted: Path | None, out: Path | None, plot: Path | None) -> None:
    from orchestration.cli.models import model_file
    from orchestration.reporting import pictures
    from orchestration.sweeps.storage import stored

    store = out if out is not None and out.suffix.lower() == _ZARR else None
    Outputs(
        {"the model": model_file(model), "the fit": fitted},
        {"--out": None if store else out, "--plot": plot},
        {"--out": _DATASET, "--plot": pictures.FORMATS},
        {"--out": store} if store else {},
    ).check()
    if store is not None:
        stored.check(store)


def _check(out: Path | None, plot: Path | None) -> Callable[[Task, Design], None]:
    """Say what is refused of a sweep before it is run: what cannot be written or drawn then."""

    def check(task: Task, cases: Design) -> None:
        from orchestration.sweeps.run import check_memory
        from orchestration.sweeps.sensitivity.analysis import check_picture

        if out is None or out.suffix.lower() != _ZARR:
            check_memory(task, cases)
        if plot is not None:
            check_picture(plot, cases.kind, task.keep)

    return check


def _finish(data: xarray.Dataset, out: Path | None, folder: Path | None, plot: Path | None) -> None:
    """Say what a sweep comes to, write it and draw it."""
    from orchestration.reporting import console
    from orchestration.sweeps import picture
    from orchestration.sweeps.sensitivity.analysis import analysis_of, together

    analysis = analysis_of(data.attrs["design"])
    shown, whole = data, data
    draw: Callable[[xarray.Dataset, Path], None] = picture.draw
    try:
        if analysis is not None:
            shown, draw = analysis.analyse(data), analysis.draw
            console.out.print(analysis.table(shown))
            whole = together(data, shown)
    finally:  # cases are kept where there is nothing to be said of them
        if out is not None:
            _keep(whole, out, folder)
    if plot is not None:
        draw(shown, plot)
        console.wrote(plot)


def _of_options(
    model: str,
    over: list[str],
    runtime: str,
    effects: list[str],
    settings: list[str],
    preset: str | None,
    what: dict[str, Any],
) -> Callable[..., xarray.Dataset]:
    """Say what is run as options do."""
    from orchestration.api.sweeping import sweep as work
    from orchestration.cli.models import open_model
    from orchestration.reporting.console import note
    from orchestration.sweeps.fitted import read_fitted
    from orchestration.sweeps.reductions import KEPT
    from orchestration.sweeps.sensitivity import tornado

    opened, fitted = open_model(model, runtime, effects), what.pop("fitted")
    fit = None if fitted is None else read_fitted(fitted, opened)
    named: dict[str, Any] = _named(over) if fit is None else _drawn(fit, over, what)
    what["keep"] = [*KEPT] if what["keep"] is None else what["keep"]
    # what is swept goes through its values whatever a preset has for it
    kept = what["kind"] == tornado.KIND  # where the others stay meanwhile
    usual = {
        name: value
        for name, value in opened.settings([], preset).items()
        if kept or name not in named
    }
    given = usual | opened.settings(settings)
    for line in [] if fit is None else fit.differences(given):
        note(line)
    return lambda **how: work(opened, named, settings=given, **what, **how)


def _drawn(fit: Fitted, over: list[str], what: dict[str, Any]) -> dict[str, Any]:
    """Draw parameters from a fit in place of those that options name, and keep traces, which bands are of."""
    from orchestration.sweeps.reductions import TRACE
    from orchestration.sweeps.sensitivity.bands import KIND

    if over or what["kind"] != "grid":
        raise UserError(
            f"--fitted {fit.path}: parameters are drawn from it; leave out --over and --design"
        )
    drawn = fit.draws(what["samples"], what["seed"])
    what.update(kind=KIND, samples=None, keep=[TRACE] if what["keep"] is None else what["keep"])
    return drawn


def _of_file(path: Path) -> Callable[..., xarray.Dataset]:
    """Say what is run as a file does."""
    from orchestration.api.sweeping import sweep_file
    from orchestration.reporting.console import note

    return lambda **how: sweep_file(path, note=note, **how)


_BESIDE_FILE = (
    "context",
    "model",
    "engine",
    "workers",
    "scheduler",
    "out",
    "plot",
    "isolate",
    "step_timeout",
    "memory_limit",
)


def _refuse_beside_file(context: typer.Context) -> None:
    """Refuse options about what is run where a file says it."""
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if (
            parameter.name not in _BESIDE_FILE
            and source is not None
            and source.name == "COMMANDLINE"
        ):
            raise UserError(f"{parameter.opts[0]}: the file says what is run; change it there")


def _named(over: list[str]) -> dict[str, str]:
    named: dict[str, str] = {}
    for text in over:
        name, equals, values = (part.strip() for part in text.partition("="))
        if not equals:
            raise UserError(f"--over {text!r}: write name=from..to:count or name=value, value, ...")
        if name in named:
            raise UserError(f"--over names {name} twice")
        named[name] = values
    return named


def _keep(data: xarray.Dataset, out: Path, parts: Path | None) -> None:
    """Write the result, and only then remove the parts that it was made of: they are nowhere else."""
    from orchestration.experiment import results
    from orchestration.reporting.console import wrote
    from orchestration.sweeps.storage import journal, stored
    from orchestration.sweeps.storage.lock import held

    with nullcontext() if parts is None else held(parts):
        (stored if out.suffix.lower() == _ZARR else results).write(data, out)
        if parts is not None:
            journal.remove(parts)
    wrote(out)


def _show(data: xarray.Dataset) -> None:
    """Print what each number comes to over all cases, and how many failed."""
    import numpy as np

    from orchestration.reporting.console import note, out, plain_table
    from orchestration.sweeps.storage.traces import pieces

    cases = int(np.prod([data.sizes[d] for d in data.dims if d != "time"]))
    out.print(f"{data.attrs['model']}: {cases:,} cases, {_RAN[data.attrs['engine']]}")
    columns = ("smallest", "largest")
    table = plain_table(None, "over all cases", *columns, "unit", right=columns)
    for name, array in data.items():
        if name == "failure":
            continue
        ends = [
            (np.fmin.reduce(part, axis=None), np.fmax.reduce(part, axis=None))
            for part in pieces(array)
        ]
        smallest, largest = (
            np.fmin.reduce([low for low, _ in ends]),
            np.fmax.reduce([high for _, high in ends]),
        )
        if np.isfinite(smallest):
            table.add_row(str(name), f"{smallest:.6g}", f"{largest:.6g}", array.units)
    out.print(table)
    if "failure" in data:
        reasons = data["failure"].values.ravel()
        failed = reasons[reasons != ""]
        note(f"{len(failed)} cases failed; the first: {failed[0]}")
