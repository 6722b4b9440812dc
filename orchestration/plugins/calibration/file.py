"""Calibration of a rig: a TOML file with the meaning of every channel's volts.

``value = sign * (gain * reading + offset)`` in the unit of the channel, converted to SI; commands
go the other way. The reading is the sensor's signal, or what a conversion makes of it. Every factor
has a date and a source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fmus.kit import registry, units
from fmus.kit.errors import UserError, suggestion
from fmus.kit.files import is_file
from orchestration.experiment.values import read_toml
from orchestration.plugins.calibration.channels import ROUNDING, Calibration, Channel, Instrument
from orchestration.plugins.calibration.conversions import (
    CIRCUITS,
    CONVERSIONS,
    Conversion,
    Divider,
    is_monotonic,
)
from orchestration.plugins.calibration.values import (
    Date,
    Interval,
    NotNegative,
    NotZero,
    Number,
    Positive,
    TableByName,
    Text,
    TomlTable,
    checked,
    one_of,
    value_error,
)
from orchestration.rig.signals import UNITS, Limit

TERMINALS = ("default", "differential", "referenced", "non-referenced")
# Loading the units takes a quarter of a second, which a process that reopens a rig in an emergency
# must not lose.
units.registry()
_DIVIDER = "a table is wanted, such as { supply = 5.0, resistor = 10e3 }"
_CONVERSION = (
    "one table is wanted, such as conversion.rtd = { r0 = 100.0 }; there are "
    + ", ".join(CONVERSIONS)
)


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
    amplification: NotZero = 1.0
    excitation: Positive = math.nan
    current: Positive = 1.0
    divider: Annotated[dict[str, Any], Field(description=_DIVIDER)] = {}
    conversion: Annotated[TableByName, Field(max_length=1, description=_CONVERSION)] = {}
    gain: NotZero = math.nan
    offset: Number = 0.0
    range: Interval
    sign: Annotated[int, one_of(1, -1)] = 1
    uncertainty: NotNegative = math.nan
    relative_uncertainty: NotNegative = 0.0
    date: Date
    source: Text = "not stated"
    by: Text = ""
    points: Annotated[
        tuple[tuple[Number, Number], ...],
        Field(description="a list of [known value, reading] is wanted"),
    ] = ()
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
    terminal: Annotated[str, one_of(*TERMINALS)] = "default"


class _LimitTable(TomlTable):
    unit: Text = ""
    min: Number = -math.inf
    max: Number = math.inf
    rate: Positive = math.inf


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
        If there is none, or something in it is missing or wrong.
    """
    known = registry.presets()
    path = known.get(name_or_path, Path(name_or_path))
    if not is_file(path):
        hint = suggestion(name_or_path, list(known)) if not path.suffix else ""
        raise UserError(f"{path}: no such calibration file or preset{hint}")
    return parse_calibration(read_toml(path), path)


def parse_calibration(values: Mapping[str, Any], path: Path) -> Calibration:
    """Check the values of a calibration file.

    Parameters
    ----------
    values : Mapping of str to object
        Values of the file as TOML has them.
    path : Path
        The file, for messages.

    Returns
    -------
    Calibration

    Raises
    ------
    UserError
        If something is missing or wrong: file, table, key, value, and what is allowed.
    """
    file = checked(_FileTable, values, f"{path}: ")
    rig = checked(_RigTable, file.rig, f"{path}: [rig] ")
    instruments = {
        name: checked(Instrument, values, f"{path}: [instruments.{name}] ")
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
        channels[name] = _read_channel(name, checked(kind, values, where), instruments, where)
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
    conversion = _conversion(table, where)
    if conversion is None and math.isnan(table.gain):
        raise value_error(where, "gain", None, "a finite number is wanted")
    if table.relative_uncertainty and zero:
        allowed = f"is no part of a value in {table.unit}, which has an arbitrary zero"
        raise value_error(where, "relative_uncertainty", table.relative_uncertainty, allowed)
    channel = Channel(
        name=name,
        unit=unit,
        place=_checked_place(table, instruments, where),
        command=table.message,
        query=table.query if isinstance(table, _InputTable) else "",
        terminal=table.terminal,
        gain=1.0 if math.isnan(table.gain) else table.gain,
        offset=table.offset,
        sign=table.sign,
        low=low,
        high=high,
        safe=safe,
        factor=factor,
        zero=zero,
        date=table.date,
        source=table.source,
        own_unit=table.unit,
        scale=_scale(table, where),
        divider=checked(Divider, table.divider, f"{where}divider.") if table.divider else None,
        conversion=conversion,
        uncertainty=abs(factor) * table.uncertainty,
        relative_uncertainty=table.relative_uncertainty,
    )
    values = channel.sampled()
    if not any(map(math.isfinite, values)):
        allowed = "no volts in it have a value, by this conversion in this circuit"
        raise value_error(where, "range", list(table.range), allowed)
    if isinstance(table, _InputTable) and not is_monotonic(values):
        allowed = "a command needs a value that rises or falls over all of it"
        raise value_error(where, "range", list(table.range), allowed)
    return channel


def _scale(table: _ChannelTable, where: str) -> float:
    """Return the signal of a sensor per volt, in V, mV/V or ohm; a divider needs the volts."""
    circuits = sorted(CIRCUITS & table.model_fields_set)
    if len(circuits) > 1:
        allowed = f"is one circuit, and {circuits[0]} another; a channel has one"
        raise value_error(where, circuits[1], getattr(table, circuits[1]), allowed)
    per_volt = 1.0 / (table.amplification * table.current)
    return per_volt * 1e3 / table.excitation if "excitation" in circuits else per_volt


def _conversion(table: _ChannelTable, where: str) -> Conversion | None:
    """Return the conversion of a channel, which must give its unit."""
    for kind, values in table.conversion.items():
        key = f"conversion.{kind}"
        if kind not in CONVERSIONS:
            allowed = f"there is no such conversion{suggestion(kind, list(CONVERSIONS))}"
            raise value_error(where, key, values, allowed)
        conversion = checked(CONVERSIONS[kind], values, f"{where}{key}.")
        if conversion.unit not in ("", table.unit):
            raise value_error(where, "unit", table.unit, f"{key} gives {conversion.unit}")
        for circuit in (CIRCUITS & table.model_fields_set) - conversion.circuits:
            raise value_error(where, circuit, getattr(table, circuit), f"is no circuit for {key}")
        return conversion
    return None


def _conversion_to_si(name: str, table: _ChannelTable, where: str) -> tuple[str, float, float]:
    """Return the SI unit of a signal, and factor and zero that convert the channel's unit to it."""
    si = table.si or UNITS.get(name, table.unit)
    try:
        factor, zero = _factor_and_zero(table.unit, si, name)
        base = units.base_unit(si)
    except UserError as error:
        raise value_error(where, "unit", table.unit, str(error)) from error
    if (base.factor, base.offset) != (1.0, 0.0):
        allowed = f"{name} is not known by name, so write its SI unit, too: si = ..."
        raise value_error(where, "unit", table.unit, allowed)
    return si, factor, zero


def _factor_and_zero(unit: str, si: str, name: str) -> tuple[float, float]:
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
            raise value_error(where, "channel", None, "a text is wanted")
        for verb, message in ((table.verb, table.message), ("query", table.query)):
            if message:
                raise value_error(where, verb, message, "needs an instrument = ...")
        return table.channel
    if table.channel:
        allowed = "a signal is either on a channel of a device or on an instrument"
        raise value_error(where, "channel", table.channel, allowed)
    if table.instrument not in instruments:
        allowed = f"there is no [instruments.{table.instrument}]"
        raise value_error(where, "instrument", table.instrument, allowed)
    if not table.message:
        raise value_error(where, table.verb, None, "a text is wanted")
    if isinstance(table, _InputTable) and not _takes_a_number(table.message):
        allowed = "a message is wanted with {volts} where the number goes"
        raise value_error(where, table.verb, table.message, allowed)
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
        table = checked(_LimitTable, values, f"{where} ")
        if name in inputs:
            limits[name] = _command_limit(table, inputs[name], f"{where} ")
        else:
            limits[name] = _limit_in_si(table, outputs[name], Limit(), f"{where} ")
    return limits


def _command_limit(table: _LimitTable, channel: Channel, where: str) -> Limit:
    """Return the limits of a command, which must lie within the range of its channel."""
    reach = channel.reachable()
    limit = _limit_in_si(table, channel, reach, where)
    room = ROUNDING * (reach.max - reach.min)
    for key in ("min", "max"):
        if not reach.min - room <= getattr(limit, key) <= reach.max + room:
            able = f"{reach.min:.6g} … {reach.max:.6g} {channel.unit}"
            allowed = f"the range of {channel.place} allows {able} only"
            raise value_error(where, key, getattr(table, key), allowed)
    return limit


def _limit_in_si(table: _LimitTable, channel: Channel, default: Limit, where: str) -> Limit:
    """Return limits in SI, with defaults where the table has none."""
    try:
        factor, zero = _factor_and_zero(table.unit or channel.unit, channel.unit, channel.name)
    except UserError as error:
        raise value_error(where, "unit", table.unit, str(error)) from error
    given = table.model_fields_set
    least = factor * table.min + zero if "min" in given else default.min
    greatest = factor * table.max + zero if "max" in given else default.max
    rate = factor * table.rate if "rate" in given else math.inf
    if not least < greatest:
        key = "max" if "max" in given else "min"
        allowed = "the lower limit must be below the upper one"
        raise value_error(where, key, getattr(table, key), allowed)
    return Limit(least, greatest, rate)
