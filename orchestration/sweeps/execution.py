"""Execution of a sweep: from its cases to a labelled dataset."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit import UserError, quoting
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
    design: Design,
    workers: int = 1,
    folder: Path | None = None,
    *,
    progress: Callable[[int, int], None] = lambda done, whole: None,
    scheduler: str | None = None,
) -> SweepResult:
    """Run the cases of a design that are not in the journal yet.

    Parameters
    ----------
    model : Model
    task : Task
    design : Design
    workers : int
        Number of processes, which does not change a bit of the numbers.
    folder : Path, optional
        Folder of the journal, from which an interrupted sweep is continued. It is not removed, and
        traces are read from it when they are used.
    progress : callable
        Called with the number of finished cases and the number of all.
    scheduler : str, optional
        Address of a Dask cluster that runs the cases, with the same numbers.

    Returns
    -------
    SweepResult
        See `dataset`.

    Raises
    ------
    UserError
        If the FMU cannot be opened, or the folder belongs to another sweep, is in use by another
        process, or has other contents.
    """
    if folder is None:
        check_memory(task, design)
    guid = task.source.guid
    with ExitStack() as stack:
        journal_folder = folder or stack.enter_context(scratch.folder("sweep"))
        check(journal_folder)
        stack.enter_context(locked_folder(journal_folder))
        journal = SweepJournal(journal_folder, task, design.cases, guid)
        open_cases = journal.open_rows
        count = len(design.cases)
        done = count - len(open_cases)
        progress(done, count)
        repeats = _group_repeats(design, open_cases)
        remarks: set[str] = set()
        for rows, outcomes in _run_cases(task, design.cases, [*repeats], workers, scheduler):
            done += _write_repeats(journal, rows, outcomes, repeats)
            remarks.update(outcomes.remarks)
            progress(done, count)
        result = dataset(model, task, design, journal)
        if folder is None:
            result.load()
        del journal  # closes its files, without which Windows does not remove the folder
    told = {"remarks": "\n".join(sorted(remarks))} if remarks else {}
    return result.assign_attrs(model=model.name, guid=guid, engine=task.engine, **told)


def _write_repeats(
    journal: SweepJournal,
    rows: Sequence[int],
    outcomes: Outcomes,
    repeats: Mapping[int, Sequence[int]],
) -> int:
    """Write the outcomes of rows for all their repeats, and return the number of written cases."""
    written: list[int] = []
    indices: list[int] = []  # of the outcome of each written row
    for k, row in enumerate(rows):
        written += repeats[row]
        indices += [k] * len(repeats[row])
    journal.write(written, outcomes.select(indices))
    return len(written)


def _run_cases(
    task: Task, cases: Array, rows: list[int], workers: int, scheduler: str | None
) -> Iterator[RowsAndOutcomes]:
    """Run cases; at the end the FMU runs those that compiled code left undecided."""
    undecided: list[int] = []
    for chunk, outcomes in _run_by_workers(task, cases, rows, workers, scheduler):
        undecided += [chunk[k] for k in outcomes.undecided]
        decided = [k for k in range(len(chunk)) if k not in outcomes.undecided]
        yield [chunk[k] for k in decided], outcomes.select(decided)
    if undecided:
        yield from _run_by_workers(task.by_fmu, cases, undecided, workers, scheduler)


def _run_by_workers(
    task: Task, cases: Array, rows: list[int], workers: int, scheduler: str | None
) -> Iterator[RowsAndOutcomes]:
    """Run cases by local workers, or on a cluster if there is a scheduler."""
    if scheduler is None or not rows:
        return run_cases(task, cases, rows, min(workers, max(1, len(rows))))
    return run_on_cluster(scheduler, task, cases, rows)


def check_memory(task: Task, design: Design) -> None:
    """Raise if the traces of a sweep without a folder are too large for the memory.

    Raises
    ------
    UserError
        With the size of the traces.
    """
    if TRACE not in task.keep:
        return
    size = 8.0 * len(design.cases) * len(task.outputs) * len(task.time)
    if size > _MOST_IN_MEMORY:
        raise UserError(
            f"{option('keep', [TRACE])}: {size / 1e9:.3g} GB of traces, too large for"
            f" memory (allowed: {_MOST_IN_MEMORY / 1e9:g} GB); name a store, such as"
            f" {option('folder', 'traces.zarr')}"
        )


def _group_repeats(design: Design, open_cases: Sequence[int]) -> Mapping[int, Sequence[int]]:
    """Return the rows of identical cases by the first of them, which is run for all.

    Only lists have repeats.
    """
    if design.kind != "list":
        return {row: (row,) for row in open_cases}
    groups: dict[bytes, list[int]] = {}
    for row in open_cases:
        groups.setdefault(design.cases[row].tobytes(), []).append(row)
    return {rows[0]: rows for rows in groups.values()}


def dataset(model: Model, task: Task, design: Design, journal: SweepJournal) -> SweepResult:
    """Return the outcomes of a sweep as a labelled dataset.

    Parameters
    ----------
    model : Model
    task : Task
    design : Design
    journal : SweepJournal
        Outcomes of all cases.

    Returns
    -------
    SweepResult
        A variable for each output and reduction, such as ``displacement_last``, and for each trace.
        The dimensions are the parameters of a grid; of another design ``case``, with the parameters
        as coordinates. ``failure`` has the reasons of failed cases. All variables have units.
    """
    reductions = [name for name in task.keep if name != TRACE]
    numbers = np.array(journal.numbers)
    dims = tuple(design.names) if design.kind == "grid" else ("case",)
    values: dict[str, _Variable] = {}
    for m, output in enumerate(task.outputs):
        about = _attributes_of(model.outputs[output])
        for r, name in enumerate(reductions):
            values[f"{output}_{name}"] = (dims, numbers[:, r, m].reshape(design.shape), about)
        if TRACE in task.keep:
            values[output] = ((*dims, "time"), journal.traces(m, design.shape), about)
    failures = journal.failures
    if failures:
        rows = range(len(design.cases))
        reasons = np.array([failures.get(row, "") for row in rows], dtype=str)
        about = {"long_name": "why a case left nothing"}
        values["failure"] = (dims, reasons.reshape(design.shape), about)
    coordinates = _coordinates(model, design)
    if TRACE in task.keep:
        coordinates["time"] = (("time",), task.time, {"units": "s", "long_name": "time"})
    attributes = {"design": design.kind, "over": quoting.shell(design.names)}
    return SweepResult(values, coordinates, attributes)


def _coordinates(model: Model, design: Design) -> dict[str, _Variable]:
    """Return the parameters of a design as coordinates: dimensions of a grid, or values by case."""
    signals = model.settable
    coordinates: dict[str, _Variable] = {}
    for parameter, column in zip(design.ranges, design.cases.T, strict=True):
        name = parameter.name
        about = _attributes_of(signals[name])
        if design.kind == "grid":
            coordinates[name] = ((name,), parameter.values, about)
        else:
            coordinates[name] = (("case",), column, about)
    return coordinates


def _attributes_of(signal: Signal) -> dict[str, str]:
    """Return units and description of a signal as attributes."""
    return {
        "units": signal.unit,
        "long_name": signal.doc or signal.name,
        "display_units": signal.display,
    }
