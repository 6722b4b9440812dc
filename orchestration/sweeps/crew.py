"""Cases run by this process or by several workers, whatever becomes of a worker."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.workers import workers
from orchestration.sweeps.parts import Parts
from orchestration.sweeps.task import Outcomes, Repeated, Task, failed

Array = NDArray[np.float64]
Part = tuple[list[int], Outcomes]
Submit = Callable[[Array], "Future[Outcomes]"]
AHEAD = 2  # parts for each worker that are told before it needs them

_repeated: Repeated | None = None  # of a worker


def outcomes(task: Task, cases: Array, which: Sequence[int], count: int = 1) -> Iterator[Part]:
    """Run cases, and tell what some left as soon as it is there.

    Parameters
    ----------
    task : Task
    cases : ndarray, shape (n, p)
    which : sequence of int
        Rows to run.
    count : int
        Workers: processes besides this one, or its threads for compiled code; with one the cases run here.

    Yields
    ------
    list of int and Outcomes
        Rows, and what they left; in any order with several workers. Cases whose worker ends are run once more, in
        fewer at a time; one whose worker ends when it has nothing else to run fails.

    Raises
    ------
    UserError
        If the FMU cannot be opened.
    """
    with Repeated(task) as one:  # what is wrong with the FMU is told here, in one line
        if count == 1 or len(which) < 2:
            parts = Parts(task, which)
            while parts:
                rows = parts.next()
                found = one.run(cases[rows])
                parts.took(len(rows), found.seconds)
                yield rows, found
            return
    parts = Parts(task, which, count)
    while parts:
        for rows in (yield from _side_by_side(task, cases, parts, count)):
            yield from _narrowed(task, cases, rows)


@contextmanager
def _pool(task: Task, count: int) -> Iterator[Submit]:
    """Something that runs cases for whoever submits them."""
    if not task.equations:
        with workers(count, _open, task) as processes:
            yield lambda values: processes.submit(_work, values)
        return
    with Repeated(task) as one, ThreadPoolExecutor(count) as threads:
        try:
            yield lambda values: threads.submit(one.run, values)
        finally:
            threads.shutdown(wait=False, cancel_futures=True)


def _side_by_side(task: Task, cases: Array, parts: Parts, count: int) -> Generator[Part, None, list[list[int]]]:
    """Let workers run parts until all are done or a worker ends; returns parts that were under way then."""
    running: dict[Future[Outcomes], list[int]] = {}
    try:
        with _pool(task, count) as submit:
            while parts or running:
                while parts and len(running) < AHEAD * count:
                    rows = parts.next()
                    try:
                        running[submit(cases[rows])] = rows
                    except BrokenProcessPool:  # a worker has ended, and nothing more is taken
                        parts.back(rows)
                        raise
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    found = future.result()
                    rows = running.pop(future)
                    parts.took(len(rows), found.seconds)
                    yield rows, found
    except BrokenProcessPool:
        return [*running.values()]
    return []


def _narrowed(task: Task, cases: Array, rows: list[int]) -> Iterator[Part]:
    """Run cases in a worker of their own, and halves of them if it ends, until the one is found that ends it."""
    try:
        with _pool(task, 1) as submit:
            found = submit(cases[rows]).result()
    except BrokenProcessPool:
        if len(rows) == 1:
            yield rows, failed(task, f"{task.path.name}: the process that ran it ended")
            return
        half = len(rows) // 2
        for part in (rows[:half], rows[half:]):
            yield from _narrowed(task, cases, part)
        return
    yield rows, found


def _open(task: Task) -> None:
    """Open the FMU of a worker; it ends with it."""
    global _repeated
    _repeated = Repeated(task)
    _repeated.__enter__()


def _work(cases: Array) -> Outcomes:
    """Run cases (k, p) in a worker."""
    assert _repeated is not None
    return _repeated.run(cases)
