"""Chunks of cases for workers, of a size that adapts to the time that cases take.

A chunk is large enough to make its transfer cheap, and small enough to lose little with it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from orchestration.sweeps.task import Task

LARGEST = 1024  # cases
SECONDS = 0.05  # duration of a chunk, for which a Ctrl-C must wait
_BYTES = 16_000_000  # of the traces of a chunk, at most, unless one case has more
_GROWTH = 4  # largest ratio of the sizes of consecutive chunks
QUEUED = 2  # chunks in the queue of each worker


class Chunks:
    """Queue of the cases that are still to be run, in chunks.

    Parameters
    ----------
    task : Task
    open_rows : sequence of int
        Rows of the cases.
    count : int
        Workers that run them in parallel, and among which the cases are divided.
    """

    def __init__(self, task: Task, open_rows: Sequence[int], count: int = 1):
        self._waiting = deque(open_rows)
        self._count = count
        trace = 8 * len(task.time) * len(task.outputs)
        self._most = max(1, min(LARGEST, _BYTES // trace))
        self._size = 1

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def next(self) -> list[int]:
        """Remove the next chunk from the queue and return its rows."""
        # half of a worker's share at most, rounded up, so that all workers end at about one time
        share = -(-len(self._waiting) // (2 * self._count))
        return [self._waiting.popleft() for _ in range(min(self._size, share))]

    def adapt(self, cases: int, seconds: float) -> None:
        """Adapt the size of chunks to `SECONDS`, from the time that a number of cases took."""
        target = int(SECONDS * cases / max(seconds, 1e-9))
        self._size = max(1, min(self._most, target, _GROWTH * max(cases, self._size)))
