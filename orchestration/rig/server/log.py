"""Event log of the server: lines with wall time, to standard output and a file, never waiting."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from math import inf
from pathlib import Path
from queue import Empty, Full, Queue
from threading import Thread
from time import monotonic

from fmus.kit import UserError, quoting
from orchestration.rig.server.log_chain import START, last_digest, seal

_LONGEST_QUEUE = 1000  # lines that wait for a terminal that does not take them
_LONGEST_LINE = 1000  # characters
_LONGEST_END = 1.0  # s that the last lines get
_PAUSE = 1.0  # s between two lines of one kind, where a kind is given


class EventLog:
    """Log of events, one line each.

    Each destination has a thread that writes to it: a pipe that nobody reads would block for ever.

    Parameters
    ----------
    path : Path or None
        File that lines are added to, each with a digest (see `log_chain`), for its owner alone. If
        it is renamed, as by a program that rotates logs, a new one is made.
    clock : callable
        Time in s that never jumps.

    Raises
    ------
    UserError
        If the file cannot be written.
    """

    def __init__(self, path: Path | None = None, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._newest: dict[str, float] = {}
        self._withheld: dict[str, int] = {}
        self._listeners: list[Callable[[str], None]] = []
        self._destinations = [_Destination(_Terminal())]
        if path is not None:
            try:
                file = _File(path)
            except OSError as error:
                raise UserError(f"--log {path}: {error.strerror}") from error
            self._destinations.append(
                _Destination(
                    file, lambda error: self.tell(f"--log {path} is not written any more: {error}")
                )
            )

    def tell(self, text: str, kind: str = "") -> None:
        """Write a line.

        Parameters
        ----------
        text : str
        kind : str
            At most one line a second of a kind is written, with the number of those left out; a
            line without a kind is always written.
        """
        now = self._clock()
        withheld = 0
        if kind:
            if now - self._newest.get(kind, -inf) < _PAUSE:
                self._withheld[kind] = self._withheld.get(kind, 0) + 1
                return
            self._newest[kind] = now
            withheld = self._withheld.pop(kind, 0)
        addition = f" (and {withheld} like it before)" if withheld else ""
        # the text may contain that of a client
        shown = quoting.line(f"{text}{addition}")[:_LONGEST_LINE]
        line = _dated(shown)
        for destination in self._destinations:
            destination.put(line)
        for listener in self._listeners:
            listener(shown)

    def listen(self, listener: Callable[[str], None]) -> None:
        """Let a function be called with the text of every line that is written from now on."""
        self._listeners.append(listener)

    def close(self) -> None:
        """Write the lines that remain, within a bounded time."""
        for kind, number in self._withheld.items():
            self.tell(f"{kind}: {number} more")
        for destination in self._destinations:
            destination.close()


class _Terminal:
    """Standard output."""

    def __init__(self) -> None:
        self._stream = sys.stdout

    def write(self, line: str) -> None:
        self._stream.write(f"{line}\n")
        self._stream.flush()

    def close(self) -> None:
        """Do nothing: it is not ours."""


class _File:
    """A file, with a chain of digests that goes on over its rotation and over a restart."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = _open_at_once(path)
        self._digest = ""  # of the last line; empty until the first is written

    def write(self, line: str) -> None:
        try:
            is_there = os.path.samestat(os.stat(self._path), os.fstat(self._descriptor))
        except FileNotFoundError:
            is_there = False
        if not is_there:
            os.close(self._descriptor)
            self._descriptor = _open_at_once(self._path)
        if not self._digest:
            self._digest = self._digest_of_before()
            is_there = False
        if not is_there:
            self._add(_dated(f"log opened, after {self._digest}"))
        self._add(line)

    def _digest_of_before(self) -> str:
        if not self._path.is_file():
            return START
        with self._path.open(encoding="utf-8", errors="replace") as lines:
            return last_digest(lines)

    def _add(self, line: str) -> None:
        digest = seal(self._digest, line)
        os.write(self._descriptor, f"{line} #{digest}\n".encode())
        self._digest = digest

    def close(self) -> None:
        os.close(self._descriptor)


class _Destination:
    """A place that a thread writes lines to, until that fails; it says how many were lost."""

    def __init__(
        self,
        place: _Terminal | _File,
        failed: Callable[[Exception], None] = lambda error: None,
    ) -> None:
        self._place = place
        self._failed = failed
        self._lost = 0
        self._lines: Queue[str | None] = Queue(_LONGEST_QUEUE)
        self._closing = False
        self._writer = Thread(target=self._write, daemon=True, name="log")
        self._writer.start()

    def put(self, line: str | None) -> None:
        try:
            self._lines.put_nowait(line)
        except Full:
            self._lost += line is not None

    def close(self) -> None:
        self._closing = True
        self.put(None)
        self._writer.join(_LONGEST_END)
        if not self._writer.is_alive():
            with suppress(OSError):
                self._place.close()

    def _next(self) -> str | None:
        """Wait for the next line; return None at the end."""
        while True:
            try:
                return self._lines.get(timeout=_PAUSE)
            except Empty:
                if self._closing:  # there was no room to say so
                    return None

    def _write(self) -> None:
        """Write lines until the end, or until the place fails."""
        try:
            while (line := self._next()) is not None:
                self._place.write(line)
                if self._lost and self._lines.empty():
                    self._place.write(_dated(f"{self._lost} lines were lost here"))
                    self._lost = 0
        except (OSError, ValueError) as error:  # a full disk, a closed pipe
            self._failed(error)


def _dated(text: str) -> str:
    """Return a line with wall time."""
    return f"{datetime.now().isoformat(' ', 'milliseconds')} {text}"


def _open_at_once(path: Path) -> int:
    """Open a file to add to, or fail where a pipe has no reader, which would be waited for."""
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NONBLOCK", 0)
    return os.open(path, flags, 0o600)
