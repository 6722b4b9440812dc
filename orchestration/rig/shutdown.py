"""Orderly shutdown of a command that runs until it is interrupted, by Ctrl-C or by SIGTERM."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType


def _interrupt() -> None:
    raise KeyboardInterrupt


@contextmanager
def until_interrupted() -> Iterator[None]:
    """Leave the context without an error when Ctrl-C is pressed or SIGTERM arrives."""
    with suppress(KeyboardInterrupt), on_termination(_interrupt):
        yield


@contextmanager
def on_termination(act: Callable[[], None]) -> Iterator[None]:
    """Call a function on every SIGTERM while the context lasts.

    Only the main thread gets signals; in any other thread this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, frame: FrameType | None) -> None:
        act()

    before = signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
