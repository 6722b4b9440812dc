"""``ppy run``: an experiment made, or one made again and compared bit by bit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fmus.kit.errors import UserError
from fmus.kit.files import is_file
from orchestration.cli.isolation import Isolate, MemoryLimit, StepTimeout, hearing_ctrl_c, limits
from orchestration.cli.options import Json, complete_experiments, option, seconds
from orchestration.cli.outputs import JSON, SIGNALS, Outputs, standard_output_for, write_json
from orchestration.cli.real_time import Options, keep, status_line

if TYPE_CHECKING:
    import xarray

    from orchestration.experiment.live import Live
    from orchestration.experiment.model import Experiment
    from orchestration.fmu.isolation.limits import Limits


def run(
    experiment: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME|FILE.toml|RESULT",
            help="One of --list, a file, or a result to make again.",
            autocompletion=complete_experiments,
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        option(
            "--set",
            metavar="KEY=VALUE",
            help="Over the file: duration=20s, R1=610mohm, inputs.current.value=1.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        option(
            "--out", metavar="FILE", help="Result: .nc, .parquet (both can be run again) or .csv."
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        option("--plot", metavar="FILE", help="Picture (.png, .svg, .pdf) or page (.html)."),
    ] = None,
    result: Json = None,
    runtime: Annotated[
        str | None, option("--runtime", help="Which build of components to run: native, python.")
    ] = None,
    real_time: Annotated[
        bool,
        typer.Option(
            "--real-time", help="Keep pace with the clock, as a rig does, and tell how well."
        ),
    ] = False,
    missed: Annotated[
        str | None,
        option(
            "--missed", metavar="WHAT", help="What a missed deadline does: warn (default) or stop."
        ),
    ] = None,
    lag: Annotated[
        float | None,
        option(
            "--lag",
            metavar="TIME",
            help="Lag beyond which the run stops in any case; default 1 s.",
            parser=seconds,
        ),
    ] = None,
    processor: Annotated[
        int | None, option("--cpu", metavar="N", help="The only processor to run on.")
    ] = None,
    priority: Annotated[
        bool, typer.Option("--priority", help="Ask for a higher priority.")
    ] = False,
    isolate: Isolate = None,
    step_timeout: StepTimeout = None,
    memory_limit: MemoryLimit = None,
    show_list: Annotated[
        bool, typer.Option("--list", help="List the experiments that ship.")
    ] = False,
) -> None:
    """Run an experiment: one of the thesis's by name, a TOML file, or a result again, bit by bit."""
    if show_list:
        _list()
        return
    if experiment is None:
        raise UserError(
            "ppy run needs the name or the file of an experiment (ppy run --list shows what there is)"
        )
    live = Options(real_time, missed, lag, processor, priority).live(out)

    def isolation(foreign: bool) -> Limits | None:
        return limits(foreign and live is None, isolate, step_timeout, memory_limit)

    heard = hearing_ctrl_c(None) if isolate is False and live is None else nullcontext()
    with standard_output_for(result), heard:
        data, reproduced = _run(
            experiment, settings or [], runtime, out, plot, result, live, isolation
        )
    if "failure" in data.attrs:
        raise UserError(data.attrs["failure"])
    if not data.attrs["complete"]:
        raise KeyboardInterrupt
    if not reproduced:
        raise typer.Exit(1)


def _list() -> None:
    import tomllib

    from orchestration.experiment.library import shipped

    width = max(map(len, shipped()))
    for name, path in shipped().items():
        print(f"{name:{width}}  {tomllib.loads(path.read_text(encoding='utf-8'))['title']}")


def _run(
    name: str,
    settings: Sequence[str],
    runtime: str | None,
    out: Path | None,
    plot: Path | None,
    result: Path | None,
    live: Live | None,
    isolation: Callable[[bool], Limits | None],
) -> tuple[xarray.Dataset, bool]:
    """Run an experiment; return what it delivered, and whether every bit is that of the result it was."""
    from orchestration.experiment import result_page, results
    from orchestration.experiment.reading import files, movable, read
    from orchestration.reporting import pictures
    from orchestration.reporting.console import note, wrote

    source = Path(name)
    is_result = is_file(source) and source.suffix.lower() != ".toml"
    chosen = [*settings, *([f"runtime={runtime}"] if runtime else [])]
    wanted = read(name, chosen)
    reads = {"result" if is_result else "experiment": source} | files(wanted)
    Outputs(
        {f"the {what}": path for what, path in reads.items()},
        {"--out": out, "--plot": plot, "--json": result},
        {"--out": SIGNALS, "--plot": (*pictures.FORMATS, ".html"), "--json": JSON},
    ).check()
    earlier = results.read(source) if is_result and not chosen else None
    if earlier is not None and not earlier.attrs["complete"]:
        note(f"{name} is incomplete; it is repeated as far as it goes, {wanted.duration:g} s")
    data = _make(wanted, name, out, live, isolation)
    _show(data)
    if out is not None:
        if live is None:
            results.write(movable(data, out.parent), out)
        else:
            keep(data, out, live)
        wrote(out, "" if data.attrs["complete"] else "incomplete")
    if plot is not None:
        result_page.plot(data, plot)
        wrote(plot)
    differences = None if earlier is None else _compare(data, earlier, name)
    write_json(result, _as_json(data, name if earlier is not None else None, differences))
    return data, not differences


def _make(
    wanted: Experiment,
    name: str,
    out: Path | None,
    live: Live | None,
    isolation: Callable[[bool], Limits | None],
) -> xarray.Dataset:
    """Run an experiment, telling how far it is."""
    from orchestration.experiment import results
    from orchestration.experiment.run import run as make
    from orchestration.reporting.console import err, note, progress

    def fits(sketch: xarray.Dataset) -> None:
        if out is not None:
            results.check(sketch, out)

    if (
        live is not None
    ):  # no bar: what draws it is a thread, and takes its time when the next step should begin
        err.print(
            f"running {name} in real time (FMUs that are not in the cache are built first)",
            soft_wrap=True,
        )
        until = f"until {out} is written, what is recorded goes to {live.journal}"
        note("without --out nothing is kept" if out is None else until)
        with status_line(live) as telling:
            return make(wanted, name, note=note, fits=fits, live=telling, isolation=isolation)
    with progress() as tell:
        tell(f"running {name} (FMUs that are not in the cache are built first)")
        return make(wanted, name, tell.done, note, fits, isolation=isolation)


def _show(data: xarray.Dataset) -> None:
    from orchestration.experiment import result_page
    from orchestration.reporting.console import out, plain_table

    columns = ("smallest", "largest", "last")
    table = plain_table(None, "signal", *columns, right=columns)
    for row in result_page.extremes(data):
        table.add_row(*row)
    out.print(result_page.state(data))
    if "deadlines" in data.attrs:
        out.print(result_page.pace(data))
    out.print(table)


def _compare(data: xarray.Dataset, earlier: xarray.Dataset, name: str) -> Mapping[str, float]:
    """Tell whether a result was made again bit by bit, and if not, how far it is off and why that may be."""
    import json

    from orchestration.experiment import results
    from orchestration.reporting.console import note, out, warn

    then, now = (json.loads(made.attrs["guids"]) for made in (earlier, data))
    for member in now:
        if then.get(member) != now[member]:
            warn(
                f"{name} was made with another build of {member} ({then.get(member)}, now {now[member]})"
            )
    differences = results.differences(data, earlier)
    if not differences:
        out.print(f"every value is the same to the last bit as in {name}")
    for signal, difference in differences.items():
        unit = data[signal].units if signal in data else ""
        out.print(f"not as in {name}: {signal} differs by up to {difference:.3g} {unit}")
    if earlier.attrs["versions"] != data.attrs["versions"]:
        note(f"{name} was made with {earlier.attrs['versions']}; here is {data.attrs['versions']}")
    return differences


def _as_json(
    data: xarray.Dataset, again: str | None, differences: Mapping[str, float] | None
) -> dict[str, Any]:
    """Gather what was run and the extremes of every signal, in the unit beside them."""
    import json

    about = data.attrs
    return {
        "subject": about["subject"],
        "title": about["title"],
        "complete": bool(about["complete"]),
        "points": int(data.time.size),
        "seconds": float(data.time[-1]),
        "guids": json.loads(about["guids"]),
        "signals": {
            str(name): {
                "unit": signal.units,
                "role": signal.role,
                "smallest": float(signal.min()),
                "largest": float(signal.max()),
                "last": float(signal[-1]),
            }
            for name, signal in data.items()
        },
        "again": None
        if differences is None
        else {"of": again, "same": not differences, "apart": dict(differences)},
    }
