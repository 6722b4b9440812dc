"""Conversions of a sensor's signal: polynomial, table, thermocouple, RTD and thermistor.

Each gives NaN for a signal beyond its range, as from a sensor that is open or short.
"""

from __future__ import annotations

import math
import tomllib
from bisect import bisect_right
from collections.abc import Callable, Mapping
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Field

from orchestration.plugins.calibration.values import Interval, Number, Positive, TomlTable, one_of

_KELVIN = 273.15  # of 0 degC
_NARROW = 1e-12  # of an interval, to which a root is found
_STEPS = 100  # of which 40 bisections are enough; a thermocouple takes 15 on average
_FUNCTIONS: Mapping[str, Any] = tomllib.loads(
    Path(__file__).with_name("thermocouples.toml").read_text(encoding="utf-8")
)
_PAIRS = "[[signal, value], ...] are wanted, two or more; signals rise, and values rise or fall"


def _check_monotonic(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    signals, values = map(list, zip(*points, strict=True))
    if len(points) < 2 or not is_monotonic(values) or signals != sorted(set(signals)):
        raise ValueError(_PAIRS)
    return points


def is_monotonic(values: list[float]) -> bool:
    """Return whether finite values rise or fall strictly."""
    rising = sorted(set(values))
    return all(map(math.isfinite, values)) and values in (rising, rising[::-1])


CIRCUITS = frozenset({"excitation", "current", "divider"})
"""Circuits of a sensor, by the key of a calibration file: a bridge in mV/V, and two in ohm."""
_OF_RESISTANCES = frozenset({"current", "divider"})


class Divider(TomlTable):
    """A sensor in series with a resistor on a supply; the volts between both are measured.

    Attributes
    ----------
    supply : float
        V.
    resistor : float
        Resistance of the other part, ohm.
    sensor : {"low", "high"}
        Whether the sensor is at the ground or at the supply.
    """

    supply: Positive
    resistor: Positive
    sensor: Annotated[str, one_of("low", "high")] = "low"

    def resistance(self, volts: float) -> float:
        """Return the resistance of the sensor in ohm; NaN if it is open or short."""
        rest = self.supply - volts
        if not (volts > 0.0 and rest > 0.0):
            return math.nan
        return self.resistor * (volts / rest if self.sensor == "low" else rest / volts)


class Conversion(TomlTable):
    """Base of the conversions.

    Attributes
    ----------
    unit : str
        Unit of the value; empty where any will do.
    circuits : frozenset of str
        Circuits that may make the signal, `CIRCUITS` or some of them.
    """

    unit: ClassVar[str] = ""
    circuits: ClassVar[frozenset[str]] = CIRCUITS

    def value(self, signal: float) -> float:
        """Return the value of a signal; NaN beyond the range of the conversion."""
        raise NotImplementedError


class Polynomial(Conversion):
    """Value = sum of ``coefficients[i] * signal**i``."""

    coefficients: Annotated[
        tuple[Number, ...],
        Field(
            min_length=2, max_length=16, description="a list of 2 to 16 finite numbers is wanted"
        ),
    ]

    def value(self, signal: float) -> float:
        """Return the polynomial's value, by Horner's method."""
        return _horner(self.coefficients, signal)


class Table(Conversion):
    """Linear interpolation between points, whose values rise or fall strictly."""

    points: Annotated[
        tuple[tuple[Number, Number], ...],
        AfterValidator(_check_monotonic),
        Field(min_length=1, description=_PAIRS),
    ]

    def value(self, signal: float) -> float:
        """Return the interpolated value; NaN beyond the first and the last point."""
        signals, values = zip(*self.points, strict=True)
        return float(np.interp(signal, signals, values, math.nan, math.nan))


class Thermocouple(Conversion):
    """A thermocouple, by the inverse of its reference function on ITS-90 (IEC 60584-1).

    Attributes
    ----------
    type : str
        Letter of the type.
    cold_junction : float
        Temperature of the cold junction, degC.
    """

    unit: ClassVar[str] = "degC"
    circuits: ClassVar[frozenset[str]] = frozenset()
    type: Annotated[str, one_of(*_FUNCTIONS)]
    cold_junction: Annotated[
        Number, Field(ge=0.0, le=100.0, description="a temperature of 0 to 100 degC is wanted")
    ]

    def value(self, signal: float) -> float:
        """Return the temperature of the hot junction, degC."""
        function = _FUNCTIONS[self.type]
        emf = 1e3 * signal + self.emf(self.cold_junction)
        return inverse(self.emf, emf, function["lowest"], function["highest"])

    def emf(self, temperature: float) -> float:
        """Return the EMF in mV at a temperature in degC, with the cold junction at 0 degC."""
        pieces = _FUNCTIONS[self.type]["pieces"]
        last = bisect_right(pieces, temperature, lo=1, key=itemgetter("low"))
        piece = pieces[last - 1]
        emf = _horner(piece["coefficients"], temperature)
        if "gaussian" in piece:
            height, curvature, centre = piece["gaussian"]
            emf += height * math.exp(curvature * (temperature - centre) ** 2)
        return emf


class Rtd(Conversion):
    """A platinum resistance thermometer, by the equation of Callendar and Van Dusen (IEC 60751).

    Attributes
    ----------
    r0 : float
        Resistance at 0 degC, ohm.
    a, b, c : float
        Coefficients in 1/K, 1/K² and 1/K⁴, the standard's unless given.
    """

    unit: ClassVar[str] = "degC"
    circuits: ClassVar[frozenset[str]] = _OF_RESISTANCES
    r0: Positive = 100.0
    a: Number = 3.9083e-3
    b: Number = -5.775e-7
    c: Number = -4.183e-12

    def value(self, signal: float) -> float:
        """Return the temperature, degC, from -200 to 850."""
        return inverse(self.resistance, signal, -200.0, 850.0)

    def resistance(self, temperature: float) -> float:
        """Return the resistance in ohm at a temperature in degC."""
        below = self.c * min(temperature, 0.0) ** 3 * (temperature - 100.0)
        return self.r0 * (1.0 + temperature * (self.a + temperature * self.b) + below)


class _Thermistor(Conversion):
    """A thermistor of a negative temperature coefficient over a span of temperatures, degC."""

    unit: ClassVar[str] = "degC"
    circuits: ClassVar[frozenset[str]] = _OF_RESISTANCES
    span: Interval

    def value(self, signal: float) -> float:
        """Return the temperature, degC."""
        reciprocal = self._reciprocal(math.log(signal)) if signal > 0.0 else math.nan
        temperature = 1.0 / reciprocal - _KELVIN if reciprocal > 0.0 else math.nan
        return temperature if self.span[0] <= temperature <= self.span[1] else math.nan

    def _reciprocal(self, logarithm: float) -> float:
        """Return the reciprocal temperature in 1/K at the logarithm of a resistance in ohm."""
        raise NotImplementedError


class SteinhartHart(_Thermistor):
    """A thermistor by ``1/T = a + b ln R + c (ln R)³`` (Steinhart and Hart 1968), K and ohm."""

    a: Number
    b: Number
    c: Number

    def _reciprocal(self, logarithm: float) -> float:
        return self.a + logarithm * (self.b + self.c * logarithm**2)


class Beta(_Thermistor):
    """A thermistor by its coefficient B: ``1/T = 1/T0 + ln(R / R0) / B`` (IEC 60539-1).

    Attributes
    ----------
    beta : float
        B, K.
    resistance, temperature : float
        R0 in ohm and T0 in degC, 25 unless given.
    """

    beta: Positive
    resistance: Positive
    temperature: Annotated[
        Number, Field(gt=-_KELVIN, description="a temperature in degC is wanted")
    ] = 25.0

    def _reciprocal(self, logarithm: float) -> float:
        beyond = (logarithm - math.log(self.resistance)) / self.beta
        return 1.0 / (self.temperature + _KELVIN) + beyond


CONVERSIONS: Mapping[str, type[Conversion]] = {
    "polynomial": Polynomial,
    "table": Table,
    "thermocouple": Thermocouple,
    "rtd": Rtd,
    "steinhart_hart": SteinhartHart,
    "beta": Beta,
}
"""Conversions by the key of a calibration file."""


def _horner(coefficients: tuple[float, ...], x: float) -> float:
    total = 0.0
    for coefficient in reversed(coefficients):
        total = total * x + coefficient
    return total


def inverse(function: Callable[[float], float], value: float, low: float, high: float) -> float:
    """Return the argument at which a rising function has a value, by regula falsi.

    Every other step halves the interval, so that the number of steps is bounded. SciPy's root
    finder would take half a second to import.

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
    below = function(low) - value
    above = function(high) - value
    if not below <= 0.0 <= above:
        return math.nan
    width = _NARROW * (high - low)
    for step in range(_STEPS):
        if high - low <= width:
            break
        falsi = low - below * (high - low) / (above - below)
        x = 0.5 * (low + high) if step % 2 else falsi
        # a little inside, so that both ends come together
        x = min(max(x, low + 0.5 * width), high - 0.5 * width)
        error = function(x) - value
        if error < 0.0:
            low = x
            below = error
        else:
            high = x
            above = error
    return 0.5 * (low + high)
