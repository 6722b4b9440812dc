"""A pulse that calls the kernel back now and then, so that Python can hear Ctrl-C however long the kernel has to do."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from orchestration.fmu.kernel.library import Progress

PERIOD = 0.1  # s


@contextmanager
def pulse(progress: Progress) -> Iterator[None]:
    """Mark a run as interrupted every `PERIOD` seconds.

    A clock that the kernel itself looked at would cost as much as a small FMU's step; and a number of steps between
    two looks would have to be guessed.
    """
    over = Event()

    def beat() -> None:
        while not over.wait(PERIOD):
            progress.interrupted = 1

    thread = Thread(target=beat, name="kernel pulse", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
