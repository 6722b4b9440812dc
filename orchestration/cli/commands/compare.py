"""``ppy compare``: a model against a record, recalibrated if wanted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmus.kit.errors import UserError
from orchestration.cli.isolation import Isolate, isolating
from orchestration.cli.options import (
    DEFAULT_MODEL,
    Json,
    Map,
    ModelOption,
    Picture,
    Preset,
    Record,
    Runtime,
    Set,
    With,
    comma_list,
    option,
)
from orchestration.cli.outputs import JSON, Outputs, standard_output_for, write_json

if TYPE_CHECKING:
    from orchestration.identify.comparison import Comparison


def compare(
    context: typer.Context,
    record: Record,
    model: ModelOption = DEFAULT_MODEL,
    effects: With = None,
    mapping: Map = None,
    settings: Set = None,
    preset: Preset = None,
    fit: Annotated[
        str | None, option("--fit", help="Parameters to recalibrate, e.g. R1,R2,C.")
    ] = None,
    out: Annotated[
        Path | None, option("--out", metavar="FILE", help="The figures as JSON (.json).")
    ] = None,
    result: Json = None,
    plot: Picture = None,
    runtime: Runtime = "native",
    isolate: Isolate = None,
) -> None:
    """Hold a model against a measured record: fit in percent, RMS error, whiteness; recalibrate with --fit."""
    context.with_resource(isolating(isolate))
    from orchestration.cli.models import check_inputs, model_file, note_neutral, open_model
    from orchestration.identify import comparison as work
    from orchestration.records import parse_mapping
    from orchestration.reporting import pictures
    from orchestration.reporting.console import progress, tell_repairs, wrote

    names = comma_list(fit, "--fit")
    if fit is not None and not names:
        raise UserError(f"--fit {fit!r}: name the parameters to recalibrate, e.g. R1,R2,C")
    Outputs(
        {"the record": record, "the model": model_file(model)},
        {"--out": out, "--json": result, "--plot": plot},
        {"--out": JSON, "--json": JSON, "--plot": pictures.FORMATS},
    ).check()
    opened = open_model(model, runtime, comma_list(effects, "--with"))
    parameters = opened.settings(settings or [], preset)
    data = work.read_for(opened, record, parse_mapping(mapping or []))
    tell_repairs(data.repairs)
    check_inputs(opened, data.signals, parameters)
    if names:
        note_neutral(opened, parameters)
    with progress() as tell:
        comparison = work.compare(opened, data, parameters, names, tell)
    with standard_output_for(result):
        show(comparison)
        figures = comparison.to_dict() | ({"with": list(opened.effects)} if opened.effects else {})
        for path in (out, result):
            write_json(path, figures)
        if plot is not None:
            comparison.plot(plot)
            wrote(plot)


def show(comparison: Comparison) -> None:
    """Print a comparison: fit per output, and the fitted parameters with their intervals."""
    from orchestration.identify.presentation import overview
    from orchestration.reporting.console import out, warn

    out.print(overview(comparison))
    for warning in comparison.fit.all_warnings if comparison.fit else ():
        warn(warning)
