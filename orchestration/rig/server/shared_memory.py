"""Memory that the processes of a server share: slots where the newest record wins, and rings.

There is no queue that could fill up. A slot has one writer. It holds two copies, written in turns,
each with a count and a checksum: a reader takes the newest whose checksum is right. A writer that
is killed in the middle of writing thus leaves the record before, nobody waits for anybody, and
there is no lock that a killed process could keep.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from multiprocessing import get_context
from typing import Any, Generic, NamedTuple
from zlib import crc32

from orchestration.rig.server.ring import Record, Ring

SIGNALS = 32  # of each kind, at most
_NUMBERS = f"{8 * SIGNALS}s"
_TEXT = 500  # bytes
_NAME = 100  # bytes
LONGEST_DESCRIPTION = 32768  # bytes
_HEAD = struct.Struct("<QI")  # count, checksum of the count and the record
_COUNT = struct.Struct("<Q")
_ALIGNMENT = 64  # bytes, a cache line, of which no two slots have parts
_ATTEMPTS = 100  # a writer would have to lap a reader as often

# Orders of the front to the device.
REST, RUN, END = range(3)
# What the guard on duty is at: its device opens or serves, or there is none; it tries for the safe
# state itself, or holds the rig there; it has ended, with the rig in its safe state.
OPENING, SERVING, GONE, RESCUING, HOLDING, RETIRED = range(6)


class Command(NamedTuple):
    """The newest command, written by the front.

    `number` counts the commands. `acknowledged` counts acknowledgements: a process that tripped
    stays safe until the next. `accepted` is when the newest command was accepted, `values` are
    packed.
    """

    order: int = REST
    acknowledged: int = 0
    accepted: float = 0.0
    values: bytes = b""
    number: int = 0


class SignOfLife(NamedTuple):
    """A sign of life of a process, written by the front and by the standby guard."""

    time: float
    process: int


class Beat(NamedTuple):
    """A sign of life, written by the device before every call of the backend and before it sleeps.

    `call` is its next or present action and `opened` True after the first reading of the backend.
    `safe`, `denied` and `rested` are about the safe state: since when the rig is in it, 0 outside
    of it; whether the device reports something else for too long; and the number of the newest
    order to rest that was carried out.
    """

    time: float
    process: int
    opened: bool
    safe: float
    call: bytes
    denied: bool = False
    rested: int = 0


class Sample(NamedTuple):
    """A sample, written by the device after every reading.

    `taken` has the time of the last finite value of each output, 0 if there was none; `read_back`
    has NaN for inputs that the device does not report. `process` is the device's, and `rested` as
    in its beat: what is applied is after the orders up to that one.
    """

    number: int
    clock: float
    missed: int
    applied: bytes
    read_back: bytes
    values: bytes
    taken: bytes
    process: int = 0
    rested: int = 0


class Trip(NamedTuple):
    """A report of device or guard on going to the safe state, its reason and its success.

    `ended` is True if the backend is closed.
    """

    time: float
    reached: bool
    ended: bool
    reason: bytes


class Alarm(NamedTuple):
    """A message for the operator on a signal, written by the device; the rig continues to run."""

    time: float
    source: bytes
    reason: bytes


class Watch(NamedTuple):
    """A sign of life of the guard on duty, with its present action.

    `acknowledged` is the number of acknowledgements that the guard has read; `ending` is True once
    all processes are to end. `safe`, `denied` and `rested` are as those of the device, while the
    guard has the backend in its place.
    """

    time: float
    process: int
    at: int
    acknowledged: int
    ending: bool
    safe: float = 0.0
    denied: bool = False
    rested: int = 0


class Description(NamedTuple):
    """The signals of the backend as JSON, written by the device when it has opened it.

    `opening` is the time in s that this took.
    """

    text: bytes
    opening: float = 0.0


class Event(NamedTuple):
    """A line of the log or a state of the rig, written by the front.

    `what` is ``log`` or ``state``.
    """

    what: bytes
    text: bytes


_LAYOUTS: dict[type, str] = {
    Command: "<BQd" + _NUMBERS + "Q",
    SignOfLife: "<dQ",
    Beat: "<dQ?d16s?Q",
    Sample: "<QdQ" + 4 * _NUMBERS + "QQ",
    Trip: f"<d??{_TEXT}s",
    Alarm: f"<d{_NAME}s{_TEXT}s",
    Event: f"<8s{_TEXT}s",
    Watch: "<dQBQ?d?Q",
    Description: f"<{LONGEST_DESCRIPTION}sd",
}


class Slot(Generic[Record]):
    """Room for one record in shared memory.

    Parameters
    ----------
    memory : memoryview
        Bytes of all slots.
    start : int
        Index of the first byte of this slot.
    kind : type
        Type of the record.
    """

    def __init__(self, memory: memoryview, start: int, kind: type[Record]) -> None:
        self._kind = kind
        self._layout = struct.Struct(_LAYOUTS[kind])
        size = _HEAD.size + self._layout.size
        self._halves = [memory[start + k * size : start + (k + 1) * size] for k in range(2)]
        self._count = 0  # 0: to be seen from the memory; only a writer keeps count

    @staticmethod
    def size(kind: type) -> int:
        """Return the size in bytes of a slot for a type of record."""
        return 2 * (_HEAD.size + struct.calcsize(_LAYOUTS[kind]))

    def write(self, record: Record) -> None:
        """Replace the record.

        Parameters
        ----------
        record : Record
        """
        if self._count == 0:
            self._count = max((count for count, _ in self._valid()), default=0)
        self._count += 1
        data = self._layout.pack(*record)
        checksum = crc32(data, crc32(_COUNT.pack(self._count)))
        self._halves[self._count % 2][:] = _HEAD.pack(self._count, checksum) + data

    def read(self) -> Record | None:
        """Return the newest record whose checksum is right.

        If only one copy is right it may be outdated: after this copy was read, the writer may have
        finished the other one. It counts if it is the only one, and the same, when read again.

        Returns
        -------
        Record or None
            None if nothing was written yet.
        """
        for _ in range(_ATTEMPTS):
            valid = self._valid()
            if len(valid) == 1:
                before = valid
                valid = self._valid()
                if len(valid) == 1 and valid != before:
                    continue
            if valid:
                _, data = max(valid)
                return self._kind(*self._layout.unpack(data))
            if self._is_blank():
                return None
        return None

    def _is_blank(self) -> bool:
        """Return True if nothing was ever written."""
        return not any(any(half[: _HEAD.size]) for half in self._halves)

    def _valid(self) -> list[tuple[int, bytes]]:
        """Return counts and bytes of the copies whose checksum is right."""
        copies = []
        for half in self._halves:
            copy = bytes(half)
            count, checksum = _HEAD.unpack_from(copy)
            data = copy[_HEAD.size :]
            if count and checksum == crc32(data, crc32(copy[: _COUNT.size])):
                copies.append((count, data))
        return copies


class SharedMemory:
    """All slots and rings, in memory that a process hands to those it starts.

    Parameters
    ----------
    memory : ctypes array
        Memory from :func:`new_memory`.

    Attributes
    ----------
    command, front : Slot of Command, Slot of SignOfLife
        Written by the front.
    watch, rescue : Slot of Watch, Slot of Trip
        Written by the guard on duty.
    standby : Slot of SignOfLife
        Written by the standby guard.
    beat, sample, trip, alarm, description
        Written by the device.
    samples, commands, events : Ring of Sample, Ring of Command, Ring of Event
        For the archive; samples are written by the device, the others by the front.
    """

    def __init__(self, memory: Any) -> None:
        view = memoryview(memory).cast("B")
        starts = iter(_starts())
        self.command = Slot(view, next(starts), Command)
        self.front = Slot(view, next(starts), SignOfLife)
        self.watch = Slot(view, next(starts), Watch)
        self.rescue = Slot(view, next(starts), Trip)
        self.standby = Slot(view, next(starts), SignOfLife)
        self.beat = Slot(view, next(starts), Beat)
        self.sample = Slot(view, next(starts), Sample)
        self.trip = Slot(view, next(starts), Trip)
        self.alarm = Slot(view, next(starts), Alarm)
        self.description = Slot(view, next(starts), Description)
        self.samples = Ring(view, next(starts), Sample, _LAYOUTS[Sample])
        self.commands = Ring(view, next(starts), Command, _LAYOUTS[Command])
        self.events = Ring(view, next(starts), Event, _LAYOUTS[Event])


# in the order of the slots, and of the rings after them
_KINDS = (Command, SignOfLife, Watch, Trip, SignOfLife, Beat, Sample, Trip, Alarm, Description)
_RINGS = (Sample, Command, Event)


def _starts() -> list[int]:
    """Return the index of the first byte of each slot and ring, and the end of the last."""
    starts = [0]
    rings = [Ring.size(_LAYOUTS[kind]) for kind in _RINGS]
    for size in (*map(Slot.size, _KINDS), *rings):
        starts.append(starts[-1] + size + -size % _ALIGNMENT)
    return starts


def new_memory() -> Any:
    """Allocate memory for all slots and rings.

    Returns
    -------
    ctypes array
        Shared with the processes that it is handed to when they are started; it goes when the last
        of them ends.
    """
    return get_context("spawn").RawArray("B", _starts()[-1])


def pack(values: Sequence[float]) -> bytes:
    """Pack numbers into bytes of a record.

    Parameters
    ----------
    values : sequence of float
        At most ``SIGNALS``.

    Returns
    -------
    bytes
    """
    return struct.pack(f"<{len(values)}d", *values)


def unpack(data: bytes, count: int) -> tuple[float, ...]:
    """Unpack numbers from bytes of a record.

    Parameters
    ----------
    data : bytes
    count : int

    Returns
    -------
    tuple of float
    """
    return struct.unpack_from(f"<{count}d", data)


def write_text(text: str) -> bytes:
    """Pack a text into bytes of a record: one line, cut to the room there is."""
    return " ".join(text.split()).encode()[:_TEXT]


def read_text(data: bytes) -> str:
    """Unpack a text from bytes of a record."""
    return data.rstrip(b"\0").decode(errors="ignore")
