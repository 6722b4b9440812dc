"""Chunks of cases for workers, whose size follows how long cases take.

A chunk is so large that handing it over costs little, and so small that little is lost with it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from orchestration.sweeps.task import Task

LARGEST = 1024  # cases
SECONDS = 0.05  # that a chunk is to take, and a Ctrl-C has to wait for
_BYTES = 16_000_000  # of the traces of a chunk, at most, unless one case has more
_GROWTH = 4  # at most, from one chunk to the next
QUEUED = 2  # chunks that each worker is given ahead of need


class Chunks:
    """The cases that are still to be run, handed out in chunks.

    Parameters
    ----------
    task : Task
    which : sequence of int
        Rows of the cases.
    count : int
        Workers that run them in parallel: none gets so much that others have nothing to do.
    """

    def __init__(self, task: Task, which: Sequence[int], count: int = 1):
        self._waiting = deque(which)
        self._count = count
        trace = 8 * len(task.time) * len(task.outputs)
        self._most = max(1, min(LARGEST, _BYTES // trace))
        self._size = 1

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def next(self) -> list[int]:
        """Take the rows of the next chunk."""
        share = -(-len(self._waiting) // (2 * self._count))  # rounded up
        return [self._waiting.popleft() for _ in range(min(self._size, share))]

    def took(self, cases: int, seconds: float) -> None:
        """Adapt the size of chunks to how long some cases took."""
        wanted = int(SECONDS * cases / max(seconds, 1e-9))
        self._size = max(1, min(self._most, wanted, _GROWTH * max(cases, self._size)))
