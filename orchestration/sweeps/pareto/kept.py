"""Points of a search that are kept as they come, so that an interrupted search goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.storage import scratch
from orchestration.journal import WorkJournal, check, locked_folder
from orchestration.sweeps.pareto.objectives import Objectives


class KeptPoints:
    """Points of a search by their rows: each is searched once, and then in a journal.

    Parameters
    ----------
    objectives : Objectives
    journal : WorkJournal
        Of rows with shares, objectives, and the simulations that they took.
    """

    def __init__(self, objectives: Objectives, journal: WorkJournal):
        self._of = objectives
        self._journal = journal

    def find(self, row: int, search: Callable[[], Array]) -> Array:
        """Return the shares of a point, which are searched unless the journal has them."""
        if self._journal.is_done(row):
            self._of.evaluations += int(self._journal.numbers[row, -1])
        else:
            before = self._of.evaluations
            shares = search()
            worst = self._of.worst(shares)
            effort = self._of.evaluations - before
            self._journal.keep(row, np.concatenate([shares, worst, [effort]]))
        self._of.forget()  # so that the next point takes as many, whichever way this one came
        return np.array(self._journal.numbers[row, : len(self._of.ranges)])

    def worst(self, row: int) -> Array:
        """Return the worst output of each objective at a point that was found, shape (m,)."""
        return np.array(self._journal.numbers[row, len(self._of.ranges) : -1])

    def close(self) -> None:
        """Let go of the journal, before its folder is removed: Windows keeps open files."""
        del self._journal


@contextmanager
def kept_points(
    objectives: Objectives, count: int, settings: tuple[int, ...], folder: Path | None
) -> Iterator[KeptPoints]:
    """Open the journal of a search, in a folder or for this time only.

    Parameters
    ----------
    objectives : Objectives
    count : int
        Points in all.
    settings : tuple of int
        Of the search.
    folder : Path, optional
        It stays, and the same search goes on from there.

    Raises
    ------
    UserError
        If the folder is of another search, of another process, or holds something else.
    """
    width = len(objectives.ranges) + len(objectives.objectives) + 1
    with ExitStack() as stack:
        held = folder or stack.enter_context(scratch.folder("optimisation"))
        check(held)
        stack.enter_context(locked_folder(held))
        about = {} if folder is None else objectives.digests() | {"the search": repr(settings)}
        kept = KeptPoints(objectives, WorkJournal(held, "optimisation", about, (count, width)))
        stack.callback(kept.close)
        yield kept
