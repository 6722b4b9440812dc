"""Calibration of a rig: a TOML file with the meaning of every channel's volts.

``value = sign * (gain * reading + offset)`` in the unit of the channel, converted to SI; commands
go the other way. The reading is the sensor's signal, or what a conversion makes of it. Every factor
has a date and a source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import Field

from fmus.kit import registry, units
from fmus.kit.errors import UserError, suggestion
from fmus.kit.files import is_file
from orchestration.experiment.values import read_toml
from orchestration.plugins.calibration.channels import (
    Calibration,
    Channel,
    CommandChannel,
    Instrument,
    MeasuredChannel,
    factor_and_zero,
)
from orchestration.plugins.calibration.values import (
    Interval,
    Number,
    Positive,
    Text,
    TomlTable,
    checked,
    value_error,
)
from orchestration.rig.signals import UNITS, Limit

_Tables = Annotated[
    dict[str, dict[str, Any]],
    Field(description="tables with a name are wanted, such as [inputs.current]"),
]
_AnyChannel = TypeVar("_AnyChannel", bound=Channel)


class _FileTable(TomlTable):
    rig: Annotated[dict[str, Any], Field(description="a table is wanted, [rig]")] = {}
    instruments: _Tables = {}
    inputs: _Tables = {}
    outputs: _Tables = {}
    limits: _Tables = {}


class _RigTable(TomlTable):
    rate: Positive
    watchdog: Positive
    heartbeat: Text = ""


class _LimitTable(TomlTable):
    unit: Text = ""
    min: Number = -math.inf
    max: Number = math.inf
    rate: Positive = math.inf
    warn: Interval = (-math.inf, math.inf)


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
        name: checked(Instrument, table, f"{path}: [instruments.{name}] ")
        for name, table in file.instruments.items()
    }
    inputs = {
        name: _read_channel(CommandChannel, name, table, instruments, f"{path}: [inputs.{name}] ")
        for name, table in file.inputs.items()
    }
    outputs = {
        name: _read_channel(MeasuredChannel, name, table, instruments, f"{path}: [outputs.{name}] ")
        for name, table in file.outputs.items()
    }
    for name in outputs.keys() & inputs.keys():
        raise UserError(
            f"{path}: [outputs.{name}]: is an input, too; a measured one needs a name of its own"
        )
    limits = {name: channel.reach for name, channel in inputs.items()}
    channels: dict[str, Channel] = {**inputs, **outputs}
    for name, table in file.limits.items():
        where = f"{path}: [limits.{name}]"
        if name not in channels:
            raise UserError(f"{where}: no such signal{suggestion(name, list(channels))}")
        reach = limits.get(name, Limit())
        limits[name] = _read_limit(table, channels[name], reach, f"{where} ")
    for name, channel in inputs.items():
        if not limits[name].min <= channel.safe_value <= limits[name].max:
            raise UserError(
                f"{path}: [inputs.{name}] safe = {channel.safe:g} {channel.unit}: is beyond its"
                " limits"
            )
    return Calibration(
        path, rig.rate, rig.watchdog, rig.heartbeat, inputs, outputs, limits, instruments
    )


def _read_channel(
    kind: type[_AnyChannel],
    name: str,
    table: Mapping[str, Any],
    instruments: Mapping[str, Instrument],
    where: str,
) -> _AnyChannel:
    """Return the channel that a table of the file describes."""
    if "name" in table:
        raise value_error(where, "name", table["name"], "there is no such key")
    si = UNITS.get(name, table.get("unit"))
    channel = checked(kind, {"si": si, **table, "name": name}, where)
    try:
        base = units.base_unit(channel.si)
        factor_and_zero(channel.unit, channel.si, name)
    except UserError as error:
        raise value_error(where, "unit", channel.unit, str(error)) from error
    if (base.factor, base.offset) != (1.0, 0.0):
        allowed = f"{name} is not known by name, so write its SI unit, too: si = ..."
        raise value_error(where, "unit", channel.unit, allowed)
    no_instrument = channel.instrument and channel.instrument not in instruments
    unknown = f"there is no [instruments.{channel.instrument}]"
    for key, is_wrong, allowed in (("instrument", no_instrument, unknown), *channel.rules()):
        if is_wrong:
            raise value_error(where, key, table.get(key), allowed)
    return channel


def _read_limit(table: Mapping[str, Any], channel: Channel, reach: Limit, where: str) -> Limit:
    """Return limits in SI within what a command can reach, without bounds for a measured value."""
    given = checked(_LimitTable, table, where)
    try:
        factor, zero = factor_and_zero(given.unit or channel.unit, channel.si, channel.name)
    except UserError as error:
        raise value_error(where, "unit", given.unit, str(error)) from error
    least, greatest, *warn = (
        factor * bound + zero for bound in (given.min, given.max, *given.warn)
    )
    if isinstance(channel, CommandChannel):
        if "warn" in table:
            raise value_error(where, "warn", table["warn"], "is of a measured signal")
        for key, bound in (("min", least), ("max", greatest)):
            if key in table and (allowed := channel.refusal(bound)):
                raise value_error(where, key, table[key], allowed)
    limit = Limit(max(least, reach.min), min(greatest, reach.max), factor * given.rate, *warn)
    if not limit.min < limit.max:
        raise value_error(where, "max", table.get("max"), "must be above the lower limit")
    return limit
