"""Calibration of a rig: a TOML file with the meaning of every channel's volts.

``value = sign * (gain * volts + offset)`` in the unit of the channel, converted to SI; commands go
the other way. Every factor has a date and a source.
"""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    InstanceOf,
    ValidationError,
)

from fmus.kit import registry, units
from fmus.kit.errors import UserError, suggestion
from fmus.kit.files import is_file
from orchestration.experiment.values import read_toml
from orchestration.rig.signals import UNITS, Limit

_ROUNDING = 1e-9  # of a range, by which a command may be beyond it
_LONGEST_VALUE = 60  # characters of a value in a message
TERMINALS = ("default", "differential", "referenced", "non-referenced")
# Loading the units takes a quarter of a second, which a process that reopens a rig in an emergency
# must not lose.
units.registry()

# ---- types of values; the description names the allowed values, and every refusal ends with it
# --------------------------------------------------------------------------------------------------

_FIRST = re.compile("([^,]*)")  # of the values in an answer, which SCPI puts commas between
_TWO_NUMBERS = "[low, high] of two finite numbers is wanted, the lower one first"


def _one_of(*allowed: Any) -> BeforeValidator:
    """Return a validator of one of these values, of the same type: 1.0 and True are not 1."""

    def check(value: Any) -> Any:
        if not any(value == one and type(value) is type(one) for one in allowed):
            raise ValueError(f"allowed are {', '.join(map(repr, allowed))}")
        return value

    return BeforeValidator(check)


def _check_not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("must not be zero")
    return value


def _check_rising(bounds: tuple[float, float]) -> tuple[float, float]:
    if not bounds[0] < bounds[1]:
        raise ValueError(_TWO_NUMBERS)
    return bounds


def _check_one_group(pattern: re.Pattern[str]) -> re.Pattern[str]:
    if pattern.groups != 1:
        raise ValueError("one group in parentheses is wanted, which finds the number")
    return pattern


Number = Annotated[
    float, Field(strict=True, allow_inf_nan=False, description="a finite number is wanted")
]
Positive = Annotated[Number, Field(gt=0.0, description="a finite number above 0 is wanted")]
Timeout = Annotated[
    Positive,
    Field(
        le=5.0,
        description="a finite number above 0 and at most 5 s is wanted, as the rig waits that long",
    ),
]
Text = Annotated[str, Field(strict=True, pattern=r"\S", description="a text is wanted")]
Texts = Annotated[
    tuple[Annotated[str, Field(strict=True)], ...], Field(description="a list of texts is wanted")
]
Ending = Annotated[str, Field(strict=True, min_length=1, description="a text is wanted")]
_REGULAR = Field(description="a valid regular expression is wanted")
Baudrate = Annotated[
    int | None, Field(strict=True, gt=0, description="a whole number above 0 is wanted")
]
Framing = Annotated[
    str,
    Field(
        strict=True,
        pattern="^[5-8][NEO][12]$",
        description="data bits, parity (N, E or O) and stop bits are wanted, such as 8N1",
    ),
]
Interval = Annotated[
    tuple[Number, Number], AfterValidator(_check_rising), Field(description=_TWO_NUMBERS)
]
Date = Annotated[
    InstanceOf[datetime.date], Field(description="a date is wanted, such as 2007-05-01")
]
TableByName = dict[str, dict[str, Any]]


# ---- tables of the file
# --------------------------------------------------------------------------------------------------


class TomlTable(BaseModel):
    """One table of a calibration file, in which only known keys are allowed."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class _FileTable(TomlTable):
    rig: dict[str, Any] = Field(default={}, description="a table is wanted, [rig]")
    instruments: TableByName = Field(
        default={}, description="tables are wanted, such as [instruments.generator]"
    )
    inputs: TableByName = Field(
        default={}, description="tables are wanted, such as [inputs.current]"
    )
    outputs: TableByName = Field(
        default={}, description="tables are wanted, such as [outputs.voltage]"
    )
    limits: TableByName = Field(
        default={}, description="tables are wanted, such as [limits.current]"
    )


class _RigTable(TomlTable):
    rate: Positive
    watchdog: Positive


class _ChannelTable(TomlTable):
    verb: ClassVar[str]
    unit: Text
    si: Text = ""
    channel: Text = ""
    instrument: Text = ""
    gain: Annotated[Number, AfterValidator(_check_not_zero)]
    offset: Number = 0.0
    range: Interval
    sign: Annotated[int, _one_of(1, -1)] = 1
    date: Date
    source: Text = "not stated"
    query: Text = ""

    @property
    def message(self) -> str:
        """Message that commands an instrument, or asks it for its value."""
        text: str = getattr(self, self.verb)
        return text


class _InputTable(_ChannelTable):
    verb: ClassVar[str] = "write"
    terminal: ClassVar[str] = "default"
    write: Text = ""
    safe: Number = 0.0


class _OutputTable(_ChannelTable):
    verb: ClassVar[str] = "query"
    terminal: Annotated[str, _one_of(*TERMINALS)] = "default"


class _LimitTable(TomlTable):
    unit: Text = ""
    min: Number = -math.inf
    max: Number = math.inf
    rate: Positive = math.inf


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
    answer: Annotated[re.Pattern[str], AfterValidator(_check_one_group), _REGULAR] = _FIRST
    reply: Annotated[re.Pattern[str] | None, _REGULAR] = None
    baudrate: Baudrate = None
    framing: Framing = "8N1"


# ---- a calibration
# --------------------------------------------------------------------------------------------------


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
        Gain in the channel's own unit per volt, and offset in that unit.
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
        return self.factor * (self.sign * (self.gain * volts + self.offset)) + self.zero

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
        raw = (self.sign * ((value - self.zero) / self.factor) - self.offset) / self.gain
        room = _ROUNDING * (self.high - self.low)
        if not self.low - room <= raw <= self.high + room:
            raise UserError(
                f"{self.name} = {value:.6g} {self.unit} needs {raw:.6g} at {self.place}, "
                f"whose range is {self.low:g} … {self.high:g}"
            )
        return min(max(raw, self.low), self.high)

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


def read_calibration(name_or_path: str) -> Calibration:
    """Read a calibration.

    Parameters
    ----------
    name_or_path : str
        Name of one that a package of components brings, or a ``.toml`` file.

    Returns
    -------
    Calibration

    Raises
    ------
    UserError
        If there is none, or something in it is missing or wrong: file, table, key, value, and what
        is allowed.
    """
    known = registry.presets()
    path = known.get(name_or_path, Path(name_or_path))
    if not is_file(path):
        hint = suggestion(name_or_path, list(known)) if not path.suffix else ""
        raise UserError(f"{path}: no such calibration file or preset{hint}")
    file = _checked(_FileTable, read_toml(path), f"{path}: ")
    rig = _checked(_RigTable, file.rig, f"{path}: [rig] ")
    instruments = {
        name: _checked(Instrument, values, f"{path}: [instruments.{name}] ")
        for name, values in file.instruments.items()
    }
    inputs = _read_channels(_InputTable, file.inputs, instruments, f"{path}: [inputs")
    outputs = _read_channels(_OutputTable, file.outputs, instruments, f"{path}: [outputs")
    limits = _read_limits(file.limits, inputs, outputs, path)
    _check_inputs(inputs, outputs, limits, path)
    return Calibration(path, rig.rate, rig.watchdog, inputs, outputs, limits, instruments)


def _check_inputs(
    inputs: dict[str, Channel], outputs: dict[str, Channel], limits: dict[str, Limit], path: Path
) -> None:
    """Refuse an input that is also an output, or whose safe value is beyond its limits."""
    for name, channel in inputs.items():
        if name in outputs:
            raise UserError(
                f"{path}: [outputs.{name}]: is an input, too; a measured one needs a name of"
                " its own"
            )
        if not limits[name].min <= channel.safe <= limits[name].max:
            raise UserError(
                f"{path}: [inputs.{name}] safe = {channel.safe:g} {channel.unit}: is beyond its"
                " limits"
            )


def _read_channels(
    kind: type[_InputTable] | type[_OutputTable],
    tables: TableByName,
    instruments: Mapping[str, Instrument],
    group: str,
) -> dict[str, Channel]:
    """Return the channels of the tables of a group, such as ``[inputs.current]``, by name."""
    channels = {}
    for name, values in tables.items():
        where = f"{group}.{name}] "
        channels[name] = _read_channel(name, _checked(kind, values, where), instruments, where)
    return channels


def _read_channel(
    name: str,
    table: _InputTable | _OutputTable,
    instruments: Mapping[str, Instrument],
    where: str,
) -> Channel:
    """Return the channel that a table of the file describes."""
    unit, factor, zero = _conversion_to_si(name, table, where)
    # absolute: a safe temperature of 20 degC is one of 293.15 K
    safe = factor * table.safe + zero if isinstance(table, _InputTable) else 0.0
    low, high = table.range
    return Channel(
        name=name,
        unit=unit,
        place=_checked_place(table, instruments, where),
        command=table.message,
        query=table.query if isinstance(table, _InputTable) else "",
        terminal=table.terminal,
        gain=table.gain,
        offset=table.offset,
        sign=table.sign,
        low=low,
        high=high,
        safe=safe,
        factor=factor,
        zero=zero,
        date=table.date,
        source=table.source,
    )


def _conversion_to_si(name: str, table: _ChannelTable, where: str) -> tuple[str, float, float]:
    """Return the SI unit of a signal, and factor and zero that convert the channel's unit to it."""
    si = table.si or UNITS.get(name, table.unit)
    try:
        factor, zero = _conversion(table.unit, si, name)
        base = units.base_unit(si)
    except UserError as error:
        raise _value_error(where, "unit", table.unit, str(error)) from error
    if (base.factor, base.offset) != (1.0, 0.0):
        allowed = f"{name} is not known by name, so write its SI unit, too: si = ..."
        raise _value_error(where, "unit", table.unit, allowed)
    return si, factor, zero


def _conversion(unit: str, si: str, name: str) -> tuple[float, float]:
    """Return factor and zero of a conversion between units: ``si = factor * value + zero``."""
    one = float(units.convert(1.0, unit, si, name))
    zero = float(units.convert(0.0, unit, si, name))
    return one - zero, zero


def _checked_place(
    table: _InputTable | _OutputTable, instruments: Mapping[str, Instrument], where: str
) -> str:
    """Return the channel of a device, or the name of an instrument, that has a signal."""
    if not table.instrument:
        if not table.channel:
            raise _value_error(where, "channel", None, "a text is wanted")
        for verb, message in ((table.verb, table.message), ("query", table.query)):
            if message:
                raise _value_error(where, verb, message, "needs an instrument = ...")
        return table.channel
    if table.channel:
        allowed = "a signal is either on a channel of a device or on an instrument"
        raise _value_error(where, "channel", table.channel, allowed)
    if table.instrument not in instruments:
        allowed = f"there is no [instruments.{table.instrument}]"
        raise _value_error(where, "instrument", table.instrument, allowed)
    if not table.message:
        raise _value_error(where, table.verb, None, "a text is wanted")
    if isinstance(table, _InputTable) and not _takes_a_number(table.message):
        allowed = "a message is wanted with {volts} where the number goes"
        raise _value_error(where, table.verb, table.message, allowed)
    return table.instrument


def _takes_a_number(message: str) -> bool:
    """Return whether a message has a valid place for the volts, with which it becomes another."""
    try:
        return message.format(volts=0.125) != message
    except (LookupError, ValueError):
        return False


def _read_limits(
    tables: TableByName, inputs: dict[str, Channel], outputs: dict[str, Channel], path: Path
) -> dict[str, Limit]:
    """Return the limits by signal; those of a command without a table are its channel's range."""
    limits = {name: channel.reachable() for name, channel in inputs.items()}
    for name, values in tables.items():
        where = f"{path}: [limits.{name}]"
        if name not in inputs and name not in outputs:
            raise UserError(f"{where}: no such signal{suggestion(name, [*inputs, *outputs])}")
        table = _checked(_LimitTable, values, f"{where} ")
        if name in inputs:
            limits[name] = _command_limit(table, inputs[name], f"{where} ")
        else:
            limits[name] = _limit_in_si(table, outputs[name], Limit(), f"{where} ")
    return limits


def _command_limit(table: _LimitTable, channel: Channel, where: str) -> Limit:
    """Return the limits of a command, which must lie within the range of its channel."""
    reach = channel.reachable()
    limit = _limit_in_si(table, channel, reach, where)
    room = _ROUNDING * (reach.max - reach.min)
    for key in ("min", "max"):
        if not reach.min - room <= getattr(limit, key) <= reach.max + room:
            able = f"{reach.min:.6g} … {reach.max:.6g} {channel.unit}"
            allowed = f"the range of {channel.place} allows {able} only"
            raise _value_error(where, key, getattr(table, key), allowed)
    return limit


def _limit_in_si(table: _LimitTable, channel: Channel, default: Limit, where: str) -> Limit:
    """Return limits in SI, with defaults where the table has none."""
    try:
        factor, zero = _conversion(table.unit or channel.unit, channel.unit, channel.name)
    except UserError as error:
        raise _value_error(where, "unit", table.unit, str(error)) from error
    given = table.model_fields_set
    least = factor * table.min + zero if "min" in given else default.min
    greatest = factor * table.max + zero if "max" in given else default.max
    rate = factor * table.rate if "rate" in given else math.inf
    if not least < greatest:
        key = "max" if "max" in given else "min"
        allowed = "the lower limit must be below the upper one"
        raise _value_error(where, key, getattr(table, key), allowed)
    return Limit(least, greatest, rate)


# ---- refusals
# --------------------------------------------------------------------------------------------------

AnyTable = TypeVar("AnyTable", bound=TomlTable)


def _checked(kind: type[AnyTable], values: Mapping[str, Any], where: str) -> AnyTable:
    """Check the values of a table.

    Parameters
    ----------
    kind : type
    values : Mapping of str to object
        Values of the table as TOML has them.
    where : str
        File and table, for the message.

    Returns
    -------
    TomlTable

    Raises
    ------
    UserError
        About the first key that is unknown, missing or wrong.
    """
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        key = str(problem["loc"][0])
        if problem["type"] == "extra_forbidden":
            allowed = f"there is no such key{suggestion(key, list(kind.model_fields))}"
        elif problem["type"] == "value_error":
            allowed = str(problem["ctx"]["error"])
        else:
            allowed = str(kind.model_fields[key].description)
        raise _value_error(where, key, values.get(key), allowed) from error


def _value_error(where: str, key: str, value: Any, allowed: str) -> UserError:
    """Return the error for the value of a key; a value of None is missing in the file."""
    if value is None:
        return UserError(f"{where}{key} is missing: {allowed}")
    if isinstance(value, float):
        text = f"{value:.15g}"
    else:
        text = repr(value) if isinstance(value, (str, list)) else str(value)
    if len(text) > _LONGEST_VALUE:
        text = text[: _LONGEST_VALUE - 3] + "..."
    return UserError(f"{where}{key} = {text}: {allowed}")
