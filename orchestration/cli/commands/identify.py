"""``ppy identify``: parameters of a model from a record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fmus.kit.errors import UserError
from orchestration.cli.commands.compare import show
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


def identify(
    record: Record,
    fit: Annotated[str, option("--fit", help="Parameters, e.g. R1,R2,C.")],
    model: ModelOption = DEFAULT_MODEL,
    effects: With = None,
    mapping: Map = None,
    settings: Set = None,
    preset: Preset = None,
    workers: Annotated[
        int, typer.Option("--workers", metavar="N", min=1, help="Processes that run an FMU without equations.")
    ] = 1,
    ssv: Annotated[
        Path | None, option("--ssv", metavar="FILE", help="The values as a parameter set (.ssv), for any system.")
    ] = None,
    result: Json = None,
    plot: Picture = None,
) -> None:
    """Identify parameters of a component or any FMU from a record: values, intervals, and a file to bind them."""
    from orchestration.cli.models import check_inputs, model_file, note_neutral, open_model
    from orchestration.identify import comparison as work
    from orchestration.identify import parameter_set
    from orchestration.records import parse_mapping
    from orchestration.reporting import pictures
    from orchestration.reporting.console import progress, tell_repairs, wrote

    names = comma_list(fit)
    if not names:
        raise UserError(f"--fit {fit!r}: name the parameters, e.g. R1,R2,C")
    Outputs(
        {"the record": record, "the model": model_file(model)},
        {"--ssv": ssv, "--json": result, "--plot": plot},
        {"--ssv": (".ssv",), "--json": JSON, "--plot": pictures.FORMATS},
    ).check()
    opened = open_model(model, "native", comma_list(effects))
    parameters = opened.settings(settings or [], preset)
    data = work.read_for(opened, record, parse_mapping(mapping or []))
    tell_repairs(data.repairs)
    check_inputs(opened, data.signals, parameters)
    note_neutral(opened, parameters)
    with progress() as tell:
        found = work.compare(opened, data, parameters, names, tell, workers)
    with standard_output_for(result):
        show(found)
        write_json(result, found.to_dict())
        if ssv is not None:
            assert found.fit is not None
            doc = f"identified from {found.record.source.name} for {found.model.title}"
            parameter_set.write(ssv, found.fit.values, found.model.parameters, doc)
            wrote(ssv)
        if plot is not None:
            found.plot(plot)
            wrote(plot)
