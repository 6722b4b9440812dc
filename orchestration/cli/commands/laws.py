"""``ppy laws``: what it takes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from orchestration.cli.commands.diagnose import (
    Each,
    Hold,
    Holdout,
    Interpolate,
    Model,
    Records,
    Report,
    Runs,
    Time,
)
from orchestration.cli.options import (
    DEFAULT_MODEL,
    Json,
    Map,
    Platforms,
    Set,
    With,
    comma_list,
    complete_effects,
    option,
    platform_list,
)
from orchestration.cli.outputs import standard_output_for

Effects = Annotated[
    str | None,
    option(
        "--effects",
        help="Looked for before the laws are asked, and part of the model then if named, e.g. diffusion; families is "
        "all that is known; default none.",
        autocompletion=complete_effects,
    ),
]
EffectOut = Annotated[
    Path | None,
    option(
        "--effect-out", metavar="F.py", help="The best correction as a class to lay over the model."
    ),
]
Fmu = Annotated[
    Path | None,
    option("--fmu", help="The corrected model as FMU: F.fmu (native) and F.python.fmu beside it."),
]


def laws(
    records: Records,
    model: Model = None,
    laid_over: With = None,
    mapping: Map = None,
    settings: Set = None,
    effects: Effects = None,
    interpolate: Interpolate = None,
    hold: Hold = None,
    runs: Runs = None,
    each: Each = None,
    holdout: Holdout = None,
    time: Time = None,
    result: Json = None,
    report: Report = None,
    effect_out: EffectOut = None,
    fmu: Fmu = None,
    platforms: Platforms = None,
) -> None:
    """Ask every law of a model what it lacks on a record: which signal it hangs on besides, and by which curve."""
    from orchestration.cli import laws as asking
    from orchestration.cli.diagnose import Files

    named = comma_list(effects, "--effects")
    considered = [] if named in ([], ["none"]) else named
    files = Files(
        records,
        holdout or (),
        result,
        report,
        fmu,
        platforms=platform_list(platforms),
        effect=effect_out,
    )
    with standard_output_for(result):
        asking.run(
            files,
            model or DEFAULT_MODEL,
            mapping or [],
            settings or [],
            considered,
            ["ppy", *sys.argv[1:]],
            comma_list(hold, "--hold"),
            interpolate,
            comma_list(laid_over, "--with"),
            time,
            runs,
            comma_list(each, "--each"),
        )
