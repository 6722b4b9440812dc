"""Assumptions of a fit from texts and numbers, in the units of a model."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.errors import find
from fmus.kit.units import difference_unit
from orchestration.fmu import Model, Signal
from orchestration.fmu.signal import read_amount, read_quantity
from orchestration.identify.fitting import SCALES, Assumptions
from orchestration.reporting import option

_TIE = re.compile(r"\s*(?:([-+\d.eE]+)\s*\*\s*)?([^\s*].*?)\s*")


def read_assumptions(model: Model, options: Mapping[str, Any]) -> Assumptions:
    """Return the assumptions that values of `AssumptionOptions` state.

    Parameters
    ----------
    model : Model
    options : Mapping of str to Any

    Raises
    ------
    UserError
        If a parameter or an output is unknown, or a text is not of its form.
    """
    given = {name: options[name] or {} for name in ("bounds", "scale", "prior", "tie", "noise")}

    def read(name: str, reader: Any, known: Mapping[str, Signal]) -> dict[str, Any]:
        values = {}
        for variable, value in given[name].items():
            where = option(name, {variable: value})
            signal = find(variable, known, f"{where}: {model.name} has no such variable as")
            values[variable] = reader(value, signal, where)
        return values

    return Assumptions(
        each=tuple(options["each"]),
        bounds=read("bounds", _bounds, model.constants),
        scales=read("scale", _scale, model.constants),
        priors=read("prior", _prior, model.constants),
        ties=read("tie", _tie, model.constants),
        noise=read("noise", _deviation, {**model.others, **model.outputs}),
        weights=_weights(options.get("weights") or {}),
        loss=options["loss"],
        starts=options["starts"],
    )


def _bounds(value: Any, signal: Signal, where: str) -> tuple[float, float]:
    if not isinstance(value, str):
        return _two_numbers(value, where)
    low, high = _two_texts(value, "..", where, "0.1..2ohm")
    unit = signal.unit
    return (
        read_amount(low, unit, where) if low.strip() else signal.min,
        read_amount(high, unit, where) if high.strip() else signal.max,
    )


def _prior(value: Any, signal: Signal, where: str) -> tuple[float, float]:
    if not isinstance(value, str):
        return _two_numbers(value, where)
    text = value.replace("±", "+-").replace("+/-", "+-")
    mean, deviation = _two_texts(text, "+-", where, "0.43+-0.05ohm")
    return read_amount(mean, signal.unit, where), _deviation(deviation, signal, where)


def _deviation(value: Any, signal: Signal, where: str) -> float:
    return read_amount(str(value), difference_unit(signal.unit), where)


def _scale(value: Any, signal: Signal, where: str) -> str:
    if value not in SCALES:
        raise UserError(f"{where}: a parameter is searched {' or '.join(SCALES)}")
    return str(value)


def _tie(value: Any, signal: Signal, where: str) -> tuple[float, str]:
    if not isinstance(value, str):
        value = "*".join(map(str, value))
    match = _TIE.fullmatch(value)
    try:
        factor = float(match[1] or 1.0) if match else 0.0
    except ValueError:
        factor = 0.0
    if match is None or not factor:
        raise UserError(f"{where}: write a multiple of a fitted parameter, such as 1.6*k1")
    return factor, match[2]


def _two_texts(text: str, between: str, where: str, example: str) -> tuple[str, str]:
    """Return the texts on both sides of a sign, the first with the unit of the second."""
    first, found, second = text.partition(between)
    if not found:
        raise UserError(f"{where}: write it as {example}")
    quantities = read_quantity(first), read_quantity(second)
    if quantities[0] and quantities[1] and not quantities[0][1]:
        first += quantities[1][1]
    return first, second


def _two_numbers(value: Any, where: str) -> tuple[float, float]:
    try:
        first, second = map(float, value)
    except (TypeError, ValueError):
        raise UserError(f"{where}: must be two numbers, or a text with a unit") from None
    return first, second


def _weights(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return weights as arrays; UserError if one is negative or not finite."""
    weights = {output: np.asarray(values, dtype=float) for output, values in given.items()}
    for output, values in weights.items():
        if not (np.isfinite(values).all() and (values >= 0.0).all()):
            raise UserError(f"weights of {output}: each must be a number from zero on")
    return weights
