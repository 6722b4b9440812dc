"""Ring in shared memory: the last records of one writer, for the archive.

The writer waits for nobody and knows no reader. It writes over the oldest record; a reader that was
too slow knows by the numbers how many it has missed. A record that is being written, or whose
writer was killed, has a wrong checksum.
"""

from __future__ import annotations

import struct
from time import monotonic
from typing import Any, Generic, NamedTuple, TypeVar
from zlib import crc32

LENGTH = 4096  # records: four seconds of samples at the highest rate
_CHECKSUM = struct.Struct("<I")
_INTACT = crc32(_CHECKSUM.pack(crc32(b"")))  # of any bytes with their own checksum behind them
_STAMP = "<Qd"  # number, time
Record = TypeVar("Record", bound=tuple[Any, ...])


class Entry(NamedTuple):
    """A record of a ring, with its number from 1 on and the monotonic time of its writing in s."""

    number: int
    time: float
    record: Any


class Ring(Generic[Record]):
    """Room for the last `LENGTH` records of one writer.

    Parameters
    ----------
    memory : memoryview
    start : int
        Index of the first byte of this ring.
    kind : type
        Type of the records.
    layout : str
        Format of their fields, as `struct` has it, little-endian.
    """

    def __init__(self, memory: memoryview, start: int, kind: type[Record], layout: str) -> None:
        self._kind = kind
        self._layout = struct.Struct(_STAMP + layout.removeprefix("<"))
        self._size = self.size(layout) // LENGTH
        self._memory = memory[start : start + LENGTH * self._size]
        self._number = 0  # 0: to be seen from the memory; only a writer keeps count

    @staticmethod
    def size(layout: str) -> int:
        """Return the size in bytes of a ring for records of a format."""
        return LENGTH * (struct.calcsize(_STAMP + layout.removeprefix("<")) + _CHECKSUM.size)

    def write(self, record: Record) -> None:
        """Write a record over the oldest one."""
        if self._number == 0:
            self._number = max(self._at(place).number for place in range(LENGTH))
        self._number += 1
        data = self._layout.pack(self._number, monotonic(), *record)
        start = self._number % LENGTH * self._size
        self._memory[start : start + self._size] = data + _CHECKSUM.pack(crc32(data))

    def after(self, number: int) -> list[Entry]:
        """Return the whole records after one, in order, without those that were written over.

        Parameters
        ----------
        number : int
            Of the last record that was read; 0 for none.
        """
        entries = []
        for place in range(number + 1, number + 1 + LENGTH):
            entry = self._at(place)
            if entry.number < place:  # being written, or of the round before
                break
            entries.append(entry)  # of a later round, if the writer is that far ahead
        return sorted(entries)

    def _at(self, place: int) -> Entry:
        """Return the entry in the place of some number, which has its own; 0 if it is torn."""
        start = place % LENGTH * self._size
        data = bytes(self._memory[start : start + self._size])
        number, time, *fields = self._layout.unpack_from(data)
        if number and crc32(data) != _INTACT:
            number = 0
        return Entry(number, time, self._kind(*fields))
