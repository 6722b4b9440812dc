"""Channels of a rig: the value of measured volts, the volts of a command, and instruments."""

from __future__ import annotations

import datetime
import math
import re
from dataclasses import dataclass, field
from pathlib import Path

from fmus.kit.errors import UserError
from orchestration.plugins.calibration.conversions import Conversion, Divider, inverse
from orchestration.plugins.calibration.values import (
    Baudrate,
    Ending,
    Framing,
    NumberPattern,
    Pattern,
    Text,
    Texts,
    Timeout,
    TomlTable,
)
from orchestration.rig.signals import Limit

_FIRST = re.compile("([^,]*)")  # of the values in an answer, which SCPI puts commas between
ROUNDING = 1e-9  # of a range, by which a command may be beyond it
_GRID = 200  # intervals of a range, at whose ends a conversion is checked


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


@dataclass(frozen=True)
class Channel:
    """One signal of a rig, and the channel or instrument that has it.

    Attributes
    ----------
    name, unit : str
        Name and SI unit of the signal.
    place : str
        Channel of a device, such as ``ai0``, or the name of an instrument.
    command : str
        Command or query for an instrument; empty for a channel of a device.
    query : str
        Query for the command that an instrument has; empty if it has no such query.
    terminal : str
        Wiring of an analog input, one of `TERMINALS`.
    gain, offset : float
        Gain in the channel's own unit per unit of the reading, and offset in that unit.
    sign : int
        1 or -1.
    low, high : float
        Range of the volts.
    safe : float
        SI value in the safe state.
    factor, zero : float
        ``SI = factor * value + zero``.
    date : datetime.date
        Date of the calibration.
    source : str
    own_unit : str
        Unit of the channel in its file.
    scale : float
        Signal of the sensor per volt, as of an amplifier or of a bridge and its excitation.
    divider : Divider, optional
        Circuit that turns the signal into a resistance.
    conversion : Conversion, optional
        Conversion of the signal into the reading; without one the reading is the signal.
    uncertainty : float
        Standard uncertainty of a value, SI; NaN if it is not stated.
    relative_uncertainty : float
        Part of the value that is added to it in squares.
    """

    name: str
    unit: str
    place: str
    command: str
    query: str
    terminal: str
    gain: float
    offset: float
    sign: int
    low: float
    high: float
    safe: float
    factor: float
    zero: float
    date: datetime.date
    source: str
    own_unit: str = ""
    scale: float = 1.0
    divider: Divider | None = None
    conversion: Conversion | None = None
    uncertainty: float = math.nan
    relative_uncertainty: float = 0.0

    @property
    def attributes(self) -> dict[str, float | str]:
        """Description of the calibration that goes with every record."""
        stated: dict[str, float | str] = {
            "calibration_date": self.date.isoformat(),
            "calibration_gain": self.gain,
            "calibration_offset": self.offset,
        }
        if not math.isnan(self.uncertainty):
            stated["standard_uncertainty"] = self.uncertainty
        if self.relative_uncertainty:
            stated["relative_uncertainty"] = self.relative_uncertainty
        return stated

    def measured(self, volts: float) -> float:
        """Return the value of measured volts, SI; NaN beyond the range, as with a broken wire.

        Parameters
        ----------
        volts : float

        Returns
        -------
        float
        """
        if not self.low <= volts <= self.high:
            return math.nan
        return self._value(volts)

    def _value(self, volts: float) -> float:
        value = self.sign * (self.gain * self._reading(volts) + self.offset)
        return self.factor * value + self.zero

    def _reading(self, volts: float) -> float:
        """Return the reading at some volts; NaN beyond the range of the conversion."""
        signal = self.scale * volts
        if self.divider is not None:
            signal = self.divider.resistance(signal)
        return signal if self.conversion is None else self.conversion.value(signal)

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
        return (self.sign * ((value - self.zero) / self.factor) - self.offset) / self.gain

    @property
    def is_linear(self) -> bool:
        """True if the value is a linear function of the volts."""
        return self.divider is None and self.conversion is None

    def sampled(self) -> list[float]:
        """Return the values, SI, at volts spaced evenly over the range."""
        width = (self.high - self.low) / _GRID
        return [self._value(self.low + k * width) for k in range(_GRID + 1)]

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
        raw = self.reading(value) / self.scale if self.is_linear else self._inverse(value)
        room = ROUNDING * (self.high - self.low)
        if not self.low - room <= raw <= self.high + room:
            needed = f"{raw:.6g}" if self.is_linear else "another reading"
            raise UserError(
                f"{self.name} = {value:.6g} {self.unit} needs {needed} at {self.place}, "
                f"whose range is {self.low:g} … {self.high:g}"
            )
        return min(max(raw, self.low), self.high)

    def _inverse(self, value: float) -> float:
        """Return the volts of a value by bisection; NaN if the range has none."""
        reach = self.reachable()
        nearest = min(max(value, reach.min), reach.max)
        if not abs(value - nearest) <= ROUNDING * (reach.max - reach.min):
            return math.nan
        rises = math.copysign(1.0, self._value(self.high) - self._value(self.low))
        return inverse(lambda v: rises * self._value(v), rises * nearest, self.low, self.high)

    def reachable(self) -> Limit:
        """Return the values between both ends of the range, SI."""
        ends = sorted((self._value(self.low), self._value(self.high)))
        return Limit(*ends)


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
    inputs, outputs : dict of str to Channel
        Channels by signal.
    limits : dict of str to Limit
        Limits in SI of every input, and of outputs that have some.
    instruments : dict of str to Instrument
    """

    file: Path
    rate: float
    watchdog: float
    inputs: dict[str, Channel]
    outputs: dict[str, Channel]
    limits: dict[str, Limit]
    instruments: dict[str, Instrument] = field(default_factory=dict)

    @property
    def units(self) -> tuple[dict[str, str], dict[str, str]]:
        """SI units of the inputs and of the outputs, by signal."""
        inputs, outputs = (
            {name: channel.unit for name, channel in channels.items()}
            for channels in (self.inputs, self.outputs)
        )
        return inputs, outputs

    @property
    def attributes(self) -> dict[str, dict[str, float | str]]:
        """Descriptions of the calibrations of all signals, by signal."""
        return {name: one.attributes for name, one in {**self.inputs, **self.outputs}.items()}
