"""``ppy identify``: parameters of a model from a record."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmus.kit.errors import UserError
from orchestration.cli.commands.compare import show
from orchestration.cli.isolation import Isolate, isolating
from orchestration.cli.options import (
    DEFAULT_MODEL,
    Json,
    Map,
    ModelOption,
    Picture,
    Preset,
    Record,
    Set,
    With,
    comma_list,
    option,
)
from orchestration.cli.outputs import JSON, Outputs, standard_output_for, write_json

if TYPE_CHECKING:
    from orchestration.identify.comparison import Comparison


def identify(
    context: typer.Context,
    record: Record,
    fit: Annotated[str, option("--fit", help="Parameters, e.g. R1,R2,C.")],
    model: ModelOption = DEFAULT_MODEL,
    effects: With = None,
    mapping: Map = None,
    settings: Set = None,
    preset: Preset = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers", metavar="N", min=1, help="Processes that run an FMU without equations."
        ),
    ] = 1,
    profile: Annotated[
        str | None,
        option(
            "--profile",
            metavar="PARAMETERS",
            help="Of the fitted ones: an interval by the likelihood itself.",
        ),
    ] = None,
    profile_plot: Annotated[
        Path | None,
        option(
            "--profile-plot", metavar="FILE", help="The profiles as a picture (.png, .svg or .pdf)."
        ),
    ] = None,
    ssv: Annotated[
        Path | None,
        option(
            "--ssv", metavar="FILE", help="The values as a parameter set (.ssv), for any system."
        ),
    ] = None,
    result: Json = None,
    plot: Picture = None,
    isolate: Isolate = None,
) -> None:
    """Identify parameters of a component or any FMU from a record: values, intervals, and a file to bind them."""
    context.with_resource(isolating(isolate))
    from orchestration.cli.models import check_inputs, model_file, note_neutral, open_model
    from orchestration.identify import comparison as work
    from orchestration.records import parse_mapping
    from orchestration.reporting import pictures
    from orchestration.reporting.console import progress, tell_repairs

    names = comma_list(fit, "--fit")
    if not names:
        raise UserError(f"--fit {fit!r}: name the parameters, e.g. R1,R2,C")
    profiled = _profiled(profile, names, profile_plot)
    Outputs(
        {"the record": record, "the model": model_file(model)},
        {"--ssv": ssv, "--json": result, "--plot": plot, "--profile-plot": profile_plot},
        {
            "--ssv": (".ssv",),
            "--json": JSON,
            "--plot": pictures.FORMATS,
            "--profile-plot": pictures.FORMATS,
        },
    ).check()
    opened = open_model(model, "native", comma_list(effects, "--with"))
    parameters = opened.settings(settings or [], preset)
    data = work.read_for(opened, record, parse_mapping(mapping or []))
    tell_repairs(data.repairs)
    check_inputs(opened, data.signals, parameters)
    note_neutral(opened, parameters)
    with progress() as tell:
        found = work.compare(opened, data, parameters, names, tell, workers)
        assert found.fit is not None
        if profiled:
            tell(f"fitting again, with {', '.join(profiled)} held")
        for k, name in enumerate(profiled):
            found.fit.profile(name, partial(tell.done, k, len(profiled)))
    with standard_output_for(result):
        show(found)
        write_json(result, found.to_dict())
        _write(found, ssv, plot, profile_plot)


def _write(
    found: Comparison, ssv: Path | None, plot: Path | None, profile_plot: Path | None
) -> None:
    from orchestration.identify import parameter_set
    from orchestration.reporting.console import wrote

    assert found.fit is not None
    if ssv is not None:
        doc = f"identified from {found.record.source.name} for {found.model.title}"
        parameter_set.write(ssv, found.fit.values, found.model.parameters, doc)
        wrote(ssv)
    if plot is not None:
        found.plot(plot)
        wrote(plot)
    if profile_plot is not None:
        found.fit.plot_profiles(profile_plot)
        wrote(profile_plot)


def _profiled(text: str | None, names: list[str], plot: Path | None) -> list[str]:
    """Parameters of which a profile is wanted; refused before any work is done."""
    wanted = comma_list(text, "--profile")
    if text is not None and not wanted:
        raise UserError(
            f"--profile {text!r}: name some of the fitted parameters, {','.join(names)}"
        )
    if strange := [name for name in wanted if name not in names]:
        raise UserError(f"--profile: {strange[0]} is not fitted; --fit has {','.join(names)}")
    if plot is not None and not wanted:
        raise UserError("--profile-plot: there is nothing to draw without --profile")
    return list(dict.fromkeys(wanted))
