"""Ctrl-C that takes effect only where no work is half done and no exception is discarded."""

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
    """Note the first Ctrl-C within this context, and interrupt at the second one only.

    In other threads than the main one, and where Ctrl-C is handled elsewhere, it does nothing.
    """
    interrupt = Interrupt()
    before = signal.getsignal(signal.SIGINT)
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or before is not signal.default_int_handler:
        yield interrupt
        return

    def note(number: int, frame: FrameType | None) -> None:
        interrupt.pressed = True
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Have a Ctrl-C within this context, or a function, interrupt at its end.

    It is for what computes with expressions of CasADi, whose operators call Python to learn what
    their operands are, and discard the exception that an interrupt is there.

    Raises
    ------
    KeyboardInterrupt
        Also in the place of another exception.
    """
    interrupt = Interrupt()
    try:
        with deferred() as interrupt:
            yield
    finally:
        if interrupt.pressed:
            raise KeyboardInterrupt
