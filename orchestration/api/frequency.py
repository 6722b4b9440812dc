"""Frequency responses of records from Python: ``ppy.frequency_response``."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Unpack

from fmus.kit import Component
from fmus.kit.errors import UserError, suggestion
from orchestration.api.declaration import takes
from orchestration.api.forms import optional_seconds
from orchestration.api.options import FrequencyKeywords, source_of
from orchestration.api.records import Data, matching_record
from orchestration.api.simulation import as_measured, values_of
from orchestration.fmu import Model
from orchestration.fmu.isolation import limits_of
from orchestration.fmu.model import built
from orchestration.fmu.simulation import simulate
from orchestration.identify.spectral import (
    FrequencyResponse,
    estimate_responses,
    parts_of_ratio,
)
from orchestration.records import Record, read_columns
from orchestration.reporting import option


@takes(FrequencyKeywords)
def frequency_response(
    record: Data,
    model: Model | type[Component] | str | Path | None = None,
    **options: Unpack[FrequencyKeywords],
) -> FrequencyResponse:
    """Estimate frequency responses of a record with intervals, and those of a model for comparison.

    The local polynomial method estimates the leakage of a record that is not periodic together with
    the response (Pintelon and Schoukens, chapter 7). The model is simulated with the inputs of the
    record, and its responses are estimated in the same way.

    Parameters
    ----------
    record : Record, str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        Equally spaced, without gaps.
    model : Model, type[Component], str or Path, optional
        A component, any FMU, ``path/to/file.py:Class``, or a class such as ``diagnose(...).model``.

    Returns
    -------
    FrequencyResponse
        ``result["voltage/current"]`` has ``frequency`` in Hz, complex ``values`` and their
        ``covariance``, and ``magnitude``, ``phase``, ``real``, ``imaginary``, ``storage``,
        ``loss`` and ``loss_tangent``, each with its 95 % interval.

    Raises
    ------
    UserError
        If the record or the model cannot be used, samples are missing or not equally spaced, a
        ratio makes no sense, or no response can be estimated.

    Examples
    --------
    >>> import numpy as np
    >>> import ppy_rig as ppy
    >>> time = 0.1 * np.arange(600)
    >>> current = np.where(time % 10.0 < 4.99, 0.9, -0.9)
    >>> run = ppy.simulate("ppy_actuator", {"current": current}, time=time)
    >>> columns = {"time [s]": time, "current [A]": current, "voltage [V]": run["voltage"]}
    >>> found = ppy.frequency_response(columns, of=["voltage/current"])
    >>> round(float(found["voltage/current"].magnitude.value[0]), 2)
    0.6
    """
    if model is None:
        return _responses_of_columns(record, options)
    return _responses_with_model(record, as_measured(model).with_options(options), options)


def _responses_of_columns(record: Data, options: FrequencyKeywords) -> FrequencyResponse:
    """Estimate responses of columns that are not those of a model."""
    _refuse_without_model(options)
    ratios = options["of"]
    inputs = options["inputs"] or [parts_of_ratio(ratio)[1] for ratio in ratios]
    columns = _read_named_columns(record, options, inputs)
    _check_inputs(inputs, columns.signals)
    period = optional_seconds(options["period"])
    return estimate_responses(columns, inputs, ratios, period=period, band=options["band"])


def _responses_with_model(
    record: Data, declared: Model, options: FrequencyKeywords
) -> FrequencyResponse:
    """Estimate responses of a record and of a model that is simulated with its inputs."""
    settings = values_of(declared, options["settings"])
    data = _signals_of_model(matching_record(record, declared, options), declared)
    _check_inputs(options["inputs"], data.signals)
    model = built(declared)
    stimulus = {name: signal for name, signal in data.signals.items() if name in model.inputs}
    return estimate_responses(
        data,
        options["inputs"] or [*declared.inputs],
        options["of"],
        period=optional_seconds(options["period"]),
        band=options["band"],
        model=model.title,
        modelled=simulate(model, data.time, stimulus, settings, isolation=limits_of(model.foreign)),
    )


def _signals_of_model(record: Record, model: Model) -> Record:
    """Return a record with the signals of the model only."""
    known = {*model.inputs, *model.outputs}
    signals = {name: values for name, values in record.signals.items() if name in known}
    return replace(record, signals=signals)


def _refuse_without_model(options: FrequencyKeywords) -> None:
    """Raise UserError for options that need a model."""
    for name in ("mapping", "settings", "units"):
        if options[name]:
            raise UserError(f"{option(name)}: there is no model; name it with {option('model')}")


def _check_inputs(inputs: Sequence[str], signals: Collection[str]) -> None:
    """Raise UserError for an input that the record lacks."""
    for name in inputs:
        if name not in signals:
            raise UserError(
                f"{option('inputs', [name])}: the record has no {name}{suggestion(name, signals)}"
            )


def _read_named_columns(record: Data, options: FrequencyKeywords, inputs: Sequence[str]) -> Record:
    """Return the columns of a record that ratios and inputs name, in the units of the record."""
    of = options["of"]
    if not of:
        raise UserError(
            f"{option('of')}: name ratios of columns, such as voltage/current, or a model with"
            f" {option('model')}"
        )
    if isinstance(record, Record):
        return record
    signals = [part.strip() for ratio in of for part in ratio.split("/")]
    return read_columns(source_of(record, options), dict.fromkeys([*signals, *inputs]), inputs)
