"""Archiver process of the server: it writes what the rings in the shared memory hold to files.

It is not on the way to the safe state, and nobody waits for it: it may be killed, and its disk may
be full or hang. The rings hold some seconds; what was written over before it came back is a gap
that the archive tells of.
"""

from __future__ import annotations

import os
import platform
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from hashlib import sha256
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock
from time import monotonic, sleep, time
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.extras import require
from orchestration.rig.archive import columns_of
from orchestration.rig.server.calls import BackendSignals, leave
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.processes import Output, detach, undisturbed
from orchestration.rig.server.real_time import RealTimeRig
from orchestration.rig.server.rig import Rig
from orchestration.rig.server.ring import Entry
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    Command,
    Event,
    Sample,
    SharedMemory,
    read_text,
    unpack,
    write_text,
)

_EVERY = 1.0  # s between two batches, which is all that is lost with the machine
_AGAIN = 2.0  # s until the next try after a trouble; the log has one such line a second at most
_AFTERWARDS = 3.0  # s that an archiver goes on without its front, for the way to the safe state
_LONGEST_END = 5.0  # s that it has for the last rows
_PAUSE = 1.0  # s between two starts
_NICENESS = 10  # of the archiver, so that device, guards and front come first
_ORDERS = ("rest", "run", "end")


@contextmanager
def archived(settings: ServerSettings, rig: Rig, log: EventLog) -> Iterator[Callable[[str], None]]:
    """Archive a rig while the context lasts, if the settings name a folder.

    Parameters
    ----------
    settings : ServerSettings
    rig : Rig
    log : EventLog

    Yields
    ------
    callable
        To be called with the rig's state in every turn of the front's loop.
    """
    if settings.archive is None or not isinstance(rig, RealTimeRig):
        yield lambda state: None
        return
    archiving = _Archiving(settings, rig, log)
    try:
        yield archiving.supervise
    finally:
        archiving.close()


class _Archiving:
    """The archive of a rig, as the front sees it: a process that is started again when it ends."""

    def __init__(self, settings: ServerSettings, rig: RealTimeRig, log: EventLog) -> None:
        end, self._end = Pipe(duplex=False)
        about = _describe(settings, rig.signals)
        self._arguments = (settings, rig.memory, rig.output, about, end)
        self._events = SharedMemory(rig.memory).events
        self._log = log
        self._lock = Lock()
        self._state = ""
        self._process: Any = None
        self._due = 0.0
        log.listen(partial(self._add, "log"))

    def _add(self, what: str, text: str) -> None:
        with self._lock:  # a thread of the log may tell of its own trouble
            self._events.write(Event(what.encode(), write_text(text)))

    def supervise(self, state: str) -> None:
        """Start the process if it does not run, and archive a new state of the rig."""
        if state != self._state:
            self._state = state
            self._add("state", state)
        if monotonic() < self._due or (self._process is not None and self._process.is_alive()):
            return
        if self._process is not None:
            self._log.tell(f"the archiver has ended ({self._process.exitcode}): another is started")
        self._due = monotonic() + _PAUSE
        process = get_context("spawn").Process(target=main, args=self._arguments, name="archiver")
        try:
            with undisturbed():
                process.start()
        except Exception as error:  # no process, memory or descriptor is left
            self._log.tell(f"no archiver can be started: {error}", "archiver")
            return
        self._process = process

    def close(self) -> None:
        """Let the process write the last rows and end; it is killed if that takes too long."""
        self._end.send_bytes(b"end")
        if self._process is not None:
            self._process.join(_LONGEST_END)
            self._process.kill()


def archive_lock(folder: Path | None) -> list[str]:
    """Make the folder of an archive, and return what to lock, in a list that is empty without one.

    Raises
    ------
    UserError
        If the folder cannot be used.
    """
    if folder is None:
        return []
    require("pyarrow")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--archive {folder}: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise UserError(f"--archive {folder}: nothing may be written there")
    return [f"the archive {folder.resolve()}"]


def _describe(settings: ServerSettings, signals: BackendSignals) -> dict[str, Any]:
    """Return the metadata of an archive: the server, its rig, and its files by their digests."""
    return {
        "run": os.urandom(4).hex(),
        "host": platform.node(),
        "process": os.getpid(),
        "backend": settings.backend,
        "options": dict(settings.options),
        "rate": settings.rate,
        "watchdog": settings.watchdog,
        "inputs": signals.inputs,
        "outputs": signals.outputs,
        "limits": {name: limit.finite() for name, limit in signals.limits.items()},
        "files": {name: sha256(content).hexdigest() for name, content in settings.files.items()},
    }


def main(
    settings: ServerSettings, memory: Any, output: Output, about: dict[str, Any], end: Connection
) -> None:
    """Run the archiver process of the rig server.

    Parameters
    ----------
    settings : ServerSettings
    memory : ctypes array
        Shared with the front process.
    output : Output
        Of the front, for messages.
    about : dict
        Metadata of the files.
    end : Connection
        By which the front orders the end.
    """
    detach()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # which is for the front, if it is for all
    output.redirect()
    with suppress(AttributeError, OSError):
        os.nice(_NICENESS)
    Archiver(settings, SharedMemory(memory), about).run(end)
    leave(0)


class Archiver:
    """A reader of the rings and writer of the archive.

    Parameters
    ----------
    settings : ServerSettings
    shared : SharedMemory
    about : dict
        Metadata of the files.
    """

    def __init__(
        self, settings: ServerSettings, shared: SharedMemory, about: dict[str, Any]
    ) -> None:
        from orchestration.rig.archive import ArchiveWriter  # which needs an optional package

        assert settings.archive is not None
        self._folder = settings.archive
        self._shared = shared
        self._counts = (len(about["inputs"]), len(about["outputs"]))
        columns = columns_of(about["inputs"], about["outputs"])
        self._writer = ArchiveWriter(self._folder, settings.archive_size, about, columns)
        self._trouble = ""

    def run(self, end: Connection) -> None:
        """Archive until the front orders the end, or for a while after it has ended."""
        while not end.poll(_AGAIN if self._trouble else _EVERY):
            self.write()
        try:
            end.recv_bytes()
        except EOFError:
            sleep(_AFTERWARDS)
        self.write()

    def write(self) -> None:
        """Write the new records of the rings, and tell of a new trouble and of its end."""
        trouble = ""
        try:
            for kind, last in self._writer.last.items():
                entries = getattr(self._shared, kind).after(last)
                if entries:
                    rows = [_row(entry, *self._counts) for entry in entries]
                    self._writer.add(kind, rows, time() - monotonic())
        except OSError as error:
            trouble = str(error.strerror or error)
        if trouble and trouble != self._trouble:
            print(f"--archive {self._folder}: {trouble}; tried again every {_AGAIN:g} s")
        elif self._trouble and not trouble:
            print(f"--archive {self._folder}: is written again; ppy rig archive shows the gap")
        self._trouble = trouble


def _row(entry: Entry, inputs: int, outputs: int) -> tuple[Any, ...]:
    """Return the row of an entry, with the columns of its kind (see `columns_of`)."""
    record: Event | Command | Sample = entry.record
    if isinstance(record, Event):
        return (entry.number, entry.time, read_text(record.what), read_text(record.text))
    if isinstance(record, Command):
        values = unpack(record.values, inputs)
        return (entry.number, entry.time, _ORDERS[record.order], *values)
    applied = (*unpack(record.applied, inputs), *unpack(record.read_back, inputs))
    taken = np.array(unpack(record.taken, outputs))
    ages = np.where(taken, record.clock - taken, np.nan)
    measured = np.where(taken, unpack(record.values, outputs), np.nan)
    return (entry.number, record.clock, float(record.missed), *applied, *measured, *ages)
