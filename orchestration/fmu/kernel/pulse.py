"""A pulse that calls the kernel back now and then, so that Python can hear Ctrl-C however long the kernel has to do."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

from orchestration.fmu.kernel.library import Progress

PERIOD = 0.1  # s


class Pulse:
    """Marks a run as interrupted every `PERIOD` seconds; a context manager, for it is a thread.

    A clock that the kernel itself looked at would cost as much as a small FMU's step; and a number of steps between
    two looks would have to be guessed. To start a thread takes as long as a thousand small steps, so that runs which
    follow each other share one.
    """

    def __init__(self) -> None:
        self._over = Event()
        self._run: Progress | None = None
        self._thread = Thread(target=self._beat, name="kernel pulse", daemon=True)

    def __enter__(self) -> Pulse:
        self._thread.start()
        return self

    def __exit__(self, *error: Any) -> None:
        self._over.set()
        self._thread.join()

    @contextmanager
    def of(self, progress: Progress) -> Iterator[None]:
        """Let it be felt by a run, and by no other; a run that is over may be marked once more, which does no harm."""
        self._run = progress
        try:
            yield
        finally:
            self._run = None

    def _beat(self) -> None:
        while not self._over.wait(PERIOD):
            run = self._run
            if run is not None:
                run.interrupted = 1
