"""``ppy frequency``: frequency responses of a record, with intervals, and those of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from fmus.kit import UserError
from orchestration.api.declaration import only
from orchestration.api.options import FrequencyKeywords
from orchestration.cli.command import command
from orchestration.cli.commands.options import FrequencyCommand
from orchestration.cli.isolation import isolating
from orchestration.cli.outputs import check_outputs, show_and_write
from orchestration.reporting.console import progress, tell_repairs

if TYPE_CHECKING:
    from orchestration.cli.commands.options import MeasuredOptions
    from orchestration.identify.spectral import FrequencyResponse


@command(FrequencyCommand)
def frequency(options: FrequencyCommand) -> None:
    """Estimate impedance and dynamic stiffness with intervals, and those of a model.

    Without a model, name ratios of columns. Inputs are best periodic, or random.
    """
    check_outputs(options, {"the record": options["record"]}, out=(".csv",))
    with isolating(options["isolate"]):
        responses = _without_model(options) if options["model"] is None else _with_model(options)
        show_and_write(responses, options, out=responses.to_csv, plot=responses.plot)


def _without_model(options: FrequencyCommand) -> FrequencyResponse:
    """Estimate responses of columns alone, and print the repairs of the record."""
    from orchestration.api import frequency_response

    for flag, given in (("--with", options["laid_over"]), ("--preset", options["preset"])):
        if given:
            raise UserError(f"{flag}: there is no model; name it with --model")
    responses = frequency_response(options["record"], **only(FrequencyKeywords, options))
    tell_repairs(responses.repairs)
    return responses


def _with_model(options: FrequencyCommand) -> FrequencyResponse:
    """Estimate responses of the model's signals, and simulate the model on the same inputs."""
    from orchestration.api import frequency_response
    from orchestration.cli.models import open_measured
    from orchestration.fmu.simulation import source_of

    model, record, parameters = open_measured(cast("MeasuredOptions", options))  # model is named
    with progress(f"simulating {source_of(model).name} over {record.time.size} samples"):
        keywords = only(FrequencyKeywords, {**options, "settings": parameters})
        return frequency_response(record, model, **keywords)
