"""Independent work on all processors, and how much of it is done."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def side_by_side(work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Do the same with each of several things, on all processors: simulations and compilers hold no other up."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            return list(pool.map(work, items))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


class Counter:
    """Tells how many parts of a step are done.

    Parameters
    ----------
    progress : callable
        Told the step; if it has a method ``done(part, whole)``, that is told how far it is.
    text : str
        The step.
    whole : int
        Parts.
    """

    def __init__(self, progress: Callable[[str], None], text: str, whole: int):
        progress(text)
        self._done: Callable[[int, int], None] | None = getattr(progress, "done", None)
        self._part, self._whole, self._lock = 0, whole, Lock()

    def one_more(self) -> None:
        """One more part is done; threads may say so at once."""
        with self._lock:
            self._part += 1
            if self._done is not None:
                self._done(self._part, self._whole)
