"""Writing in a background thread, so that callers do not wait for a disk or a terminal."""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread

_CLOSE_TIMEOUT = 5.0  # s to write the rest of the queue


class BackgroundWriter:
    """A writer that queues contents and writes them in order in a background thread.

    Parameters
    ----------
    write : callable
        Writes bytes; called from another thread.

    Attributes
    ----------
    error : OSError or None
        The error that stopped the writing; later contents are dropped.
    """

    def __init__(self, write: Callable[[bytes], object]):
        self.error: OSError | None = None
        self._write = write
        self._queue: SimpleQueue[bytes | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name="background writer", daemon=True)
        self._thread.start()

    @property
    def is_behind(self) -> bool:
        """True while contents wait in the queue."""
        return not self._queue.empty()

    def put(self, content: bytes) -> None:
        """Queue contents to be written, and return at once."""
        if self.error is None:
            self._queue.put(content)

    def close(self) -> bool:
        """Wait a few seconds for the queue; return whether all of it was written."""
        self._queue.put(None)
        self._thread.join(_CLOSE_TIMEOUT)
        return self.error is None and not self._thread.is_alive()

    def _run(self) -> None:
        """Write the queued contents until None comes; after an error drop them."""
        while (content := self._queue.get()) is not None:
            try:
                if self.error is None:
                    self._write(content)
            except OSError as error:
                self.error = error
