"""Execution of a sweep: from its cases to a labelled dataset."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.storage import scratch
from orchestration.fmu import Model, Signal
from orchestration.journal import check, locked_folder
from orchestration.reporting import option
from orchestration.sweeps.cluster import run_on_cluster
from orchestration.sweeps.designs import Design
from orchestration.sweeps.local_workers import RowsAndOutcomes, run_cases
from orchestration.sweeps.reductions import TRACE
from orchestration.sweeps.result import SweepResult
from orchestration.sweeps.storage import SweepJournal
from orchestration.sweeps.task import Outcomes, Task

_Variable = tuple[Sequence[str], Any, dict[str, str]]  # dimensions, values, attributes
MOST_WORKERS = 1000
_MOST_IN_MEMORY = 4e9  # bytes of traces


def run_sweep(
    model: Model,
    task: Task,
    cases: Design,
    workers: int = 1,
    folder: Path | None = None,
    *,
    progress: Callable[[int, int], None] = lambda done, whole: None,
    scheduler: str | None = None,
) -> SweepResult:
    """Run all cases of a design that were not run yet.

    Parameters
    ----------
    model : Model
    task : Task
    cases : Design
    workers : int
        Processes; the numbers are the same, bit for bit, however many there are.
    folder : Path, optional
        Folder of the journal, from which an interrupted sweep goes on; it stays, and traces are
        read from there when they are used.
    progress : callable
        Called with the number of cases that are done, and of all.
    scheduler : str, optional
        Address of a Dask cluster that runs them in place of processes here; the numbers are the
        same.

    Returns
    -------
    SweepResult
        See `dataset`.

    Raises
    ------
    UserError
        If the FMU cannot be opened, or the folder is of another sweep, of another process, or holds
        something else.
    """
    if folder is None:
        check_memory(task, cases)
    guid = task.source.guid
    with ExitStack() as stack:
        journal_folder = folder or stack.enter_context(scratch.folder("sweep"))
        check(journal_folder)
        stack.enter_context(locked_folder(journal_folder))
        journal = SweepJournal(journal_folder, task, cases.cases, guid)
        open_cases = journal.open_rows
        whole = len(cases.cases)
        done = whole - len(open_cases)
        progress(done, whole)
        repeats = _repeats(cases, open_cases)
        for rows, outcomes in _run_all(task, cases.cases, [*repeats], workers, scheduler):
            done += _write(journal, rows, outcomes, repeats)
            progress(done, whole)
        result = dataset(model, task, cases, journal)
        if folder is None:
            result.load()
        del journal  # before its folder is removed: Windows keeps open files
    return result.assign_attrs(model=model.name, guid=guid, engine=task.engine)


def _write(
    journal: SweepJournal,
    rows: Sequence[int],
    outcomes: Outcomes,
    repeats: Mapping[int, Sequence[int]],
) -> int:
    """Write the outcomes of rows for all cases that are identical; return how many these are."""
    written: list[int] = []
    places: list[int] = []
    for place, row in enumerate(rows):
        written += repeats[row]
        places += [place] * len(repeats[row])
    journal.write(written, outcomes.at(places))
    return len(written)


def _run_all(
    task: Task, cases: Array, rows: list[int], workers: int, scheduler: str | None
) -> Iterator[RowsAndOutcomes]:
    """Run cases; the FMU runs afterwards those that compiled code leaves undecided."""
    undecided: list[int] = []
    for which, outcomes in _run(task, cases, rows, workers, scheduler):
        undecided += [which[place] for place in outcomes.undecided]
        decided = [place for place in range(len(which)) if place not in outcomes.undecided]
        yield [which[place] for place in decided], outcomes.at(decided)
    if undecided:
        yield from _run(task.by_fmu, cases, undecided, workers, scheduler)


def _run(
    task: Task, cases: Array, rows: list[int], workers: int, scheduler: str | None
) -> Iterator[RowsAndOutcomes]:
    if scheduler is None or not rows:
        return run_cases(task, cases, rows, min(workers, max(1, len(rows))))
    return run_on_cluster(scheduler, task, cases, rows)


def check_memory(task: Task, cases: Design) -> None:
    """Refuse a sweep whose traces would be held in memory, and are too large for that.

    Raises
    ------
    UserError
        With the size of the traces.
    """
    if TRACE not in task.keep:
        return
    size = 8.0 * len(cases.cases) * len(task.outputs) * len(task.time)
    if size > _MOST_IN_MEMORY:
        raise UserError(
            f"{option('keep', [TRACE])}: {size / 1e9:.3g} GB of traces, and at most"
            f" {_MOST_IN_MEMORY / 1e9:g} GB are taken into memory; name a store, such as"
            f" {option('folder', 'traces.zarr')}"
        )


def _repeats(cases: Design, open_cases: Sequence[int]) -> Mapping[int, Sequence[int]]:
    """Group identical cases by the first of them, which is run for all; only lists have some."""
    if cases.kind != "list":
        return {row: (row,) for row in open_cases}
    groups: dict[bytes, list[int]] = {}
    for row in open_cases:
        groups.setdefault(cases.cases[row].tobytes(), []).append(row)
    return {rows[0]: rows for rows in groups.values()}


def dataset(model: Model, task: Task, cases: Design, journal: SweepJournal) -> SweepResult:
    """Return the outcomes of a sweep as a labelled dataset.

    Parameters
    ----------
    model : Model
    task : Task
    cases : Design
    journal : SweepJournal
        Of all its cases.

    Returns
    -------
    SweepResult
        A variable for each output and reduction, such as ``displacement_last``, and for each trace;
        over one dimension for each parameter of a grid, else over ``case`` with the parameters
        beside it. ``failure`` is a text where a case failed. Everything has its unit.
    """
    reductions = [name for name in task.keep if name != TRACE]
    numbers = np.array(journal.numbers)
    dims = tuple(cases.names) if cases.kind == "grid" else ("case",)
    values: dict[str, _Variable] = {}
    for m, output in enumerate(task.outputs):
        about = _about(model.outputs[output])
        for r, name in enumerate(reductions):
            values[f"{output}_{name}"] = (dims, numbers[:, r, m].reshape(cases.shape), about)
        if TRACE in task.keep:
            values[output] = ((*dims, "time"), journal.traces(m, cases.shape), about)
    failures = journal.failures
    if failures:
        rows = range(len(cases.cases))
        reasons = np.array([failures.get(row, "") for row in rows], dtype=str)
        about = {"long_name": "why a case left nothing"}
        values["failure"] = (dims, reasons.reshape(cases.shape), about)
    coordinates = _coordinates(model, cases)
    if TRACE in task.keep:
        coordinates["time"] = (("time",), task.time, {"units": "s", "long_name": "time"})
    attributes = {"design": cases.kind, "over": " ".join(cases.names)}
    return SweepResult(values, coordinates, attributes)


def _coordinates(model: Model, cases: Design) -> dict[str, _Variable]:
    """Return the parameters of a design: dimensions of a grid, else columns beside the cases."""
    signals = {**model.parameters, **model.inputs}
    coordinates: dict[str, _Variable] = {}
    for one, column in zip(cases.ranges, cases.cases.T, strict=True):
        about = _about(signals[one.name])
        if cases.kind == "grid":
            coordinates[one.name] = ((one.name,), one.values, about)
        else:
            coordinates[one.name] = (("case",), column, about)
    return coordinates


def _about(signal: Signal) -> dict[str, str]:
    return {
        "units": signal.unit,
        "long_name": signal.doc or signal.name,
        "display_units": signal.display,
    }
