"""``ppy sweep``: a model over many values of its parameters."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmus.kit.errors import UserError
from orchestration.cli.options import Model, Picture, Preset, Runtime, Set, Step, Stop, With, comma_list, option
from orchestration.cli.outputs import Outputs

if TYPE_CHECKING:
    import xarray

_NETCDF = (".nc",)


def sweep(
    model: Model,
    over: Annotated[
        list[str],
        typer.Option(
            "--over",
            metavar="NAME=FROM..TO:COUNT",
            help="What a parameter, or an input that is held, goes through: R1=0.3..0.7:41, C=1e-3..1e-1:7 log, "
            "k1=6.3N/mm, 9N/mm; R1=0.3..0.7 for a design that chooses the values. Repeatable.",
        ),
    ],
    design: Annotated[
        str,
        typer.Option("--design", help="grid, list (first values together, then second ones), latin-hypercube, sobol."),
    ] = "grid",
    samples: Annotated[int | None, option("--samples", metavar="N", help="Cases of the last two.")] = None,
    seed: Annotated[int, typer.Option("--seed", help="Of the last two.")] = 0,
    outputs: Annotated[str | None, option("--outputs", help="Which outputs are kept, e.g. voltage,charge.")] = None,
    keep: Annotated[
        str, typer.Option("--keep", help="What of each: last, smallest, largest, mean, rms, trace (all of it).")
    ] = "last,smallest,largest",
    effects: With = None,
    settings: Set = None,
    preset: Preset = None,
    stop: Stop = None,
    step: Step = None,
    engine: Annotated[
        str,
        typer.Option("--engine", help="auto, fmu, or compiled: the equations of a component, faster, same numbers."),
    ] = "auto",
    workers: Annotated[int, typer.Option("--workers", metavar="N", help="Processes that run cases.")] = 1,
    out: Annotated[
        Path | None,
        option("--out", metavar="FILE", help="Result with units (.nc). Interrupted, the same command goes on."),
    ] = None,
    plot: Picture = None,
    runtime: Runtime = "native",
) -> None:
    """Run a component or any FMU over many values of its parameters."""
    from orchestration.api.sweeping import sweep as work
    from orchestration.cli.models import model_file, open_model
    from orchestration.reporting import pictures
    from orchestration.reporting.console import progress, wrote
    from orchestration.sweeps import picture

    Outputs(
        {"the model": model_file(model)}, {"--out": out, "--plot": plot}, {"--out": _NETCDF, "--plot": pictures.FORMATS}
    ).check()
    opened = open_model(model, runtime, comma_list(effects))
    named, folder = _named(over), out and out.with_name(f"{out.name}.part")
    # what is swept goes through its values whatever a preset has for it
    usual = {name: value for name, value in opened.settings([], preset).items() if name not in named}
    with progress() as tell:
        tell(f"sweeping {opened.title}")
        data = work(
            opened, named, stop=stop, step=step, settings=usual | opened.settings(settings or []), kind=design,
            samples=samples, seed=seed, outputs=comma_list(outputs), keep=comma_list(keep), engine=engine,
            workers=workers,
            folder=folder, progress=tell.done,
        )  # fmt: skip
    _show(data)
    if out is not None:
        _keep(data, out, folder)
    if plot is not None:
        picture.draw(data, plot)
        wrote(plot)


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

    results.write(data, out)
    if parts is not None:
        shutil.rmtree(parts, ignore_errors=True)
    wrote(out)


def _show(data: xarray.Dataset) -> None:
    """Print what each number comes to over all cases, and how many failed."""
    import numpy as np

    from orchestration.reporting.console import note, out, plain_table

    cases = int(np.prod([data.sizes[d] for d in data.dims if d != "time"]))
    out.print(f"{data.attrs['model']}: {cases:,} cases")
    columns = ("smallest", "largest")
    table = plain_table(None, "over all cases", *columns, "unit", right=columns)
    for name, array in data.items():
        if name != "failure" and bool(np.isfinite(array).any()):
            table.add_row(str(name), f"{float(array.min()):.6g}", f"{float(array.max()):.6g}", array.units)
    out.print(table)
    if "failure" in data:
        reasons = data["failure"].values.ravel()
        failed = reasons[reasons != ""]
        note(f"{len(failed)} cases failed; the first: {failed[0]}")
