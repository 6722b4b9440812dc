"""A sweep from its cases to a labelled dataset."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from fmus.kit.storage import scratch
from orchestration.fmu.archive import read_description
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Signal
from orchestration.sweeps.cluster import outcomes_of_cluster
from orchestration.sweeps.crew import Part, outcomes
from orchestration.sweeps.design import Design
from orchestration.sweeps.reductions import TRACE
from orchestration.sweeps.storage.journal import Journal, check
from orchestration.sweeps.storage.lock import held
from orchestration.sweeps.task import Task

Array = NDArray[np.float64]
MOST_WORKERS = 1000
_MOST_IN_MEMORY = 4e9  # bytes of traces


def run(
    model: Model,
    task: Task,
    cases: Design,
    workers: int = 1,
    folder: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, whole: None,
    scheduler: str | None = None,
) -> xarray.Dataset:
    """Run all cases of a design that were not run yet.

    Parameters
    ----------
    model : Model
    task : Task
    cases : Design
    workers : int
        Processes; the numbers are the same, bit for bit, however many there are.
    folder : Path, optional
        Where what is done is kept, to go on with after an interrupt; it stays, and traces are read from there when
        they are used.
    progress : callable
        Told how many cases are done, and of how many.
    scheduler : str, optional
        Address of a Dask cluster that runs them in place of processes here; the numbers are the same.

    Returns
    -------
    xarray.Dataset
        See `dataset`.

    Raises
    ------
    UserError
        If the FMU cannot be opened, or the folder is of another sweep, of another process, or holds something else.
    """
    if folder is None:
        check_memory(task, cases)
    guid = read_description(task.path).guid
    with ExitStack() as stack:
        place = folder or stack.enter_context(scratch.folder("sweep"))
        check(place)
        stack.enter_context(held(place))
        journal = Journal(place, task, cases.cases, guid)
        left, whole = journal.left, len(cases.cases)
        progress(whole - len(left), whole)
        alike = _alike(cases, left)
        done = whole - len(left)
        for rows, left_by in _all(task, cases.cases, [*alike], workers, scheduler):
            same = [(row, place) for place, first in enumerate(rows) for row in alike[first]]
            journal.write([row for row, _ in same], left_by.at([place for _, place in same]))
            done += len(same)
            progress(done, whole)
        found = dataset(model, task, cases, journal)
        if folder is None:
            found.load()
        del journal  # before its folder goes: Windows keeps what is open
    return found.assign_attrs(model=model.name, guid=guid, engine=task.engine)


def _all(
    task: Task, cases: Array, rows: list[int], workers: int, scheduler: str | None
) -> Iterator[Part]:
    """Run cases, those that compiled code cannot judge by the FMU afterwards."""
    for one in (task, task.by_fmu) if task.equations else (task,):
        if one is not task and not rows:
            return
        if scheduler is None or not rows:
            ran = outcomes(one, cases, rows, min(workers, max(1, len(rows))))
        else:
            ran = outcomes_of_cluster(scheduler, one, cases, rows)
        rows = []
        for some, found in ran:
            rows += [some[place] for place in found.left]
            there = [place for place in range(len(some)) if place not in found.left]
            yield [some[place] for place in there], found.at(there)


def check_memory(task: Task, cases: Design) -> None:
    """Refuse a sweep whose traces are made in memory, and do not belong there.

    Raises
    ------
    UserError
        How large they are.
    """
    size = (
        8.0 * len(cases.cases) * len(task.outputs) * len(task.time) if TRACE in task.keep else 0.0
    )
    if size > _MOST_IN_MEMORY:
        raise UserError(
            f"--keep {TRACE}: {size / 1e9:.3g} GB of traces, and at most {_MOST_IN_MEMORY / 1e9:g} GB are taken into "
            "memory; name a store, such as --out traces.zarr (in Python a folder)"
        )


def _alike(cases: Design, left: Sequence[int]) -> Mapping[int, Sequence[int]]:
    """Cases that are left by the first that is the same, for a case is run once; only a list can have one twice."""
    if cases.kind != "list":
        return {row: (row,) for row in left}
    groups: dict[bytes, list[int]] = {}
    for row in left:
        groups.setdefault(cases.cases[row].tobytes(), []).append(row)
    return {rows[0]: rows for rows in groups.values()}


def dataset(model: Model, task: Task, cases: Design, journal: Journal) -> xarray.Dataset:
    """Label what a sweep left.

    Parameters
    ----------
    model : Model
    task : Task
    cases : Design
    journal : Journal
        Of all its cases.

    Returns
    -------
    xarray.Dataset
        A variable for each output and reduction, such as ``displacement_last``, and for each trace; over one dimension
        for each parameter of a grid, else over ``case`` with the parameters beside it. ``failure`` is a text where a
        case failed. Everything has its unit.
    """
    signals = {**model.parameters, **model.inputs}
    reductions = [name for name in task.keep if name != TRACE]
    grid, numbers, failures = cases.kind == "grid", np.array(journal.numbers), journal.failures
    dims = tuple(cases.names) if grid else ("case",)
    values: dict[str, tuple[Sequence[str], Any, dict[str, str]]] = {}
    for m, output in enumerate(task.outputs):
        about = _about(model.outputs[output])
        for r, name in enumerate(reductions):
            values[f"{output}_{name}"] = (dims, numbers[:, r, m].reshape(cases.shape), about)
        if TRACE in task.keep:
            values[output] = ((*dims, "time"), journal.traces(m, cases.shape), about)
    why = np.array([failures.get(row, "") for row in range(len(cases.cases))], dtype=str)
    if failures:
        values["failure"] = (
            dims,
            why.reshape(cases.shape),
            {"long_name": "why a case left nothing"},
        )
    coordinates = {
        one.name: (
            dims[k : k + 1] if grid else dims,
            one.values if grid else column,
            _about(signals[one.name]),
        )
        for k, (one, column) in enumerate(zip(cases.ranges, cases.cases.T, strict=True))
    }
    clock = (
        {"time": ("time", task.time, {"units": "s", "long_name": "time"})}
        if TRACE in task.keep
        else {}
    )
    return xarray.Dataset(
        values, {**coordinates, **clock}, {"design": cases.kind, "over": " ".join(cases.names)}
    )


def _about(signal: Signal) -> dict[str, str]:
    return {
        "units": signal.unit,
        "long_name": signal.doc or signal.name,
        "display_units": signal.display,
    }
