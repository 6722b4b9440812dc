"""Assumptions of a fit from texts and numbers, in the units of a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Interval
from fmus.kit.errors import find
from orchestration.fmu import Model, Signal
from orchestration.fmu.signal import read_amount, read_quantity
from orchestration.identify.fitting import SCALES, Assumptions
from orchestration.reporting import option


def read_assumptions(model: Model, options: Mapping[str, Any]) -> Assumptions:
    """Return the assumptions that values of `AssumptionOptions` state.

    Parameters
    ----------
    model : Model
    options : Mapping of str to Any

    Raises
    ------
    UserError
        If a parameter or an output is unknown, a text is not of its form, or inputs of a model
        without equations shall be linear.
    """
    if options["interpolate"] and model.cls is None:
        raise UserError(
            f"{option('interpolate', True)}: inputs of {model.name} are constant between samples,"
            " because its equations are not known; leave it out"
        )
    constants = model.constants
    readers: dict[str, tuple[Any, Mapping[str, Signal]]] = {
        "bounds": (_bounds, constants),
        "scale": (_scale, constants),
        "prior": (_prior, constants),
        "tie": (_tie, constants),
        "noise": (_deviation, {**model.others, **model.outputs}),
    }
    values: dict[str, dict[str, Any]] = {}
    for name, (reader, known) in readers.items():
        values[name] = {}
        for variable, value in (options[name] or {}).items():
            where = option(name, {variable: value})
            signal = find(variable, known, f"{where}: {model.name} has no such variable as")
            values[name][variable] = reader(value, signal, where)
    weights = {
        output: np.asarray(given, dtype=float)
        for output, given in (options.get("weights") or {}).items()
    }
    for output, given in weights.items():
        if not (np.isfinite(given) & (given >= 0.0)).all():
            raise UserError(f"weights of {output}: each must be a number from zero on")
    return Assumptions(
        each=tuple(options["each"]),
        bounds=values["bounds"],
        scales=values["scale"],
        priors=values["prior"],
        ties=values["tie"],
        noise=values["noise"],
        weights=weights,
        loss=options["loss"],
        starts=options["starts"],
        linear=bool(options["interpolate"]),
    )


def _bounds(value: Any, signal: Signal, where: str) -> Interval:
    low, high = _two_amounts(value, "..", where, "0.1..2ohm")
    return (
        read_amount(low, signal.unit, where) if low.strip() else signal.min,
        read_amount(high, signal.unit, where) if high.strip() else signal.max,
    )


def _prior(value: Any, signal: Signal, where: str) -> Interval:
    if isinstance(value, str):
        value = value.replace("±", "+-").replace("+/-", "+-")
    mean, deviation = _two_amounts(value, "+-", where, "0.43+-0.05ohm")
    return read_amount(mean, signal.unit, where), _deviation(deviation, signal, where)


def _deviation(value: Any, signal: Signal, where: str) -> float:
    return read_amount(str(value), signal.unit, where, difference=True)


def _scale(value: Any, signal: Signal, where: str) -> str:
    if value not in SCALES:
        raise UserError(f"{where}: a parameter is searched {' or '.join(SCALES)}")
    return str(value)


def _tie(value: Any, signal: Signal, where: str) -> tuple[float, str]:
    text = value if isinstance(value, str) else "*".join(map(str, value))
    factor, star, source = text.rpartition("*")
    number, unit = read_quantity(factor if star else "1") or (0.0, "")
    if unit or not number or not source.strip():
        raise UserError(f"{where}: write a multiple of a fitted parameter, such as 1.6*k1")
    return number, source.strip()


def _two_amounts(value: Any, between: str, where: str, example: str) -> tuple[str, str]:
    """Return two amounts as texts, of a text the first with the unit of the second."""
    if not isinstance(value, str):
        if np.shape(value) != (2,):
            raise UserError(f"{where}: must be two numbers, or a text with a unit")
        return str(value[0]), str(value[1])
    first, found, second = value.partition(between)
    if not found:
        raise UserError(f"{where}: write it as {example}")
    quantities = read_quantity(first), read_quantity(second)
    if quantities[0] and quantities[1] and not quantities[0][1]:
        first += quantities[1][1]
    return first, second
