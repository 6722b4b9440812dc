"""The time budget of a diagnosis, and the note on what was not tried when it was spent.

The time is that of the processor, of this process and of the compilers that it ran: work, which is
the same on a machine that is busy with other things.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from threading import Lock
from time import monotonic, process_time

from orchestration.discrepancy.note import Note, NoteCode

DEFAULT_TIME = 60.0  # s, of a record of ten minutes
_ASKED = 100.0  # times a second, at most, that the system is asked for that time
_SAMPLES = 60_000  # of ten minutes at 100 Hz; a longer record has as much more time


def default_time(samples: int) -> float:
    """Return the seconds of processor time that a diagnosis of so many samples may take by default.

    That is a minute, and more in proportion for a record of more than ten minutes.
    """
    return DEFAULT_TIME * max(1.0, samples / _SAMPLES)


def spent_time() -> float:
    """Return the seconds of processor time of this process, and of others that it waited for."""
    return _spent_by(int(monotonic() * _ASKED))


@lru_cache(maxsize=1)
def _spent_by(instant: int) -> float:
    """Return that time; the system is asked once for an instant, as a simulation is made faster."""
    children = os.times()
    return process_time() + children.children_user + children.children_system


class Budget:
    """A budget of processor time that is counted from its making on.

    A search asks whether the time is spent before it begins anything that the answer can do
    without; the fits of models that are printed are none of that (`paused`). As long as it is not,
    no result depends on how fast the machine is; afterwards what was not tried is noted.

    Parameters
    ----------
    seconds : float
        Without limit by default.
    """

    def __init__(self, seconds: float = math.inf):
        self.seconds = seconds
        self._end = spent_time() + seconds
        self._lock = Lock()
        self._cut = False
        self._paused_until = -math.inf
        self._untried: dict[str, None] = {}

    def spent(self) -> bool:
        """Return whether there is no time for the next thing, which then counts as not done."""
        if spent_time() < max(self._end, self._paused_until):
            return False
        self._cut = True
        return True

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Spend nothing: what an answer cannot do without is outside of the budget.

        Where it ended by the clock, a fit would tell of that alone. It may take as long as the
        budget, and a minute at least: a model that is fitted to what it has nothing to do with may
        never come to its end.
        """
        if self._paused_until > -math.inf:
            yield
            return
        begun = spent_time()
        self._paused_until = begun + max(self.seconds, DEFAULT_TIME)
        try:
            yield
        finally:
            self._paused_until = -math.inf
            self._end += spent_time() - begun

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
        """The note that time was spent, if anything was not done for want of it."""
        if not self._cut:
            return []
        facts = {"seconds": self.seconds, "untried": tuple(self._untried)}
        return [Note(NoteCode.TIME_SPENT, "", facts)]
