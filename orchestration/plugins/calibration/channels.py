"""Channels of a rig: the value of measured volts, the volts of a command, and instruments."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, PlainValidator

from fmus.kit import units
from fmus.kit.errors import UserError
from orchestration.plugins.calibration.conversions import (
    CIRCUITS,
    NO_CONVERSION,
    Conversion,
    inverse,
    is_monotonic,
    read_conversion,
    read_divider,
)
from orchestration.plugins.calibration.values import (
    Baudrate,
    Date,
    Ending,
    Framing,
    Interval,
    NotNegative,
    NotZero,
    Number,
    NumberPattern,
    Pattern,
    Positive,
    Sign,
    Text,
    Texts,
    Timeout,
    TomlTable,
)
from orchestration.rig.signals import Limit

# Loading the units takes a quarter of a second, which a process that reopens a rig in an emergency
# must not lose.
units.registry()
_FIRST = re.compile("([^,]*)")  # of the values in an answer, which SCPI puts commas between
_ROUNDING = 1e-9  # of the values in reach, by which a command may be beyond them
_GRID = 201  # volts of a range, at which a conversion is checked


class Instrument(TomlTable):
    """An instrument that understands messages.

    Attributes
    ----------
    resource : str
        VISA address, or a serial port.
    timeout : float
        s, of every message.
    setup, safe : tuple of str
        Messages on opening, and those that bring it to its safe state before anything else.
    error : str
        Query whose answer begins with 0 when nothing is wrong; empty if there is none.
    termination : str
        The end of a message.
    answer : re.Pattern
        Its group finds the number in an answer.
    reply : re.Pattern or None
        Answer to each message that is no query; None if there is no such answer.
    baudrate : int or None
        Of a serial port.
    framing : str
        Of a serial port: data bits, parity (N, E or O) and stop bits.
    """

    resource: Text
    timeout: Timeout = 0.5
    setup: Texts = ()
    safe: Texts = ()
    error: Text = ""
    termination: Ending = "\n"
    answer: NumberPattern = _FIRST
    reply: Pattern | None = None
    baudrate: Baudrate = None
    framing: Framing = "8N1"


class Channel(TomlTable):
    """One signal of a rig, and the channel or instrument that has it.

    Attributes are the keys of its table in the file, in the unit there; what methods take and
    return is SI.

    Attributes
    ----------
    name : str
        Name of the signal.
    unit, si : str
        Unit in the file, and SI unit.
    channel : str
        Channel of a device, such as ``ai0``; empty for a signal of an instrument.
    instrument : str
        Name of the instrument; empty for a channel of a device.
    query : str
        Query for the value, or for the command that an instrument has; empty if there is none.
    amplification, excitation, current : float
        Volts per volt of the sensor; supply of a bridge in V; current through a resistance in A.
    divider : callable, optional
        Circuit that turns the volts into a resistance.
    conversion : Conversion, optional
        Conversion of the signal into the reading; without one the reading is the signal.
    gain, offset : float
        Gain per unit of the reading, and offset.
    sign : int
        1 or -1.
    range : tuple of two float
        Volts that make sense.
    uncertainty : float
        Standard uncertainty of a value; NaN if it is not stated.
    relative_uncertainty : float
        Part of the value that is added to it in squares; NaN if it is not stated.
    date : datetime.date
        Date of the calibration.
    source, by : str
    points : tuple
        Known values, each with its reading.
    """

    verb: ClassVar[str] = "query"
    name: str
    unit: Text
    si: Text
    channel: Text = ""
    instrument: Text = ""
    query: Text = ""
    amplification: NotZero = 1.0
    excitation: Positive = 1e3  # on which 1 mV/V is 1 V
    current: Positive = 1.0
    divider: Annotated[Callable[[float], float], PlainValidator(read_divider)] = float
    conversion: Annotated[Conversion, PlainValidator(read_conversion)] = NO_CONVERSION
    gain: Annotated[NotZero, Field(description="a finite number is wanted")] = 1.0
    offset: Number = 0.0
    range: Interval
    sign: Sign = 1
    uncertainty: NotNegative = math.nan
    relative_uncertainty: NotNegative = math.nan
    date: Date
    source: Text = "not stated"
    by: Text = ""
    points: Annotated[
        tuple[tuple[Number, Number], ...],
        Field(description="a list of [known value, reading] is wanted"),
    ] = ()

    @property
    def place(self) -> str:
        """Channel of a device, or name of an instrument."""
        return self.channel or self.instrument

    @property
    def message(self) -> str:
        """Message that commands an instrument, or asks it for its value."""
        text: str = getattr(self, self.verb)
        return text

    @property
    def attributes(self) -> dict[str, float | str]:
        """Description of the calibration that goes with every record."""
        uncertainties = {
            "standard_uncertainty": self._to_si[0] * self.uncertainty,
            "relative_uncertainty": self.relative_uncertainty,
        }
        return {
            "calibration_date": self.date.isoformat(),
            "calibration_gain": self.gain,
            "calibration_offset": self.offset,
            **{name: value for name, value in uncertainties.items() if value >= 0.0},
        }

    @cached_property
    def _to_si(self) -> tuple[float, float]:
        return factor_and_zero(self.unit, self.si, self.name)

    @cached_property
    def _scale(self) -> float:
        """Signal of the sensor per volt, in V, mV/V or ohm; a divider needs the volts."""
        return 1e3 / (self.amplification * self.current * self.excitation)

    def measured(self, volts: float) -> float:
        """Return the value of measured volts, SI; NaN beyond the range, as with a broken wire.

        Parameters
        ----------
        volts : float

        Returns
        -------
        float
        """
        return self._value(volts) if self.range[0] <= volts <= self.range[1] else math.nan

    def _value(self, volts: float) -> float:
        reading = self.conversion.value(self.divider(self._scale * volts))
        return self.in_si(self.sign * (self.gain * reading + self.offset))

    def in_si(self, value: float) -> float:
        """Return a value in the file's unit in SI."""
        factor, zero = self._to_si
        return factor * value + zero

    def reading(self, value: float) -> float:
        """Return the reading of a value, before gain and offset.

        Parameters
        ----------
        value : float
            SI.

        Returns
        -------
        float
        """
        factor, zero = self._to_si
        return (self.sign * ((value - zero) / factor) - self.offset) / self.gain

    def volts(self, value: float) -> float:
        """Return the volts that command a value.

        Parameters
        ----------
        value : float
            SI.

        Returns
        -------
        float

        Raises
        ------
        UserError
            If they are beyond the range, or the value is not finite.
        """
        if allowed := self.refusal(value):
            raise UserError(f"{self.name} = {value:.6g} {self.si}: {allowed}")
        low, high = self.range
        nearest = min(max(value, self.reach.min), self.reach.max)
        if self.conversion is NO_CONVERSION and self.divider is float:
            raw = self.reading(nearest) / self._scale
        else:
            raw = inverse(self._value, nearest, low, high)
        return min(max(raw, low), high)

    @cached_property
    def reach(self) -> Limit:
        """Values between both ends of the range, SI."""
        return Limit(*sorted(map(self._value, self.range)))

    def refusal(self, value: float) -> str:
        """Return why a value, SI, cannot be commanded; empty if it can."""
        room = _ROUNDING * (self.reach.max - self.reach.min)
        if self.reach.min - room <= value <= self.reach.max + room:
            return ""
        able = f"{self.reach.min:.6g} … {self.reach.max:.6g} {self.si}"
        return f"the range of {self.place} allows {able} only"

    def rules(self) -> list[tuple[str, object, str]]:
        """Return keys, each with whether it does not fit to others, and what is allowed."""
        on_instrument = bool(self.instrument)
        circuit, *more = sorted(CIRCUITS & self.model_fields_set) or [""]
        no_circuit = circuit and circuit not in self.conversion.circuits
        no_gain = self.conversion is NO_CONVERSION and "gain" not in self.model_fields_set
        other_unit = self.conversion.unit not in ("", self.unit)
        relative = "relative_uncertainty"
        no_values = not np.isfinite(self.sampled()).any()
        both = "a signal is either on a channel of a device or on an instrument"
        none = "no volts in it have a value, by this conversion in this circuit"
        arbitrary = f"is no part of a value in {self.unit}, which has an arbitrary zero"
        return [
            ("channel", on_instrument and self.channel, both),
            ("channel", not self.place, "a text is wanted"),
            (self.verb, on_instrument and not self.message, "a text is wanted"),
            (self.verb, self.channel and self.message, "needs an instrument = ..."),
            ("query", self.channel and self.query, "needs an instrument = ..."),
            ("".join(more[:1]), more, f"is one circuit, and {circuit} another; a channel has one"),
            ("gain", no_gain, "a finite number is wanted"),
            ("unit", other_unit, f"the conversion gives {self.conversion.unit}"),
            (circuit, no_circuit, "is no circuit for the conversion"),
            (relative, self.relative_uncertainty >= 0.0 and self._to_si[1], arbitrary),
            ("range", no_values, none),
        ]

    def sampled(self) -> list[float]:
        """Return the values, SI, at volts spaced evenly over the range."""
        return [self._value(volts) for volts in np.linspace(*self.range, _GRID).tolist()]


class CommandChannel(Channel):
    """The channel of a command.

    Attributes
    ----------
    write : str
        Command for an instrument, with a place for the volts; empty for a channel of a device.
    safe : float
        Value in the safe state.
    """

    verb: ClassVar[str] = "write"
    write: Text = ""
    safe: Number = 0.0

    @property
    def safe_value(self) -> float:
        """Value in the safe state, SI; a safe temperature of 20 degC is one of 293.15 K."""
        return self.in_si(self.safe)

    def rules(self) -> list[tuple[str, object, str]]:
        """Return keys, each with whether it does not fit to others, and what is allowed."""
        no_number = self.instrument and not _takes_a_number(self.write)
        turns = not is_monotonic(self.sampled())
        return [
            *super().rules(),
            ("write", no_number, "a message is wanted with {volts} where the number goes"),
            ("range", turns, "a command needs a value that rises or falls over all of it"),
        ]


class MeasuredChannel(Channel):
    """The channel of a measured value.

    Attributes
    ----------
    terminal : str
        Wiring of an analog input.
    """

    terminal: Literal["default", "differential", "referenced", "non-referenced"] = "default"


def factor_and_zero(unit: str, si: str, name: str) -> tuple[float, float]:
    """Return factor and zero of a conversion between units: ``si = factor * value + zero``."""
    zero = float(units.convert(0.0, unit, si, name))
    return float(units.convert(1.0, unit, si, name)) - zero, zero


def _takes_a_number(message: str) -> bool:
    """Return whether a message has a valid place for the volts, with which it becomes another."""
    try:
        return message.format(volts=0.125) != message
    except (LookupError, ValueError):
        return False


@dataclass(frozen=True)
class Calibration:
    """The channels of a rig with their limits, and the instruments that some of them are on.

    Attributes
    ----------
    file : Path
    rate : float
        Samples per second, Hz.
    watchdog : float
        Time in s after which the rig stops without a fresh command.
    heartbeat : str
        Digital line of a device for the heartbeat; empty if there is none.
    inputs, outputs : dict of str to Channel
        Channels by signal.
    limits : dict of str to Limit
        Limits in SI of every input, and of outputs that have some.
    instruments : dict of str to Instrument
    """

    file: Path
    rate: float
    watchdog: float
    heartbeat: str
    inputs: dict[str, CommandChannel]
    outputs: dict[str, MeasuredChannel]
    limits: dict[str, Limit]
    instruments: dict[str, Instrument]

    @property
    def units(self) -> tuple[dict[str, str], dict[str, str]]:
        """SI units of the inputs and of the outputs, by signal."""
        inputs = {name: channel.si for name, channel in self.inputs.items()}
        return inputs, {name: channel.si for name, channel in self.outputs.items()}

    @property
    def attributes(self) -> dict[str, dict[str, float | str]]:
        """Descriptions of the calibrations of all signals, by signal."""
        return {name: one.attributes for name, one in {**self.inputs, **self.outputs}.items()}
