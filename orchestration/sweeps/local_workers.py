"""Local workers that run the cases of a sweep: this process, its threads, or other processes.

If a worker ends, its cases are run again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from math import inf

from fmus.kit.arrays import Array
from orchestration.fmu.isolation import Ended, Limits, Pool, keep
from orchestration.sweeps.chunking import QUEUED, Chunks
from orchestration.sweeps.task import CaseRunner, Outcomes, Task, failed_case

RowsAndOutcomes = tuple[list[int], Outcomes]
Submit = Callable[[Array], "Future[Outcomes]"]

_runner: CaseRunner | None = None  # of a worker process


def run_cases(
    task: Task, cases: Array, open_rows: Sequence[int], count: int = 1
) -> Iterator[RowsAndOutcomes]:
    """Run cases, and yield their outcomes in the order of completion.

    Parameters
    ----------
    task : Task
    cases : ndarray, shape (n, p)
    open_rows : sequence of int
        Rows to run.
    count : int
        Number of workers: other processes, or threads for compiled code. A single worker is this
        process, unless an FMU has limits, which can only be enforced on another process.

    Yields
    ------
    list of int and Outcomes
        Rows and their outcomes. If a worker ends, its cases are run again in smaller chunks; a case
        that ends its worker alone fails.

    Raises
    ------
    UserError
        If the FMU cannot be opened.
    """
    may_run_here = task.limits is None or task.equations
    if may_run_here:
        with CaseRunner(task) as runner:  # raises an error here if the FMU cannot be opened
            if count == 1 or len(open_rows) < 2:
                chunks = Chunks(task, open_rows)
                while chunks:
                    rows = chunks.next()
                    outcomes = runner.run(cases[rows])
                    chunks.adapt(len(rows), outcomes.seconds)
                    yield rows, outcomes
                return
    with _pool(task, count) as submit:
        yield from _run_in_parallel(submit, task, cases, Chunks(task, open_rows, count), count)


@contextmanager
def _pool(task: Task, count: int) -> Iterator[Submit]:
    """Yield a function that submits cases to workers."""
    if not task.equations:
        with Pool(task.limits or Limits(inf, inf), count, _open_runner, task) as processes:
            yield lambda values: processes.submit(_run_in_worker, values)
        return
    with CaseRunner(task) as runner, ThreadPoolExecutor(count) as threads:
        try:
            yield lambda values: threads.submit(runner.run, values)
        finally:
            threads.shutdown(wait=False, cancel_futures=True)


def _run_in_parallel(
    submit: Submit, task: Task, cases: Array, chunks: Chunks, count: int
) -> Iterator[RowsAndOutcomes]:
    """Run all chunks by workers.

    A chunk whose worker ends is halved again and again, until the case that causes it is alone.
    """
    running: dict[Future[Outcomes], list[int]] = {}
    suspects: list[list[int]] = []
    while chunks or running or suspects:
        while (chunks or suspects) and len(running) < QUEUED * count:
            rows = suspects.pop() if suspects else chunks.next()
            running[submit(cases[rows])] = rows
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            rows = running.pop(future)
            try:
                outcomes = future.result()
            except Ended as end:
                half = len(rows) // 2
                if half:
                    suspects += [rows[:half], rows[half:]]
                else:
                    where = end.state.describe(task.source.points(task.time), task.source.name)
                    yield rows, failed_case(task, f"{where}: {end.reason}")
                continue
            chunks.adapt(len(rows), outcomes.seconds)
            yield rows, outcomes


def _open_runner(task: Task) -> None:
    """Open the runner of a worker process for its lifetime."""
    global _runner
    _runner = keep(CaseRunner(task))


def _run_in_worker(cases: Array) -> Outcomes:
    """Run cases, shape (k, p), in a worker process."""
    assert _runner is not None
    return _runner.run(cases)
