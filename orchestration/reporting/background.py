"""A writer with a thread of its own, so that nobody waits for a disk or a terminal."""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread

_PATIENCE = 5.0  # s for what is still to be written in the end


class BackgroundWriter:
    """Writes what it is given, in order.

    Parameters
    ----------
    write : callable
        Writes bytes; called from another thread.

    Attributes
    ----------
    error : OSError or None
        Why writing has ended; what comes after it is dropped.
    """

    def __init__(self, write: Callable[[bytes], object]):
        self.error: OSError | None = None
        self._write = write
        self._waiting: SimpleQueue[bytes | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name="background writer", daemon=True)
        self._thread.start()

    @property
    def is_behind(self) -> bool:
        """Return whether something that was given has not been begun."""
        return not self._waiting.empty()

    def put(self, content: bytes) -> None:
        """Have something written; returns at once."""
        if self.error is None:
            self._waiting.put(content)

    def close(self) -> bool:
        """Wait, not for ever, until everything is written; return whether it is."""
        self._waiting.put(None)
        self._thread.join(_PATIENCE)
        return self.error is None and not self._thread.is_alive()

    def _run(self) -> None:
        while (content := self._waiting.get()) is not None:
            try:
                if self.error is None:
                    self._write(content)
            except OSError as error:
                self.error = error
