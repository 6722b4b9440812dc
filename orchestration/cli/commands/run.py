"""``ppy run``: an experiment or a system run, or one made again and compared bit for bit."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError
from orchestration.cli.command import command, refuse
from orchestration.cli.commands.options import RunCommand
from orchestration.cli.experiments import raise_if_incomplete, run_and_write
from orchestration.cli.isolation import hearing_ctrl_c
from orchestration.cli.outputs import PICTURE, SIGNALS, check_outputs, write_json
from orchestration.cli.real_time import live_run, tuned
from orchestration.cli.regression import as_json, cases, show, write
from orchestration.cli.verdicts import Case, conclude
from orchestration.reporting.console import note, out, warn

if TYPE_CHECKING:
    import xarray

    from orchestration.experiment.live import Live
    from orchestration.experiment.regression import Regression, Tolerance


@command(RunCommand)
def run(options: RunCommand) -> None:
    """Run an experiment, a system, or a result again, and compare that with it bit for bit.

    With --tolerance the result made again may differ by so much. Exit status 1 if it differs by
    more, 2 if it could not be made. A system (.ssp) runs over its own default experiment; --set
    inputs.NAME=VALUE drives an input.
    """
    if options["show_list"]:
        _list_experiments()
        return
    experiment = options["experiment"]
    if experiment is None:
        raise UserError(
            "ppy run needs the name or the file of an experiment (ppy run --list shows what"
            " there is)"
        )
    live = live_run(options, options["out"])
    without_isolation = options["isolate"] is False and live is None
    # in this process an FMU that hangs keeps Python from hearing Ctrl-C
    ctrl_c_watch = hearing_ctrl_c(None) if without_isolation else nullcontext()
    with ctrl_c_watch, tuned(live, options):
        data, regression = _run(experiment, options, live)
    raise_if_incomplete(data, live)
    judged = [Case(experiment, "runs")] if regression is None else cases(regression)
    conclude("ppy run", judged, options["junit"])


def _list_experiments() -> None:
    import tomllib

    from orchestration.experiment import shipped

    width = max(map(len, shipped()))
    for name, path in shipped().items():
        print(f"{name:{width}}  {tomllib.loads(path.read_text(encoding='utf-8'))['title']}")


def _run(
    name: str, options: RunCommand, live: Live | None
) -> tuple[xarray.Dataset, Regression | None]:
    """Run an experiment; return its result, and the comparison with an earlier one if there is."""
    from orchestration.experiment import read, results
    from orchestration.experiment.reading import files, is_result

    source = Path(name)
    chosen = [*options["settings"]]
    if options["runtime"]:
        chosen.append(f"runtime={options['runtime']}")
    experiment = read(name, chosen)
    made_again = is_result(source)
    reads = {"result" if made_again else "experiment": source} | files(experiment)
    roles = {f"the {role}": path for role, path in reads.items()}
    check_outputs(options, roles, out=SIGNALS, plot=(*PICTURE, ".html"))
    earlier = results.read(source) if made_again and not chosen else None
    if earlier is None:
        reason = "is for a result that is made again, without --set"
        refuse(RunCommand, options, reason, ("tube", "report"))
    if earlier is not None and not earlier.attrs["complete"]:
        note(f"{name} is incomplete; it is repeated as far as it goes, {experiment.duration:g} s")
    data = run_and_write(experiment, name, options, live)
    regression = None if earlier is None else _compare(data, earlier, name, options["tube"])
    if regression is not None:
        write(regression, options["report"])
    write_json(options["json"], _as_json(data, regression))
    return data, regression


def _compare(
    data: xarray.Dataset,
    earlier: xarray.Dataset,
    name: str,
    tolerances: Mapping[str, Tolerance] | None,
) -> Regression:
    """Compare a result with an earlier one; print the differences and their possible reasons."""
    import json

    from orchestration.experiment import results
    from orchestration.experiment.regression import compare

    then, now = (json.loads(made.attrs["guids"]) for made in (earlier, data))
    for member in now:
        if then.get(member) != now[member]:
            warn(
                f"{name} was made with another build of {member} ({then.get(member)}, now"
                f" {now[member]})"
            )
    made, known = results.as_record(data, "this run"), results.as_record(earlier, name)
    regression = compare(made, known, tolerances or {})
    if tolerances is None and not regression.refused:
        out.print(f"every value is the same to the last bit as in {name}")
    else:
        show(regression)
    if earlier.attrs["versions"] != data.attrs["versions"]:
        note(f"{name} was made with {earlier.attrs['versions']}; here is {data.attrs['versions']}")
    return regression


def _as_json(data: xarray.Dataset, regression: Regression | None) -> dict[str, Any]:
    """Gather the description of a run and the extremes of every signal, in its unit."""
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
        "again": None if regression is None else as_json(regression),
    }
