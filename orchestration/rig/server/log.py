"""What happens, one line each with wall time: to standard output and into a file, without ever waiting for either."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from queue import Empty, Full, Queue
from threading import Thread
from time import monotonic
from typing import TextIO

from fmus.kit.errors import UserError

_LONGEST_QUEUE = 1000  # lines that wait for a terminal that does not take them
_LONGEST_END = 1.0  # s that the last lines get
_PAUSE = 1.0  # s between two lines of one kind, where a kind is given


class EventLog:
    """Lines, written by a thread: who writes into a pipe that nobody reads waits for ever.

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
        self._told: dict[str, float] = {}
        self._withheld: dict[str, int] = {}
        self._lines: Queue[str | None] = Queue(_LONGEST_QUEUE)
        self._places: list[TextIO] = [sys.stdout]
        if path is not None:
            try:
                self._places.append(path.open("a", encoding="utf-8"))
            except OSError as error:
                raise UserError(f"--log {path}: {error.strerror}") from error
        self._writer = Thread(target=self._write, daemon=True, name="log")
        self._writer.start()

    def tell(self, text: str, kind: str = "") -> None:
        """Write a line.

        Parameters
        ----------
        text : str
        kind : str
            Of those alike, at most one a second is written, with the number of those in between.
        """
        now = self._clock()
        if kind:
            if now - self._told.get(kind, -_PAUSE) < _PAUSE:
                self._withheld[kind] = self._withheld.get(kind, 0) + 1
                return
            self._told[kind] = now
            more = self._withheld.pop(kind, 0)
            text = f"{text} (and {more} like it before)" if more else text
        with suppress(Full):
            self._lines.put_nowait(f"{datetime.now().isoformat(' ', 'milliseconds')} {' '.join(text.split())}\n")

    def close(self) -> None:
        """Write what is left, for as long as that may take."""
        for kind, number in self._withheld.items():
            if number:
                self.tell(f"{kind}: {number} more")
        with suppress(Full):
            self._lines.put_nowait(None)
        self._writer.join(_LONGEST_END)

    def _write(self) -> None:
        while (line := self._next()) is not None:
            for place in list(self._places):
                try:
                    place.write(line)
                    place.flush()
                except (OSError, ValueError) as error:  # a full disk, a closed pipe
                    self._places.remove(place)
                    if place is not sys.stdout:
                        self.tell(f"the log file is not written any more: {error}")

    def _next(self) -> str | None:
        while True:
            with suppress(Empty):
                return self._lines.get(timeout=60.0)
