"""The end of a command that runs until it is told to end: Ctrl-C, and SIGTERM, which is taken for the same."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType


def _interrupt() -> None:
    raise KeyboardInterrupt


@contextmanager
def until_told() -> Iterator[None]:
    """Leave what is in the context when Ctrl-C is pressed or SIGTERM arrives, and go on behind it."""
    with suppress(KeyboardInterrupt), on_termination(_interrupt):
        yield


@contextmanager
def on_termination(act: Callable[[], None]) -> Iterator[None]:
    """Do something on SIGTERM while the context lasts; in a thread that gets no signals, nothing."""
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
