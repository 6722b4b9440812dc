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
from typing import TextIO

from fmus.kit import UserError, quoting

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
        File that lines are added to.
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
        self._destinations = [_Destination(sys.stdout)]
        if path is not None:
            try:
                file = os.fdopen(_open_at_once(path), "a", encoding="utf-8")
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
        line = f"{datetime.now().isoformat(' ', 'milliseconds')} {shown}\n"
        for destination in self._destinations:
            destination.put(line)

    def close(self) -> None:
        """Write the lines that remain, within a bounded time."""
        for kind, number in self._withheld.items():
            self.tell(f"{kind}: {number} more")
        for destination in self._destinations:
            destination.close()


class _Destination:
    """A stream that a thread writes lines to, until that fails."""

    def __init__(
        self, stream: TextIO, failed: Callable[[Exception], None] = lambda error: None
    ) -> None:
        self._stream = stream
        self._failed = failed
        self._lines: Queue[str | None] = Queue(_LONGEST_QUEUE)
        self._closing = False
        self._writer = Thread(target=self._write, daemon=True, name="log")
        self._writer.start()

    def put(self, line: str | None) -> None:
        with suppress(Full):
            self._lines.put_nowait(line)

    def close(self) -> None:
        self._closing = True
        self.put(None)
        self._writer.join(_LONGEST_END)
        if self._stream is not sys.stdout and not self._writer.is_alive():
            with suppress(OSError):
                self._stream.close()

    def _next(self) -> str | None:
        """Wait for the next line; return None at the end."""
        while True:
            try:
                return self._lines.get(timeout=_PAUSE)
            except Empty:
                if self._closing:  # there was no room to say so
                    return None

    def _write(self) -> None:
        """Write lines until the end, or until the stream fails."""
        try:
            while (line := self._next()) is not None:
                self._stream.write(line)
                self._stream.flush()
        except (OSError, ValueError) as error:  # a full disk, a closed pipe
            self._failed(error)


def _open_at_once(path: Path) -> int:
    """Open a file to add to, or fail where a pipe has no reader, which would be waited for."""
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NONBLOCK", 0)
    return os.open(path, flags, 0o666)
