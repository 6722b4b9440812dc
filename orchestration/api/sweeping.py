"""Sweeps from Python: ``ppy.sweep``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmus.kit import Component
from fmus.kit.errors import UserError, suggestion
from orchestration.api.simulation import as_model, stimulus, values_of
from orchestration.fmu.isolation.limits import DEFAULT, Limits
from orchestration.fmu.model import Model
from orchestration.sweeps.compiled import chosen
from orchestration.sweeps.design import Design, design
from orchestration.sweeps.ranges import given_range, read_range
from orchestration.sweeps.reductions import KEPT, TRACE, checked
from orchestration.sweeps.run import MOST_WORKERS, run
from orchestration.sweeps.sensitivity.indices import KIND as SOBOL_INDICES
from orchestration.sweeps.sensitivity.tornado import KIND as TORNADO
from orchestration.sweeps.task import Task

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]


def sweep(
    model: Model | type[Component] | str,
    over: Mapping[str, str | Sequence[float] | Array],
    inputs: Mapping[str, ArrayLike | Callable[[Array], ArrayLike]] | None = None,
    *,
    time: ArrayLike | None = None,
    stop: float | None = None,
    step: float | None = None,
    settings: Mapping[str, float | str] | None = None,
    kind: str = "grid",
    samples: int | None = None,
    seed: int = 0,
    outputs: Sequence[str] = (),
    keep: Sequence[str] = KEPT,
    engine: str = "auto",
    workers: int = 1,
    scheduler: str | None = None,
    folder: str | Path | None = None,
    isolate: bool | None = False,
    limits: Limits = DEFAULT,
    progress: Callable[[int, int], None] = lambda done, whole: None,
    check: Callable[[Task, Design], None] = lambda task, cases: None,
) -> xarray.Dataset:
    """Run a model over many values of its parameters.

    Parameters
    ----------
    model, inputs, time, stop, step, settings
        As in `simulate`.
    over : Mapping of str to str or sequence of float
        What each parameter, or held input, goes through: ``"0.3..0.7:41"``, ``"1e-3..1e-1:7 log"``,
        ``"6.3 N/mm, 9 N/mm"``, or values in the model's unit; ``"0.3..0.7"`` for a design that chooses them.
    kind : {"grid", "list", "draws", "latin-hypercube", "sobol", "sobol-indices", "tornado"}
        Design; `sensitivity` and `tornado` tell what the last two come to, and `bands` what cases come to that were
        drawn at random, such as those of ``fit(...).draws(200)``.
    samples, seed : int
        Of those that choose values; of ``sobol-indices`` as many cases for each parameter, and twice as many besides.
    outputs : sequence of str
        All unless given.
    keep : sequence of str
        Of each output: ``last``, ``smallest``, ``largest``, ``mean``, ``rms``, or ``trace`` for its whole course.
    engine : {"auto", "fmu", "compiled"}
        What runs the cases: the FMU, or the equations of a component in compiled code, which comes to the same numbers
        sooner and is the choice of ``auto`` wherever it is possible.
    workers : int
        Processes, 1000 at most; never more than there are cases.
    scheduler : str, optional
        Address of a Dask cluster that runs the cases, such as ``"tcp://10.0.0.5:8786"``.
    folder : str or Path, optional
        Keeps what is done, so that the same call goes on after an interrupt; it stays. Traces are read from there
        when they are used, so that they need not fit into memory.
    isolate : bool, optional
        Run the FMU in processes of their own, which it may end or hang in: that case fails, and the others go on. None:
        if it is a file that somebody gave.
    limits : Limits
        Of such a process.
    progress : callable
        Told how many cases are done, and of how many.
    check : callable
        Told what is going to be run before anything is; what it raises ends the sweep.

    Returns
    -------
    xarray.Dataset
        With units, over one dimension for each parameter of a grid, else over ``case``.

    Raises
    ------
    UserError
        If something does not fit the model.

    Examples
    --------
    >>> import orchestration as ppy
    >>> found = ppy.sweep("ppy_actuator", {"R1": "0.3..0.7:3", "C": "5, 10"}, {"current": 0.5}, stop=10.0, step=0.1)
    >>> dict(found["voltage_last"].sizes)
    {'R1': 3, 'C': 2}
    >>> found["voltage_last"].units
    'V'
    """
    subject = as_model(model)
    if not 1 <= workers <= MOST_WORKERS:
        raise UserError(f"workers {workers}: from 1 to {MOST_WORKERS:,}")
    if scheduler is not None and workers > 1:
        raise UserError(
            f"workers {workers}: they are of this machine; the cluster at {scheduler} has its own"
        )
    unknown = next((name for name in outputs if name not in subject.outputs), None)
    if unknown is not None:
        raise UserError(
            f"{subject.name}: no output named {unknown!r}{suggestion(unknown, subject.outputs)}"
        )
    ranges = [
        read_range(f"{n}={v}", subject) if isinstance(v, str) else given_range(n, v, subject)
        for n, v in over.items()
    ]
    points, fed = stimulus(subject, inputs or {}, time, stop, step)
    given, starts = values_of(subject, settings), {}
    if kind == TORNADO:  # what is set is where the others stay
        known = {**subject.parameters, **subject.inputs}
        starts = {one.name: float(given.pop(one.name, known[one.name].start)) for one in ranges}
    cases = design(ranges, kind, samples, seed, starts)
    if kind in (SOBOL_INDICES, TORNADO) and not {*checked(keep)} - {TRACE}:
        raise UserError(f"--keep {TRACE}: --design {kind} asks for numbers, such as last")
    twice = next((n for n in cases.names if n in given or n in fed), None)
    if twice is not None:
        raise UserError(f"{twice} is swept, and set to one value besides")
    task = Task(
        subject.path,
        tuple(cases.names),
        given,
        points,
        fed,
        tuple(outputs or subject.outputs),
        tuple(checked(keep)),
        chosen(subject, engine),
        limits if (subject.foreign if isolate is None else isolate) else None,
    )
    check(task, cases)
    return run(
        subject, task, cases, workers, None if folder is None else Path(folder), progress, scheduler
    )


def sweep_file(
    path: str | Path,
    *,
    engine: str = "auto",
    workers: int = 1,
    scheduler: str | None = None,
    folder: str | Path | None = None,
    isolate: bool | None = False,
    limits: Limits = DEFAULT,
    progress: Callable[[int, int], None] = lambda done, whole: None,
    check: Callable[[Task, Design], None] = lambda task, cases: None,
    note: Callable[[str], None] = lambda line: None,
) -> xarray.Dataset:
    """Run a sweep that a TOML file describes.

    Parameters
    ----------
    path : str or Path
        An experiment, what its parameters go through, and what is kept.
    engine, workers, scheduler, folder, isolate, limits, progress, check
        As in `sweep`.
    note : callable
        Told what else is worth knowing, such as inputs that stay at their start value.

    Returns
    -------
    xarray.Dataset
        As of `sweep`.

    Raises
    ------
    UserError
        If something in the file is wrong or does not fit the model.

    Examples
    --------
    >>> import orchestration as ppy
    >>> found = ppy.sweep_file("examples/release.toml")
    >>> dict(found["voltage_largest"].sizes)
    {'case': 64}
    """
    from orchestration.sweeps.file import read_sweep

    asked = read_sweep(Path(path), note)
    table = asked.table
    return sweep(
        asked.model,
        asked.over,
        asked.inputs,
        time=asked.time,
        settings=asked.settings,
        kind=asked.kind,
        samples=asked.samples,
        seed=table.seed,
        outputs=asked.outputs,
        keep=asked.keep,
        engine=engine,
        workers=workers,
        scheduler=scheduler,
        folder=folder,
        isolate=isolate,
        limits=limits,
        progress=progress,
        check=check,
    ).assign_attrs({"title": table.title} if table.title else {})
