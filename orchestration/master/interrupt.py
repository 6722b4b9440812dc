"""Ctrl-C that takes effect between steps, so that no member is interrupted within one."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupt:
    """The note that Ctrl-C was pressed."""

    pressed = False


@contextmanager
def deferred() -> Iterator[Interrupt]:
    """Note the first Ctrl-C within this context, and interrupt at the second one only."""
    interrupt = Interrupt()
    before = signal.getsignal(signal.SIGINT)
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or before is not signal.default_int_handler:
        yield interrupt  # Ctrl-C is handled elsewhere
        return

    def note(number: int, frame: FrameType | None) -> None:
        interrupt.pressed = True
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)
