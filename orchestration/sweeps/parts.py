"""Cases divided into parts, so large that to tell of one costs little, and so small that little is lost with one."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from orchestration.sweeps.task import Task

LARGEST = 1024  # cases
SECONDS = 0.05  # that a part is to take: within which a Ctrl-C is heard, too
_BYTES = 16_000_000  # that the courses of a part take, at most, unless one takes more
_GROWTH = 4  # from one part to the next


class Parts:
    """Parts of cases that are left, whose size follows how long they take.

    Parameters
    ----------
    task : Task
    which : sequence of int
        Rows of its cases.
    count : int
        Who runs them side by side: none gets so much that the others have nothing to do.
    """

    def __init__(self, task: Task, which: Sequence[int], count: int = 1):
        self._left, self._count = deque(which), count
        course = 8 * len(task.time) * len(task.outputs)
        self._most, self._size = max(1, min(LARGEST, _BYTES // course)), 1

    def __bool__(self) -> bool:
        return bool(self._left)

    def next(self) -> list[int]:
        """Give rows that are to be run next, and are not left any more."""
        size = min(self._size, -(-len(self._left) // (2 * self._count)))
        return [self._left.popleft() for _ in range(size)]

    def took(self, cases: int, seconds: float) -> None:
        """Learn how long some cases took."""
        wanted = int(SECONDS * cases / max(seconds, 1e-9))
        self._size = max(1, min(self._most, wanted, _GROWTH * max(cases, self._size)))
