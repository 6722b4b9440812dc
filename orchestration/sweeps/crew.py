"""Cases run by this process or by several workers, whatever becomes of a worker."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.workers import workers
from orchestration.sweeps.task import Outcome, Repeated, Task, failed

Array = NDArray[np.float64]
Numbered = tuple[int, Outcome]
_LARGEST, _PARTS = 64, 8  # cases that a worker is told at once, and in how many parts each worker's share is told
_BYTES = 16_000_000  # that the cases of a part leave, at most, unless one leaves more
_AHEAD = 2  # parts for each worker that are told before it needs them

_repeated: Repeated | None = None  # of a worker


def outcomes(task: Task, cases: Array, which: Sequence[int], count: int = 1) -> Iterator[Numbered]:
    """Run cases, and tell each as soon as it is there.

    Parameters
    ----------
    task : Task
    cases : ndarray, shape (n, p)
    which : sequence of int
        Rows to run.
    count : int
        Workers: processes besides this one; with one the cases run here.

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
    if count == 1 or len(which) < 2:
        with Repeated(task) as one:
            for row in which:
                yield row, one.run(cases[row])
        return
    with Repeated(task):  # what is wrong with the FMU is told here, in one line
        pass
    parts = portions(task, which, count)
    while parts:
        suspects = yield from _side_by_side(task, cases, parts, count)
        for row in suspects:
            yield row, _alone(task, cases[row])


def portions(task: Task, which: Sequence[int], count: int) -> deque[list[int]]:
    """Divide cases for workers: into several parts for each, of which none leaves more than memory is meant to hold."""
    nothing = failed(task, "")
    left = nothing.numbers.nbytes + nothing.trace.nbytes
    size = max(1, min(_LARGEST, _BYTES // max(1, left), len(which) // (count * _PARTS)))
    return deque([*which[at : at + size]] for at in range(0, len(which), size))


def _pool(task: Task, count: int) -> AbstractContextManager[ProcessPoolExecutor]:
    return workers(count, _open, task)


def _side_by_side(
    task: Task, cases: Array, parts: deque[list[int]], count: int
) -> Generator[Numbered, None, list[int]]:
    """Let workers run parts until all are done or a worker ends; returns rows that were under way then."""
    running: dict[Future[list[Outcome]], list[int]] = {}
    try:
        with _pool(task, count) as pool:
            while parts or running:
                while parts and len(running) < _AHEAD * count:
                    running[pool.submit(_work, cases[parts[0]])] = parts[0]
                    parts.popleft()  # not before: a worker may have ended, and nothing more is taken then
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    found = future.result()
                    yield from zip(running.pop(future), found, strict=True)
    except BrokenProcessPool:
        return [row for part in running.values() for row in part]
    return []


def _alone(task: Task, values: Array) -> Outcome:
    """Run a case in a worker of its own."""
    try:
        with _pool(task, 1) as pool:
            return pool.submit(_work, values[np.newaxis]).result()[0]
    except BrokenProcessPool:
        return failed(task, f"{task.path.name}: the process that ran it ended")


def _open(task: Task) -> None:
    """Open the FMU of a worker; it ends with it."""
    global _repeated
    _repeated = Repeated(task)
    _repeated.__enter__()


def _work(cases: Array) -> list[Outcome]:
    """Run cases (k, p) in a worker."""
    assert _repeated is not None
    return [_repeated.run(values) for values in cases]
