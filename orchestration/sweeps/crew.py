"""Cases run by this process or by several workers, whatever becomes of a worker."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from math import inf

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.pool import Pool
from orchestration.fmu.isolation.process import Ended
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
    if task.limits is None or task.equations:
        with Repeated(task) as one:  # what is wrong with the FMU is told here, in one line
            if count == 1 or len(which) < 2:
                parts = Parts(task, which)
                while parts:
                    rows = parts.next()
                    found = one.run(cases[rows])
                    parts.took(len(rows), found.seconds)
                    yield rows, found
                return
    with _pool(task, count) as submit:
        yield from _side_by_side(submit, task, cases, Parts(task, which, count), count)


@contextmanager
def _pool(task: Task, count: int) -> Iterator[Submit]:
    """Something that runs cases for whoever submits them."""
    if not task.equations:
        with Pool(task.limits or Limits(inf, inf), count, _open, task) as processes:
            yield lambda values: processes.submit(_work, values)
        return
    with Repeated(task) as one, ThreadPoolExecutor(count) as threads:
        try:
            yield lambda values: threads.submit(one.run, values)
        finally:
            threads.shutdown(wait=False, cancel_futures=True)


def _side_by_side(
    submit: Submit, task: Task, cases: Array, parts: Parts, count: int
) -> Iterator[Part]:
    """Let workers run parts until all are done, and halves of one whose worker ends until the case is found."""
    running: dict[Future[Outcomes], list[int]] = {}
    suspects: list[list[int]] = []
    while parts or running or suspects:
        while (parts or suspects) and len(running) < AHEAD * count:
            rows = suspects.pop() if suspects else parts.next()
            running[submit(cases[rows])] = rows
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            rows = running.pop(future)
            try:
                found = future.result()
            except Ended as end:
                half = len(rows) // 2
                suspects += [part for part in (rows[:half], rows[half:]) if half]
                if not half:
                    yield (
                        rows,
                        failed(task, f"{end.state.words(task.time, task.path.name)}: {end.reason}"),
                    )
                continue
            parts.took(len(rows), found.seconds)
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
