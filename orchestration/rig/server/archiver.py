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
from hashlib import sha256
from math import nan
from multiprocessing import get_context, parent_process
from threading import Lock
from time import monotonic, sleep, time
from typing import Any

from filelock import FileLock, Timeout

from fmus.kit import UserError
from fmus.kit.extras import require
from orchestration.rig.archive import columns_of
from orchestration.rig.server.calls import BackendSignals, leave
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.processes import Output, detach, undisturbed
from orchestration.rig.server.real_time import RealTimeRig
from orchestration.rig.server.rig import Rig
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    LENGTH,
    Command,
    Entry,
    Event,
    Ring,
    Sample,
    SharedMemory,
    read_text,
    unpack,
    write_text,
)

_EVERY = 1.0  # s between two batches, which is all that is lost with the machine
_AGAIN = 3.0  # s until the next try after a trouble; the log has one such line a second at most
_LOOK = 0.1  # s between two looks at the rings
_AFTERWARDS = 3.0  # s that an archiver goes on without its front, for the way to the safe state
_LONGEST_END = 5.0  # s that it has for the last rows
_PAUSES = (0.1, 5.0)  # s between two starts, doubled
_NICENESS = 10  # of the archiver, so that device, guards and front come first
_ORDERS = ("rest", "run", "end")


class Archiving:
    """The archive of a rig, as the front sees it: a process that is started again when it ends.

    Parameters
    ----------
    settings : ServerSettings
    rig : RealTimeRig
    log : EventLog
        Its lines are archived from now on.
    about : Mapping
        Metadata of the files.
    """

    def __init__(
        self, settings: ServerSettings, rig: RealTimeRig, log: EventLog, about: dict[str, Any]
    ) -> None:
        self._arguments = (settings, rig.memory, rig.output, about)
        self._events = SharedMemory(rig.memory).events
        self._log = log
        self._lock = Lock()
        self._state = ""
        self._process: Any = None
        self._pause = 0.0
        self._started = 0.0
        log.listen(lambda line: self._add("log", line))

    def _add(self, what: str, text: str) -> None:
        with self._lock:  # a thread of the log may tell of its own trouble
            self._events.write(Event(what.encode(), write_text(text)))

    def supervise(self, state: str) -> None:
        """Start the process if it does not run, and archive a new state of the rig.

        Parameters
        ----------
        state : str
        """
        if state != self._state:
            self._state = state
            self._add("state", state)
        now = monotonic()
        if self._process is not None and self._process.is_alive():
            return
        if now - self._started < self._pause:
            return
        if self._process is not None:
            self._log.tell(f"the archiver has ended ({self._process.exitcode}): another is started")
        least, most = _PAUSES
        self._pause = min(max(least, 2 * self._pause), most)
        self._started = now
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
        if self._process is not None:
            self._process.terminate()
            self._process.join(_LONGEST_END)
            self._process.kill()


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
    archiving = Archiving(settings, rig, log, _describe(settings, rig.signals))
    try:
        yield archiving.supervise
    finally:
        archiving.close()


@contextmanager
def locked_archive(settings: ServerSettings) -> Iterator[None]:
    """Make the folder of the archive, if there is one, and keep other servers out of it.

    Parameters
    ----------
    settings : ServerSettings

    Raises
    ------
    UserError
        If the folder cannot be used, or another server writes to it.
    """
    folder = settings.archive
    if folder is None:
        yield
        return
    require("pyarrow")
    lock = FileLock(folder / "archive.lock", timeout=0)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except Timeout as error:
        raise UserError(f"--archive {folder}: another server writes to it") from error
    except OSError as error:
        raise UserError(f"--archive {folder}: {error.strerror or error}") from error
    with lock:
        yield


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


def main(settings: ServerSettings, memory: Any, output: Output, about: dict[str, Any]) -> None:
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
    """
    detach()
    output.redirect()
    with suppress(AttributeError, OSError):
        os.nice(_NICENESS)
    archiver = Archiver(settings, SharedMemory(memory), about)
    signal.signal(signal.SIGTERM, archiver.end)
    archiver.run()
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

        self._folder = settings.archive
        inputs, outputs = about["inputs"], about["outputs"]
        columns = columns_of(inputs, outputs)
        assert settings.archive is not None
        self._writer = ArchiveWriter(settings.archive, settings.archive_size, about, columns)
        self._rings: dict[str, Ring[Any]] = {
            "samples": shared.samples,
            "commands": shared.commands,
            "events": shared.events,
        }
        self._counts = len(inputs), len(outputs)
        self._rows = {
            "samples": self._row_of_sample,
            "commands": self._row_of_command,
            "events": _row_of_event,
        }
        self._last: dict[str, int] = {}  # number of the last row that was read, by kind
        self._pending: dict[str, list[tuple[Any, ...]]] = {kind: [] for kind in self._rings}
        self._ending = False
        self._trouble = ""

    def end(self, *_: object) -> None:
        """End after the last rows."""
        self._ending = True

    def run(self) -> None:
        """Archive until the front orders the end, or for a while after it has ended."""
        self._try(self._write)
        parent = parent_process()
        until = float("inf")
        while not self._ending and monotonic() < until:
            if until == float("inf") and parent is not None and not parent.is_alive():
                until = monotonic() + _AFTERWARDS
            due = monotonic() + (_AGAIN if self._trouble else _EVERY)
            while not self._ending and monotonic() < due:
                sleep(_LOOK)
                self._take()
            self._try(self._write)
        self._take()
        self._try(self._write)
        self._try(self._writer.close)

    def _try(self, act: Callable[[], None]) -> None:
        """Do something with the files, and tell of a new trouble and of its end."""
        trouble = ""
        try:
            act()
        except OSError as error:
            trouble = str(error.strerror or error)
        if trouble and trouble != self._trouble:
            print(f"--archive {self._folder}: {trouble}; tried again every {_AGAIN:g} s")
        elif self._trouble and not trouble:
            print(f"--archive {self._folder}: is written again; ppy rig archive shows the gap")
        self._trouble = trouble

    def _take(self) -> None:
        """Take new records from the rings, unless as many as they hold are still to be written."""
        for kind, ring in self._rings.items():
            pending = self._pending[kind]
            if kind in self._last and len(pending) < LENGTH:
                entries = ring.after(self._last[kind])
                pending.extend(map(self._rows[kind], entries))
                if entries:
                    self._last[kind] = entries[-1].number

    def _write(self) -> None:
        """Write the rows that are pending; first of all find out which ones are written already."""
        for kind, pending in self._pending.items():
            if kind not in self._last:
                self._last[kind] = self._writer.last(kind)
            if pending:
                self._writer.add(kind, pending, time() - monotonic())
                pending.clear()

    def _row_of_sample(self, entry: Entry) -> tuple[Any, ...]:
        sample: Sample = entry.record
        inputs, outputs = self._counts
        taken = unpack(sample.taken, outputs)
        values = unpack(sample.values, outputs)
        measured = [value if then else nan for value, then in zip(values, taken, strict=True)]
        ages = [sample.clock - then if then else nan for then in taken]
        applied = (*unpack(sample.applied, inputs), *unpack(sample.read_back, inputs))
        return (entry.number, sample.clock, float(sample.missed), *applied, *measured, *ages)

    def _row_of_command(self, entry: Entry) -> tuple[Any, ...]:
        command: Command = entry.record
        values = unpack(command.values, self._counts[0])
        return (entry.number, entry.time, _ORDERS[command.order], *values)


def _row_of_event(entry: Entry) -> tuple[Any, ...]:
    event: Event = entry.record
    return (entry.number, entry.time, read_text(event.what), read_text(event.text))
