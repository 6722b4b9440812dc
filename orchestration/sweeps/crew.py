"""Cases run by this process or by several workers, whatever becomes of a worker."""

from __future__ import annotations

import signal
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context

import numpy as np
from numpy.typing import NDArray

from orchestration.sweeps.task import Outcome, Repeated, Task, failed

Array = NDArray[np.float64]
Numbered = tuple[int, Outcome]
_LARGEST, _PARTS = 64, 8  # cases that a worker is told at once, and in how many parts each worker's share is told
_AHEAD = 2  # parts for each worker that are told before it needs them

_repeated: Repeated | None = None  # of a worker


def outcomes(task: Task, cases: Array, which: Sequence[int], workers: int = 1) -> Iterator[Numbered]:
    """Run cases, and tell each as soon as it is there.

    Parameters
    ----------
    task : Task
    cases : ndarray, shape (n, p)
    which : sequence of int
        Rows to run.
    workers : int
        Processes besides this one; with one the cases run here.

    Yields
    ------
    tuple of int and Outcome
        Row, and what it left; in any order with several workers. A case whose worker ends is run once more alone, and
        fails if its worker ends again.

    Raises
    ------
    UserError
        If the FMU cannot be opened.
    """
    if workers == 1 or len(which) < 2:
        with Repeated(task) as one:
            for row in which:
                yield row, one.run(cases[row])
        return
    with Repeated(task):  # what is wrong with the FMU is told here, in one line
        pass
    size = int(np.clip(len(which) // (workers * _PARTS), 1, _LARGEST))
    parts = deque([*which[at : at + size]] for at in range(0, len(which), size))
    while parts:
        suspects = yield from _side_by_side(task, cases, parts, workers)
        for row in suspects:
            yield row, _alone(task, cases[row])


def _pool(task: Task, workers: int) -> ProcessPoolExecutor:
    # a fresh interpreter: what this process has open, FMUs among it, is not copied into a worker
    return ProcessPoolExecutor(workers, get_context("spawn"), _open, (task,))


def _side_by_side(
    task: Task, cases: Array, parts: deque[list[int]], workers: int
) -> Generator[Numbered, None, list[int]]:
    """Let workers run parts until all are done or a worker ends; returns rows that were under way then."""
    others = {*active_children()}
    pool = _pool(task, workers)
    running: dict[Future[list[Outcome]], list[int]] = {}
    try:
        while parts or running:
            while parts and len(running) < _AHEAD * workers:
                running[pool.submit(_work, cases[parts[0]])] = parts[0]
                parts.popleft()  # not before: a worker may have ended, and nothing more is taken then
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                found = future.result()
                yield from zip(running.pop(future), found, strict=True)
    except BrokenProcessPool:
        return [row for part in running.values() for row in part]
    except BaseException:  # an interrupt, or nobody wants more: workers are in the middle of something
        for child in {*active_children()} - others:
            child.terminate()
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    return []


def _alone(task: Task, values: Array) -> Outcome:
    """Run a case in a worker of its own."""
    with _pool(task, 1) as pool:
        try:
            return pool.submit(_work, values[np.newaxis]).result()[0]
        except BrokenProcessPool:
            return failed(task, f"{task.path.name}: the process that ran it ended")


def _open(task: Task) -> None:
    """Open the FMU of a worker; it ends with it. An interrupt is the main process's to hear."""
    global _repeated
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _repeated = Repeated(task)
    _repeated.__enter__()


def _work(cases: Array) -> list[Outcome]:
    """Run cases (k, p) in a worker."""
    assert _repeated is not None
    return [_repeated.run(values) for values in cases]
