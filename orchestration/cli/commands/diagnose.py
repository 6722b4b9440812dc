"""``ppy diagnose`` as it is called: what it takes, and whether it is about one model or about a system."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from orchestration.cli.isolation import Isolate, isolating
from orchestration.cli.options import (
    DEFAULT_MODEL,
    Json,
    Map,
    Platforms,
    Set,
    With,
    comma_list,
    complete_components,
    complete_effects,
    option,
    platform_list,
    seconds,
)
from orchestration.cli.outputs import standard_output_for

Model = Annotated[
    str | None,
    option(
        "--model",
        metavar="MODEL",
        help="A component (see ppy list), path/to/file.py:Class, or any FMU; default ppy_actuator.",
        autocompletion=complete_components,
    ),
]
Effects = Annotated[
    str | None,
    option(
        "--effects",
        help="Only these, e.g. diffusion,sensor_lag(voltage); none only recalibrates; families: all that is known and "
        "what fits the model's laws by their units, e.g. dead_zone(voltage), the default where its file lists none.",
        autocompletion=complete_effects,
    ),
]
Interpolate = Annotated[
    bool | None,
    typer.Option(
        "--interpolate/--no-interpolate",
        help="Inputs go smoothly between samples, or are held; default what the record tells.",
    ),
]
Hold = Annotated[
    str | None,
    option("--hold", help="Parameters that are known and not fitted, e.g. mass,R1; see --set."),
]
Records = Annotated[
    list[Path],
    typer.Argument(
        metavar="RECORD...",
        help="Measured records: CSV, Parquet, TDMS, MAT or LabVIEW text. Several have one set of parameters.",
    ),
]
Runs = Annotated[
    str | None,
    option(
        "--runs",
        metavar="COLUMN",
        help="Column that tells the records in a file apart; else a clock that restarts.",
    ),
]
Each = Annotated[
    str | None, option("--each", help="Parameters that differ from record to record, e.g. ocv,R0.")
]
Compare = Annotated[
    Path | None,
    option(
        "--compare", metavar="AFTER", help="A later record of the specimen: what changed in it."
    ),
]
Holdout = Annotated[
    list[str] | None,
    option(
        "--holdout",
        metavar="RECORD",
        help="A record to judge by, or labels such as 7,8,9 of some of several; default the last third. Repeatable.",
    ),
]
Time = Annotated[
    float | None,
    option(
        "--time",
        metavar="TIME",
        help="For each search, e.g. 60s, 5min or inf; then the best answer so far. Default 60 s for 60,000 samples or "
        "less, and in proportion beyond.",
        parser=seconds,
    ),
]
NoLaws = Annotated[
    bool,
    typer.Option(
        "--no-laws",
        help="Leave out asking every law of the model what it lacks, where something is left.",
    ),
]
Report = Annotated[
    Path | None, option("--report", help="Page (.html) with all of it, to look at and pass on.")
]
Fmu = Annotated[
    Path | None,
    option("--fmu", help="The extended model as FMU: F.fmu (native) and F.python.fmu beside it."),
]
Fit = Annotated[
    str | None,
    option("--fit", help="Parameters of an FMU without equations that are fitted too, e.g. p1,p2."),
]
Ssp = Annotated[
    Path | None,
    option(
        "--ssp", metavar="S.ssp", help="An FMU without equations with its correction, as a system."
    ),
]
Experiment = Annotated[
    Path | None,
    option(
        "--experiment", help="Experiment (.toml) that would tell alternatives apart, for ppy run."
    ),
]
System = Annotated[
    Path | None,
    option(
        "--system",
        metavar="S.ssp",
        help="Judge every member of a system alone, cut where it was measured.",
    ),
]


def diagnose(
    context: typer.Context,
    records: Records,
    model: Model = None,
    laid_over: With = None,
    mapping: Map = None,
    settings: Set = None,
    effects: Effects = None,
    interpolate: Interpolate = None,
    hold: Hold = None,
    fit: Fit = None,
    runs: Runs = None,
    each: Each = None,
    compare: Compare = None,
    holdout: Holdout = None,
    time: Time = None,
    no_laws: NoLaws = False,
    result: Json = None,
    report: Report = None,
    fmu: Fmu = None,
    ssp: Ssp = None,
    platforms: Platforms = None,
    experiment: Experiment = None,
    system: System = None,
    isolate: Isolate = None,
) -> None:
    """Name what a model gets wrong on a record, extend it, and measure the gain on data it has not seen."""
    context.with_resource(isolating(isolate))
    if system is not None:
        from orchestration.cli import diagnose_system

        others = {
            "--model": model,
            "--with": laid_over,
            "--effects": effects,
            "--interpolate": interpolate,
            "--hold": hold,
            "--fit": fit,
            "--ssp": ssp,
            "--runs": runs,
            "--each": each,
            "--compare": compare,
            "--holdout": holdout,
            "--time": time,
            "--no-laws": no_laws or None,
            "--report": report,
            "--fmu": fmu,
            "--platforms": platforms,
            "--experiment": experiment,
            "a second record": records[1:] or None,
        }
        with standard_output_for(result):
            diagnose_system.run(records[0], system, mapping or [], settings or [], result, others)
        return
    from orchestration.cli import diagnose as one_model

    files = one_model.Files(
        records,
        holdout or (),
        result,
        report,
        fmu,
        experiment,
        platform_list(platforms),
        compare,
        ssp=ssp,
    )
    named = comma_list(effects, "--effects")
    considered = None if not named else [] if named == ["none"] else named
    with standard_output_for(result):
        one_model.run(
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
            not no_laws,
            comma_list(fit, "--fit"),
        )
