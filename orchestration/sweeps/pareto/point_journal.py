"""Journal of the points of a search, from which an interrupted search is continued."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.storage import scratch
from orchestration.journal import WorkJournal, check, locked_folder
from orchestration.sweeps.pareto.objectives import Objectives


class PointJournal:
    """Points of a search by row, of which only those missing in the journal are searched.

    Parameters
    ----------
    objectives : Objectives
    journal : WorkJournal
        A row has shares, worst outputs, and the number of simulations.
    """

    def __init__(self, objectives: Objectives, journal: WorkJournal):
        self._objectives = objectives
        self._journal = journal

    def find(self, row: int, search: Callable[[], Array]) -> Array:
        """Return the parameters of a point from the journal, or search for them and store them.

        Parameters
        ----------
        row : int
            Of the point, in the journal.
        search : callable
            Returns the parameters.

        Returns
        -------
        ndarray, shape (p,)
            Shares of their ranges, from 0 to 1.
        """
        if self._journal.is_done(row):
            self._objectives.evaluations += int(self._journal.numbers[row, -1])
        else:
            before = self._objectives.evaluations
            shares = search()
            worst = self._objectives.worst(shares)
            effort = self._objectives.evaluations - before
            self._journal.keep(row, np.concatenate([shares, worst, [effort]]))
        # so that the next point takes the same number of simulations in either case
        self._objectives.forget()
        return np.array(self._journal.numbers[row, : len(self._objectives.ranges)])

    def worst(self, row: int) -> Array:
        """Return the worst output of each objective at a point of the journal, shape (m,)."""
        return np.array(self._journal.numbers[row, len(self._objectives.ranges) : -1])

    def close(self) -> None:
        """Close the files of the journal, without which Windows does not remove its folder."""
        del self._journal


@contextmanager
def point_journal(
    objectives: Objectives, count: int, settings: tuple[int, ...], folder: Path | None
) -> Iterator[PointJournal]:
    """Open the journal of a search, in a folder or in a temporary one.

    Parameters
    ----------
    objectives : Objectives
    count : int
        Number of points.
    settings : tuple of int
        Settings of the search.
    folder : Path, optional
        It is not removed, so that the same search can be continued.

    Yields
    ------
    PointJournal

    Raises
    ------
    UserError
        If the folder belongs to another search, is in use by another process, or has other
        contents.
    """
    width = len(objectives.ranges) + len(objectives.objectives) + 1
    with ExitStack() as stack:
        place = folder or stack.enter_context(scratch.folder("optimisation"))
        check(place)
        stack.enter_context(locked_folder(place))
        about = {} if folder is None else objectives.digests() | {"the search": repr(settings)}
        journal = PointJournal(
            objectives, WorkJournal(place, "optimisation", about, (count, width))
        )
        stack.callback(journal.close)
        yield journal
