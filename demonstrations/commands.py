"""Commands ``ppy demo``, ``characterise``, ``thesis``, ``system cycles`` and ``rig demo``.

No ``from __future__ import annotations``, with which the options in annotations could not be read.
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, cast

from fmus.kit import UserError
from fmus.kit.extras import require
from orchestration.api.declaration import Option
from orchestration.cli.command import command
from orchestration.cli.commands.options import (
    ExperimentSettingsOption,
    IdentifyCommand,
    MeasuringOptions,
)
from orchestration.cli.options import JsonOption, RecordsArgument
from orchestration.cli.outputs import check_outputs, typed_command, write_json

if TYPE_CHECKING:
    from demonstrations.thesis import Claim

_THESIS = ("control", "matplotlib")
_DEMO = (*_THESIS, "threadpoolctl")
_RIG_DEMO = ("matplotlib", "psutil", "threadpoolctl", "zmq")


class DemoCommand(TypedDict, total=False):
    """Options of ``ppy demo``."""

    out: Annotated[
        Path,
        Option(
            "Folder for FMUs, pictures, the record and the report.", default=Path("demo-output")
        ),
    ]


class CharacteriseCommand(RecordsArgument, MeasuringOptions, JsonOption, total=False):
    """Options of ``ppy characterise``."""

    out: Annotated[
        Path,
        Option(
            "Folder for parameters, README and page; its name is the specimen's.",
            default=Path("specimen"),
            metavar="FOLDER",
        ),
    ]


class PageOption(TypedDict, total=False):
    """Path of the page of the thesis."""

    out: Annotated[
        Path,
        Option("Page or its folder.", default=Path("thesis.html"), metavar="FOLDER_OR_HTML"),
    ]


class ThesisCommand(PageOption, JsonOption, total=False):
    """Options of ``ppy thesis``."""


class CyclesCommand(ExperimentSettingsOption, JsonOption, total=False):
    """Options of ``ppy system cycles``."""

    experiment: Annotated[
        str,
        Option(
            "An experiment on a system, with a work loop.",
            default="work_loop",
            metavar="NAME|FILE.toml",
            complete="experiment",
            argument=True,
        ),
    ]


class RigDemoCommand(TypedDict, total=False):
    """Options of ``ppy rig demo``."""

    out: Annotated[
        Path,
        Option("Folder for all output.", default=Path("hil-output"), metavar="FOLDER"),
    ]
    seed: Annotated[
        int, Option("Seed of the emulated rig and its hidden effect.", default=1, least=0)
    ]


@command(DemoCommand)
def demo(options: DemoCommand) -> None:
    """Do everything once: build, simulate, compare with an emulated rig, diagnose, report."""
    require(*_DEMO)
    from demonstrations.demo import everything as work

    check_outputs({}, folder=options["out"])
    work.run(options["out"])


@command(CharacteriseCommand)
def characterise(options: CharacteriseCommand) -> None:
    """Characterise an actuator by its tests: records, or a folder of them (thesis chapter 3)."""
    from demonstrations.characterise import WRITTEN, write_files
    from demonstrations.characterise import characterise as work
    from orchestration.cli.models import open_runs, record_files
    from orchestration.reporting.console import out, progress, wrote

    folder = options["out"]
    paths = [file for file in record_files(options) if file.name not in WRITTEN]
    if not paths:
        raise UserError(f"{', '.join(map(str, options['records']))}: there is no record in it")
    read = {f"the record {path}": path for path in paths}
    check_outputs(options, read, folder=folder)
    model, records, given = open_runs(cast("IdentifyCommand", {**options, "records": paths}))
    with progress() as tell:
        found = work(model, records, given, tell)
        tell("drawing the page")
        written = write_files(found, folder, typed_command())
    out.print(*found.overview(), sep="\n")
    for path in written:
        wrote(path)
    write_json(options["json"], found.to_dict())


@command(ThesisCommand)
def thesis(options: ThesisCommand) -> None:
    """Recompute every table and simulated figure of the thesis, and say which are wrong and why."""
    require(*_THESIS)
    from demonstrations.thesis import chapters, page

    out = options["out"]
    path = options["json"]
    check_outputs({**options, "out": page.target(out)}, out=())
    page.run(out)
    written = [
        {"title": title, "claims": [_as_json(claim) for claim in claims]}
        for title, claims in chapters.claims().items()
    ]
    errata = [
        {"number": e.number, "where": e.where, "printed": e.printed, "holds": e.holds}
        for e in chapters.errata()
    ]
    write_json(path, {"chapters": written, "errata": errata})


@command(CyclesCommand)
def cycles(options: CyclesCommand) -> None:
    """Predict, before a run, how many cycles of a work loop each limit allows.

    Either the length is held, or the loop moves with the rest length of the films, which creep. The
    limit with the fewest cycles binds first.
    """
    from demonstrations.work_loops import forecast
    from orchestration.experiment import read
    from orchestration.reporting import plain_table
    from orchestration.reporting.console import out

    name = options["experiment"]
    path = options["json"]
    check_outputs(options)
    experiment = read(name, options["settings"]).model_copy(update={"variants": {}})
    found = forecast(experiment, name)
    rows = [
        [way, limit, f"{count:g}" if math.isfinite(count) else "not reached"]
        for way, allowed in found.items()
        for limit, count in allowed.items()
    ]
    out.print(plain_table(None, "length", "limit", "cycles", right=("cycles",), rows=rows))
    for way, allowed in found.items():
        limit, count = next(iter(allowed.items()))
        out.print(f"{way}: {limit if math.isfinite(count) else 'no limit'} binds first")
    write_json(path, found)


def _as_json(claim: "Claim") -> dict[str, Any]:
    return {
        "where": claim.where,
        "what": claim.what,
        "published": claim.published,
        "reproduced": claim.reproduced,
        "unit": claim.unit or None,
        "verdict": claim.verdict,
        "difference": claim.difference,
        "reason": claim.reason or None,
        "erratum": claim.erratum,
        "from_print": claim.inferred,
    }


@command(RigDemoCommand)
def rig_demo(options: RigDemoCommand) -> None:
    """Close the loop once, in real time, on an emulated rig in which an effect is hidden."""
    require(*_RIG_DEMO)
    from demonstrations.demo import on_rig

    on_rig.run(options["out"], options["seed"])
