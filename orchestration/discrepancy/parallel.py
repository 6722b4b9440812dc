"""A map over independent items on all processors, and a counter of how many are done."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def parallel_map(work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Do the same work with each of several items, on all processors, and return the results.

    Threads do, since simulations and compilers hold no lock of Python.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            return list(pool.map(work, items))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


class Counter:
    """A counter that tells how many parts of a step are done.

    Parameters
    ----------
    progress : callable
        Told the step; if it has a method ``done(part, whole)``, that is told how many are done.
    text : str
        The step.
    whole : int
        Parts.
    """

    def __init__(self, progress: Callable[[str], None], text: str, whole: int):
        progress(text)
        self._done: Callable[[int, int], None] | None = getattr(progress, "done", None)
        self._part = 0
        self._whole = whole
        self._lock = Lock()

    def one_more(self) -> None:
        """Count one more part as done; threads may do so at once."""
        with self._lock:
            self._part += 1
            if self._done is not None:
                self._done(self._part, self._whole)
