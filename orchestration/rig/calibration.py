"""Calibration of a rig: which channel is which signal, and what its volts mean; a TOML file, with dates and sources.

``value = sign * (gain * volts + offset)`` in the unit of the channel, converted to SI; commands go the other way.
"""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass, field
from pathlib import Path

from fmus.kit import units
from fmus.kit.errors import UserError, suggestion
from orchestration.rig.limit import Limit
from orchestration.rig.signals import UNITS
from orchestration.rig.table import Table

_PRESETS = Path(__file__).with_name("presets")
_ROUNDING = 1e-9  # of a range, by which a command may be beyond it
units.registry()  # takes a quarter of a second; a process that has to reopen a rig in need has it behind it
TERMINALS = ("default", "differential", "referenced", "non-referenced")


@dataclass(frozen=True)
class Channel:
    """One signal of a rig and where it is to be had.

    Attributes
    ----------
    name, unit : str
        Of the signal; SI.
    place : str
        Channel of a device, such as ``ai0``, or the name of an instrument.
    command : str
        What is written to, or asked of, an instrument; empty for a channel of a device.
    terminal : str
        How an analog input is wired, one of `TERMINALS`.
    gain, offset : float
        In the channel's own unit per volt, and in that unit.
    sign : int
        1 or -1.
    low, high : float
        Volts that make sense.
    safe : float
        SI value in the safe state.
    factor, zero : float
        ``SI = factor * value + zero``.
    date : datetime.date
        Of the calibration.
    source : str
    """

    name: str
    unit: str
    place: str
    command: str
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

    def measured(self, volts: float) -> float:
        """Return what volts mean, SI; NaN if they are beyond the range, as those of a broken wire are.

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
        return self.factor * (self.sign * (self.gain * volts + self.offset)) + self.zero

    def volts(self, value: float) -> float:
        """Return the volts that stand for a value.

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
        raw = (self.sign * ((value - self.zero) / self.factor) - self.offset) / self.gain
        room = _ROUNDING * (self.high - self.low)
        if not self.low - room <= raw <= self.high + room:
            raise UserError(
                f"{self.name} = {value:.6g} {self.unit} needs {raw:.6g} V at {self.place}; "
                f"its range is {self.low:g} … {self.high:g} V"
            )
        return min(max(raw, self.low), self.high)

    def reachable(self) -> Limit:
        """Return the values between both ends of the range, SI."""
        ends = sorted((self._value(self.low), self._value(self.high)))
        return Limit(*ends)


@dataclass(frozen=True)
class Instrument:
    """An instrument that understands messages.

    Attributes
    ----------
    resource : str
        VISA address.
    timeout : float
        s, of every message.
    setup, safe : tuple of str
        Messages on opening, and those that bring it to its safe state before anything else.
    error : str
        Query whose answer begins with 0 when nothing is wrong; empty if there is none.
    termination : str
        What ends a message.
    """

    name: str
    resource: str
    timeout: float
    setup: tuple[str, ...]
    safe: tuple[str, ...]
    error: str
    termination: str


@dataclass(frozen=True)
class Calibration:
    """A rig's channels.

    Attributes
    ----------
    file : Path
    rate : float
        Hz, of samples.
    watchdog : float
        s, how long the rig goes on without a fresh command.
    inputs, outputs : dict of str to Channel
        By signal.
    limits : dict of str to Limit
        SI, of every input, and of outputs that have some.
    instruments : dict of str to Instrument
    """

    file: Path
    rate: float
    watchdog: float
    inputs: dict[str, Channel]
    outputs: dict[str, Channel]
    limits: dict[str, Limit]
    instruments: dict[str, Instrument] = field(default_factory=dict)


def presets() -> dict[str, Path]:
    """Return the calibrations that ship, by name."""
    return {file.stem: file for file in sorted(_PRESETS.glob("*.toml"))}


def read_calibration(name_or_path: str) -> Calibration:
    """Read a calibration.

    Parameters
    ----------
    name_or_path : str
        Name of one that ships, or a ``.toml`` file.

    Returns
    -------
    Calibration

    Raises
    ------
    UserError
        If there is none, or something in it is missing or wrong: file, table, key, value, and what is allowed.
    """
    known = presets()
    path = known.get(name_or_path, Path(name_or_path))
    if not path.is_file():
        hint = suggestion(name_or_path, list(known)) if not path.suffix else ""
        raise UserError(f"{name_or_path}: no such calibration file or preset{hint}")
    top = Table.read(path)
    rig = top.table("rig")
    rate, watchdog = rig.number("rate", above=0.0), rig.number("watchdog", above=0.0)
    rig.finish()
    instruments = {
        name: _instrument(name, table) for name, table in top.tables("instruments").items()
    }
    inputs = {
        name: _channel(name, table, "write", instruments)
        for name, table in top.tables("inputs").items()
    }
    outputs = {
        name: _channel(name, table, "query", instruments)
        for name, table in top.tables("outputs").items()
    }
    limits = {name: channel.reachable() for name, channel in inputs.items()}
    for name, table in top.tables("limits").items():
        if name not in inputs and name not in outputs:
            raise UserError(
                f"{path}: [limits.{name}]: no such signal{suggestion(name, [*inputs, *outputs])}"
            )
        limits[name] = _limit(table, {**outputs, **inputs}[name], is_command=name in inputs)
    top.finish()
    for name, channel in inputs.items():
        if name in outputs:
            raise UserError(
                f"{path}: [outputs.{name}]: is an input, too; a measured one needs a name of its own"
            )
        if not limits[name].min <= channel.safe <= limits[name].max:
            raise UserError(
                f"{path}: [inputs.{name}] safe = {channel.safe:g} {channel.unit}: is beyond its limits"
            )
    return Calibration(path, rate, watchdog, inputs, outputs, limits, instruments)


def _channel(name: str, table: Table, verb: str, instruments: dict[str, Instrument]) -> Channel:
    unit = table.text("unit")
    si = table.text("si", UNITS.get(name, unit))
    try:
        one, zero = (float(units.convert(v, unit, si, name)) for v in (1.0, 0.0))
        base = units.base_unit(si)
    except UserError as error:
        raise table.wrong("unit", str(error)) from error
    if (base.factor, base.offset) != (1.0, 0.0):
        raise table.wrong(
            "unit", f"{name} is not known by name, so write its SI unit, too: si = ..."
        )
    place, command = _place(table, verb, instruments)
    gain, offset = table.number("gain"), table.number("offset", 0.0)
    if gain == 0.0:
        raise table.wrong("gain", "must not be zero")
    low, high = table.interval("range")
    sign = table.choice("sign", 1, (1, -1))
    # absolute: a safe temperature of 20 degC is one of 293.15 K
    safe = (one - zero) * table.number("safe", 0.0) + zero if verb == "write" else 0.0
    terminal = table.choice("terminal", "default", TERMINALS) if verb == "query" else "default"
    channel = Channel(
        name,
        si,
        place,
        command,
        terminal,
        gain,
        offset,
        sign,
        low,
        high,
        safe,
        one - zero,
        zero,
        table.date("date"),
        table.text("source", "not stated"),
    )
    table.finish()
    return channel


def _place(table: Table, verb: str, instruments: dict[str, Instrument]) -> tuple[str, str]:
    """Return where a signal is, and the message that an instrument needs."""
    if "instrument" not in table:
        return table.text("channel"), ""
    instrument = table.text("instrument")
    if instrument not in instruments:
        raise table.wrong("instrument", f"there is no [instruments.{instrument}]")
    command = table.text(verb)
    if verb == "write":
        try:
            formatted = command.format(volts=0.125)
        except (LookupError, ValueError) as error:
            raise table.wrong(
                verb, "a message is wanted with {volts} where the number goes"
            ) from error
        if formatted == command:
            raise table.wrong(verb, "a message is wanted with {volts} where the number goes")
    return instrument, command


def _instrument(name: str, table: Table) -> Instrument:
    instrument = Instrument(
        name,
        table.text("resource"),
        table.number("timeout", 0.5, above=0.0),
        table.texts("setup"),
        table.texts("safe"),
        table.text("error") if "error" in table else "",
        table.text("termination", "\n"),
    )
    if instrument.timeout > 5.0:
        raise table.wrong("timeout", "at most 5 s, for the rig waits that long")
    table.finish()
    return instrument


def _limit(table: Table, channel: Channel, is_command: bool) -> Limit:
    """Read limits; those of a command may not be beyond what its channel can do."""
    unit = table.text("unit", channel.unit)
    try:
        one, zero = (float(units.convert(v, unit, channel.unit, channel.name)) for v in (1.0, 0.0))
    except UserError as error:
        raise table.wrong("unit", str(error)) from error
    reach = channel.reachable()
    given = [table.maybe("min"), table.maybe("max"), table.maybe("rate", above=0.0)]
    defaults = (reach.min, reach.max) if is_command else (-math.inf, math.inf)
    bounds = [
        default if bound is None else (one - zero) * bound + zero
        for bound, default in zip(given, defaults, strict=False)
    ]
    rate = math.inf if given[2] is None else (one - zero) * given[2]
    if not bounds[0] < bounds[1]:
        raise table.wrong(
            "max" if "max" in table else "min", "the lower limit must be below the upper one"
        )
    room = _ROUNDING * (reach.max - reach.min)
    for key, bound in zip(("min", "max"), bounds, strict=True):
        if is_command and not reach.min - room <= bound <= reach.max + room:
            able = f"{reach.min:.6g} … {reach.max:.6g} {channel.unit}"
            raise table.wrong(key, f"the range of {channel.place} allows {able} only")
    table.finish()
    return Limit(bounds[0], bounds[1], rate)
