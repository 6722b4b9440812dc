"""Contexts that defer Ctrl-C until no work is half done and no exception can be discarded."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupt:
    """A flag that is set when Ctrl-C is pressed."""

    pressed = False


@contextmanager
def deferred() -> Iterator[Interrupt]:
    """Record the first Ctrl-C within this context, and interrupt only at the second.

    It has no effect outside the main thread, or if Ctrl-C has another handler.
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


def raise_interrupt(error: BaseException) -> None:
    """Raise the Ctrl-C that an exception stems from, if it does.

    Python 3.11 raises a RuntimeError from an interrupt while a class is made.

    Raises
    ------
    KeyboardInterrupt
        If one is among the causes of `error`.
    """
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, KeyboardInterrupt):
            raise cause
        cause = cause.__cause__


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Defer a Ctrl-C within this context, or a decorated function, to its end.

    It is for computations with CasADi expressions: their operators call Python to find the types of
    operands, and discard a KeyboardInterrupt that is raised there.

    Raises
    ------
    KeyboardInterrupt
        After a Ctrl-C, also in place of another exception.
    """
    interrupt = Interrupt()
    try:
        with deferred() as interrupt:
            yield
    finally:
        if interrupt.pressed:
            raise KeyboardInterrupt
