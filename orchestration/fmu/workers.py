"""Processes beside this one that run FMUs: what they unpack goes with them, and an interrupt is not theirs to hear."""

from __future__ import annotations

import signal
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Any

from fmus.kit.storage import scratch


@contextmanager
def workers(count: int, begin: Callable[..., None], *arguments: Any) -> Iterator[ProcessPoolExecutor]:
    """Let processes run while the context lasts; they are ended if it ends with an exception.

    Parameters
    ----------
    count : int
    begin : callable
        Of a module, called in each process with the arguments before anything else.
    *arguments
        Paths and numbers.

    Yields
    ------
    ProcessPoolExecutor
    """
    others = {*active_children()}
    # a process that is killed removes nothing: this one does
    with scratch.folder("workers") as folder:
        # a fresh interpreter: what this process has open, FMUs among it, is not copied into a worker
        pool = ProcessPoolExecutor(count, get_context("spawn"), _begin, (str(folder), begin, arguments))
        try:
            yield pool
        except BaseException:  # an interrupt, or nobody wants more: workers are in the middle of something
            for child in {*active_children()} - others:
                child.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _begin(folder: str, begin: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = folder
    begin(*arguments)
