"""The end of a command that runs until it is told to end: Ctrl-C, and SIGTERM, which is taken for the same."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def until_told() -> Iterator[None]:
    """Leave what is in the context when Ctrl-C is pressed or SIGTERM arrives, and go on behind it."""
    before = signal.getsignal(signal.SIGTERM)

    def end(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    ours = threading.current_thread() is threading.main_thread()
    if ours:
        signal.signal(signal.SIGTERM, end)
    try:
        yield
    except KeyboardInterrupt:
        pass
    finally:
        if ours:
            signal.signal(signal.SIGTERM, before)
