"""``ppy compare``: a model against a record, recalibrated if wanted."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from fmus.kit.errors import UserError
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
    record: Record,
    model: ModelOption = DEFAULT_MODEL,
    effects: With = None,
    mapping: Map = None,
    settings: Set = None,
    preset: Preset = None,
    fit: Annotated[str | None, option("--fit", help="Parameters to recalibrate, e.g. R1,R2,C.")] = None,
    out: Annotated[Path | None, option("--out", metavar="FILE", help="The figures as JSON (.json).")] = None,
    result: Json = None,
    plot: Picture = None,
    runtime: Runtime = "native",
) -> None:
    """Hold a model against a measured record: fit in percent, RMS error, whiteness; recalibrate with --fit."""
    from orchestration.cli.models import check_inputs, model_file, note_neutral, open_model
    from orchestration.identify import comparison as work
    from orchestration.records import parse_mapping
    from orchestration.reporting import pictures
    from orchestration.reporting.console import progress, tell_repairs, wrote

    names = comma_list(fit)
    if fit is not None and not names:
        raise UserError(f"--fit {fit!r}: name the parameters to recalibrate, e.g. R1,R2,C")
    Outputs(
        {"the record": record, "the model": model_file(model)},
        {"--out": out, "--json": result, "--plot": plot},
        {"--out": JSON, "--json": JSON, "--plot": pictures.FORMATS},
    ).check()
    opened = open_model(model, runtime, comma_list(effects))
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
        figures = work.to_json(comparison) | ({"with": list(opened.effects)} if opened.effects else {})
        for path in (out, result):
            write_json(path, figures)
        if plot is not None:
            work.plot(comparison, plot)
            wrote(plot)


def show(comparison: Comparison) -> None:
    """Print a comparison: fit per output, and the fitted parameters with their intervals."""
    from fmus.kit.units import shown, shown_difference
    from orchestration.reporting.console import out, plain_table, warn

    model = comparison.model
    runs = [("simulated" if comparison.after is None else "before", comparison.before)]
    runs += [("fitted", comparison.after)] if comparison.after is not None else []
    table = plain_table(None, "output", "run", "fit", "RMS error", "residual", right=("fit", "RMS error"))
    for output in comparison.before:
        for label, judged in runs:
            j = judged[output]
            residual = j.whiteness.summary() if j.whiteness else "too short to judge"
            error = shown_difference(j.rms, model.outputs[output])
            table.add_row(output, label, _percent(j.fit_percent), error, residual)
    out.print(f"{comparison.record.source.name} against {model.title}: {comparison.record.time.size} samples")
    out.print(table)
    if comparison.fit is None:
        return
    columns = ("fitted", "95 % interval", "started from")
    table = plain_table(None, "parameter", *columns, right=columns)
    for parameter, e in comparison.fit.estimates.items():
        signal = model.parameters[parameter]
        value, nominal, low, high = (shown(x, signal) for x in (e.value, e.nominal, *e.interval))
        table.add_row(parameter, value, f"{low} … {high}", nominal)
    out.print()
    out.print(table)
    for warning in comparison.fit.warnings:
        warn(warning)


def _percent(fit: float) -> str:
    return f"{fit:.2f} %" if math.isfinite(fit) else "undefined"  # of an output that was constant
