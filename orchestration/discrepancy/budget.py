"""The time that a diagnosis may take, and what was left undone when it was spent."""

from __future__ import annotations

import math
from collections.abc import Iterable
from threading import Lock
from time import monotonic

from orchestration.discrepancy.note import Note, NoteCode

DEFAULT_TIME = 60.0  # s, on two processors, of a record of ten minutes
_SAMPLES = 60_000  # of ten minutes at 100 Hz; a longer record has as much more time


def default_time(samples: int) -> float:
    """Seconds that a diagnosis of a record of so many samples may take: a minute, and more in proportion beyond."""
    return DEFAULT_TIME * max(1.0, samples / _SAMPLES)


class Budget:
    """Time that is counted from here on.

    Whoever would begin something that the answer can do without asks whether the time is spent. As long as it is not,
    nothing hangs on how fast the machine is; afterwards what was left undone is noted.

    Parameters
    ----------
    seconds : float
        Without limit by default.
    """

    def __init__(self, seconds: float = math.inf):
        self.seconds = seconds
        self._end, self._lock = monotonic() + seconds, Lock()
        self._cut, self._untried = False, dict[str, None]()

    def spent(self) -> bool:
        """Whether there is no time left for what would be done now, which then counts as left undone."""
        if monotonic() < self._end:
            return False
        self._cut = True
        return True

    def leave(self, names: Iterable[str]) -> None:
        """Note effects that were not tried."""
        with self._lock:
            self._untried |= dict.fromkeys(names)

    def tried(self, names: Iterable[str]) -> None:
        """Note effects that were tried after all."""
        with self._lock:
            for name in names:
                self._untried.pop(name, None)

    @property
    def notes(self) -> list[Note]:
        """What is to be said of it: nothing unless something was left undone."""
        facts = {"seconds": self.seconds, "untried": tuple(self._untried)}
        return [Note(NoteCode.TIME_SPENT, "", facts)] if self._cut else []
