"""Conversions of a sensor's signal: polynomial, table, thermocouple, RTD and thermistor.

Each is a function of the signal, whose other arguments are the keys of its table in a calibration
file. It gives NaN for a signal beyond its range, as from a sensor that is open or short.
"""

from __future__ import annotations

import math
import tomllib
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from inspect import signature
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field, create_model

from fmus.kit.errors import suggestion
from orchestration.plugins.calibration.values import (
    Interval,
    Number,
    Positive,
    TomlTable,
    checked,
    value_error,
)

_KELVIN = 273.15  # of 0 degC
_PARTS = 2**44  # of an interval, to one of which a root is found
_FUNCTIONS: Mapping[str, Any] = tomllib.loads(
    Path(__file__).with_name("thermocouples.toml").read_text(encoding="utf-8")
)
_PAIRS = "[[signal, value], ...] are wanted, two or more; signals rise, and values rise or fall"


def _check_monotonic(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    signals, values = np.transpose(points)
    if not (is_monotonic(values) and is_monotonic(signals) and signals[0] < signals[1]):
        raise ValueError(_PAIRS)
    return points


def is_monotonic(values: Sequence[float]) -> bool:
    """Return whether values are finite and rise or fall strictly."""
    if not np.isfinite(values).all():
        return False
    steps = np.diff(values)
    return bool(steps.min() > 0.0 or steps.max() < 0.0)


_Points = Annotated[
    tuple[tuple[Number, Number], ...],
    AfterValidator(_check_monotonic),
    Field(min_length=2, description=_PAIRS),
]
_Coefficients = Annotated[
    tuple[Number, ...],
    Field(min_length=2, max_length=16, description="a list of 2 to 16 finite numbers is wanted"),
]
_Junction = Annotated[
    Number, Field(ge=0.0, le=100.0, description="a temperature of 0 to 100 degC is wanted")
]
_Celsius = Annotated[Number, Field(gt=-_KELVIN, description="a temperature in degC is wanted")]


def polynomial(signal: float, *, coefficients: _Coefficients) -> float:
    """Return the sum of ``coefficients[i] * signal**i``."""
    return _horner(coefficients, signal)


def table(signal: float, *, points: _Points) -> float:
    """Return the linear interpolation between points, whose values rise or fall strictly."""
    signals, values = zip(*points, strict=True)
    return float(np.interp(signal, signals, values, math.nan, math.nan))


def thermocouple(
    signal: float,
    *,
    type: Literal["B", "E", "J", "K", "N", "R", "S", "T"],
    cold_junction: _Junction,
) -> float:
    """Return the temperature of a thermocouple in degC, signal in V and cold junction in degC.

    It is the inverse of the reference function on ITS-90 (IEC 60584-1).
    """
    function = _FUNCTIONS[type]
    voltage = 1e3 * signal + emf(type, cold_junction)
    return inverse(partial(emf, type), voltage, function["lowest"], function["highest"])


def emf(type: str, temperature: float) -> float:
    """Return the EMF of a thermocouple in mV at a temperature in degC, cold junction at 0 degC."""
    pieces = _FUNCTIONS[type]["pieces"]
    piece = pieces[bisect_right(pieces, temperature, key=itemgetter("low")) - 1]
    height, curvature, centre = piece.get("gaussian", (0.0, 0.0, 0.0))
    gaussian: float = height * math.exp(curvature * (temperature - centre) ** 2)
    return gaussian + _horner(piece["coefficients"], temperature)


def rtd(
    signal: float,
    *,
    r0: Positive = 100.0,
    a: Number = 3.9083e-3,
    b: Number = -5.775e-7,
    c: Number = -4.183e-12,
) -> float:
    """Return the temperature of a platinum resistance thermometer, degC from -200 to 850.

    By the equation of Callendar and Van Dusen (IEC 60751), with the signal and `r0` in ohm.
    """

    def resistance(temperature: float) -> float:
        below = c * min(temperature, 0.0) ** 3 * (temperature - 100.0)
        return r0 * (1.0 + temperature * (a + temperature * b) + below)

    return inverse(resistance, signal, -200.0, 850.0)


def steinhart_hart(signal: float, *, a: Number, b: Number, c: Number, span: Interval) -> float:
    """Return the temperature of a thermistor in degC, whose resistance is the signal in ohm.

    By ``1/T = a + b ln R + c (ln R)³`` (Steinhart and Hart 1968) in K and ohm.
    """
    return _thermistor(signal, (a, b, 0.0, c), span)


def beta(
    signal: float,
    *,
    beta: Positive,
    resistance: Positive,
    temperature: _Celsius = 25.0,
    span: Interval,
) -> float:
    """Return the temperature of a thermistor in degC, whose resistance is the signal in ohm.

    By its coefficient B in K: ``1/T = 1/T0 + ln(R / R0) / B`` (IEC 60539-1), with R0 in ohm at a
    temperature in degC.
    """
    reciprocal = 1.0 / (temperature + _KELVIN)
    return _thermistor(signal, (reciprocal - math.log(resistance) / beta, 1.0 / beta), span)


def _thermistor(signal: float, coefficients: Sequence[float], span: Interval) -> float:
    """Return a temperature in degC, by its reciprocal over the logarithm of a resistance."""
    reciprocal = _horner(coefficients, math.log(signal)) if signal > 0.0 else math.nan
    temperature = 1.0 / reciprocal - _KELVIN if reciprocal > 0.0 else math.nan
    return temperature if span[0] <= temperature <= span[1] else math.nan


def divider(
    signal: float,
    *,
    supply: Positive,
    resistor: Positive,
    sensor: Literal["low", "high"] = "low",
) -> float:
    """Return the resistance in ohm of a sensor in series with a resistor on a supply.

    The signal is the volts between both; the sensor is at the ground (low) or at the supply. It is
    NaN if the sensor is open or short.
    """
    part = signal if sensor == "low" else supply - signal
    return resistor * part / (supply - part) if 0.0 < part < supply else math.nan


CIRCUITS = frozenset({"excitation", "current", "divider"})
"""Circuits of a sensor, by the key of a calibration file: a bridge in mV/V, and two in ohm."""


class Conversion(NamedTuple):
    """A conversion, what it gives, and what may make its signal.

    Attributes
    ----------
    value : callable
    unit : str
        Unit of the value; empty where any will do.
    circuits : frozenset of str
        Some of `CIRCUITS`.
    """

    value: Callable[..., float]
    unit: str = ""
    circuits: frozenset[str] = CIRCUITS


NO_CONVERSION = Conversion(float)
_OHM = frozenset({"current", "divider"})
_CONVERSIONS = {
    "polynomial": Conversion(polynomial),
    "table": Conversion(table),
    "thermocouple": Conversion(thermocouple, "degC", frozenset()),
    "rtd": Conversion(rtd, "degC", _OHM),
    "steinhart_hart": Conversion(steinhart_hart, "degC", _OHM),
    "beta": Conversion(beta, "degC", _OHM),
}


def read_conversion(tables: Any) -> Conversion:
    """Return the conversion of a table that has one, by its kind.

    Raises
    ------
    ValueError
        If it is no such table; a UserError about what is wrong in the conversion's own one.
    """
    if not isinstance(tables, Mapping) or len(tables) != 1:
        raise ValueError(
            "one table is wanted, such as conversion.rtd = { r0 = 100.0 }; there are "
            + ", ".join(_CONVERSIONS)
        )
    ((kind, values),) = tables.items()
    if kind not in _CONVERSIONS:
        allowed = f"there is no such conversion{suggestion(kind, list(_CONVERSIONS))}"
        raise value_error("", f"conversion.{kind}", values, allowed)
    found = _CONVERSIONS[kind]
    return found._replace(value=_bound(found.value, values, f"conversion.{kind}."))


def read_divider(values: Any) -> Callable[[float], float]:
    """Return the resistance by volts of a divider's table; UserError if something is wrong."""
    return _bound(divider, values, "divider.")


def _bound(function: Callable[..., float], values: Any, where: str) -> Callable[[float], float]:
    """Return a function with its arguments but the first, which are the keys of a table."""
    _, *arguments = signature(function, eval_str=True).parameters.values()
    fields: Any = {
        one.name: (one.annotation, ... if one.default is one.empty else one.default)
        for one in arguments
    }
    kind = create_model(function.__name__, __base__=TomlTable, **fields)
    return partial(function, **dict(checked(kind, values, where)))


def _horner(coefficients: Sequence[float], x: float) -> float:
    total = 0.0
    for coefficient in reversed(coefficients):
        total = total * x + coefficient
    return total


def inverse(function: Callable[[float], float], value: float, low: float, high: float) -> float:
    """Return the argument at which a function that rises or falls has a value, by bisection.

    SciPy's root finder would take half a second to import.

    Parameters
    ----------
    function : callable
    value : float
    low, high : float
        Ends of the interval in which it is looked for.

    Returns
    -------
    float
        NaN if the function does not have the value there.
    """
    if function(low) > function(high):
        low, high = high, low
    if not function(low) <= value <= function(high):
        return math.nan
    step = (high - low) / _PARTS
    parts = range(_PARTS)
    return low + step * bisect_left(parts, value, key=lambda part: function(low + step * part))
