"""Bits and registers of Modbus, as the channels of a calibration name them.

A channel is a table and the address that the protocol has, counted from 0; of registers the type
too, and ``little`` where the low word comes first: ``coil 3``, ``discrete 0``, ``input 7 int16``,
``holding 100 float32``, ``holding 4 int32 little``. Volts are the number in the registers, and 0 or
1 of a bit.
"""

from __future__ import annotations

import re
import struct
from typing import Any

from pymodbus.client import ModbusTcpClient

from fmus.kit import UserError
from orchestration.plugins.calibration import Channel

# of a table, the requests that read it, and that write one place of it
_TABLES = {
    "coil": ("read_coils", "write_coil"),
    "discrete": ("read_discrete_inputs", ""),
    "holding": ("read_holding_registers", "write_register"),
    "input": ("read_input_registers", ""),
}
_LAST = 65535  # address
_TYPES = {one.name.lower(): one for one in ModbusTcpClient.DATATYPE if one.value[1]}
_PLACE = re.compile(rf"(\w+) (\d{{1,5}})(?: ({'|'.join(_TYPES)})(?: (little))?)?", re.ASCII)


class Place:
    """The bit or the registers of a channel.

    Parameters
    ----------
    channel : Channel
    written : bool
        True for a command.

    Raises
    ------
    UserError
        If the channel names none, or one that cannot be written or does not hold its range.

    Attributes
    ----------
    reads, writes : str
        Requests of a client of pymodbus.
    address, count : int
        Of the first register, and how many there are.
    """

    def __init__(self, channel: Channel, *, written: bool = False) -> None:
        self.channel = channel
        tables = [table for table, (_, writes) in _TABLES.items() if writes or not written]
        found = _PLACE.fullmatch(channel.place)
        is_bit = found is not None and found[1] in ("coil", "discrete")
        is_place = found is not None and found[1] in tables and int(found[2]) <= _LAST
        if found is None or not is_place or is_bit != (found[3] is None):
            raise UserError(
                f"{channel.name}: channel = {channel.place!r}: {' or '.join(tables)} is wanted, an"
                f" address up to {_LAST}, and of registers a type of {', '.join(_TYPES)}"
            )
        self.reads, self.writes = _TABLES[found[1]]
        self.address = int(found[2])
        self.count: int = 1 if is_bit else _TYPES[found[3]].value[1]
        self._type: Any = _TYPES.get(found[3])
        self._order: Any = found[4] or "big"
        for end in channel.range if written else ():
            self.encode(end)

    def encode(self, number: float) -> list[Any]:
        """Return a bit, or the words of registers; UserError if they do not hold the number."""
        if self._type is None:
            return [number >= 0.5]
        value = number if self._type.name.startswith("FLOAT") else round(number)
        try:
            return ModbusTcpClient.convert_to_registers(value, self._type, self._order)
        except (struct.error, OverflowError) as error:
            raise UserError(
                f"{self.channel.name}: {value:g} is beyond what {self.channel.place} holds"
            ) from error

    def decode(self, answer: Any) -> float:
        """Return the number in an answer."""
        if self._type is None:
            return float(answer.bits[0])
        number: Any = ModbusTcpClient.convert_from_registers(
            answer.registers, self._type, self._order
        )
        return float(number)
