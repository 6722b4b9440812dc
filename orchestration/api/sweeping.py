"""Sweeps from Python: ``ppy.sweep``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Unpack

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError
from orchestration.api.declaration import takes
from orchestration.api.options import NoteOption, SweepFileKeywords, SweepKeywords
from orchestration.api.simulation import (
    AnyModel,
    Inputs,
    as_model,
    inputs_over,
    points_of,
    values_of,
)
from orchestration.fmu import Model, Value
from orchestration.fmu.isolation import Limits
from orchestration.fmu.simulation import source_of
from orchestration.reporting import option
from orchestration.sweeps import SweepResult, Task, choose_equations, design, read_sweep
from orchestration.sweeps.execution import MOST_WORKERS, run_sweep
from orchestration.sweeps.ranges import Range, given_range, read_range
from orchestration.sweeps.reductions import KEPT, TRACE, checked_reductions
from orchestration.sweeps.sensitivity import SOBOL_INDICES, TORNADO


@takes(SweepKeywords)
def sweep(
    model: AnyModel,
    over: Mapping[str, str | Sequence[float] | Array],
    inputs: Inputs | None = None,
    **options: Unpack[SweepKeywords],
) -> SweepResult:
    """Run a model over many values of its parameters.

    Parameters
    ----------
    model, inputs
        As in `simulate`.
    over : Mapping of str to str or sequence of float
        Values of each parameter, or constant input: ``"0.3..0.7:41"``, ``"1e-3..1e-1:7 log"``,
        ``"6.3 N/mm, 9 N/mm"``, or numbers in the model's unit; ``"0.3..0.7"`` for a design that
        chooses them.

    Returns
    -------
    SweepResult
        A dataset of xarray with units. A grid has one dimension for each parameter, any other
        design the dimension ``case``.

    Raises
    ------
    UserError
        If an argument does not fit the model.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> over = {"R1": "0.3..0.7:3", "C": "5, 10"}
    >>> found = ppy.sweep("ppy_actuator", over, {"current": 0.5}, stop=10.0, step=0.1)
    >>> dict(found["voltage_last"].sizes)
    {'R1': 3, 'C': 2}
    >>> found["voltage_last"].units
    'V'
    """
    subject = as_model(model).with_options(options)
    _refuse_unfit(options)
    kind = options["kind"]
    ranges = ranges_over(over, subject)
    points = points_of(subject, options["time"], options["stop"], options["step"])
    driven = inputs_over(subject, inputs or {}, points)
    given = values_of(subject, options["settings"])
    # a tornado varies one parameter while the others keep their start
    starts = _starts(ranges, given, subject) if kind == TORNADO else {}
    settings = {name: value for name, value in given.items() if name not in starts}
    cases = design(ranges, kind, options["samples"], options["seed"], starts)
    keep = _reductions(options["keep"], kind)
    twice = next((name for name in cases.names if name in {*settings, *driven}), None)
    if twice is not None:
        raise UserError(f"{twice} is swept, and set to one value besides")
    isolate = subject.foreign if options["isolate"] is None else options["isolate"]
    task = Task(
        source_of(subject),
        tuple(cases.names),
        settings,
        points,
        driven,
        subject.kept or tuple(subject.outputs),
        tuple(keep),
        choose_equations(subject, options["engine"]),
        (options["limits"] or Limits()) if isolate else None,
    )
    options["check"](task, cases)
    folder = options["folder"]
    return run_sweep(
        subject,
        task,
        cases,
        options["workers"],
        None if folder is None else Path(folder),
        progress=options["progress"],
        scheduler=options["scheduler"],
    )


def ranges_over(over: Mapping[str, str | Sequence[float] | Array], model: Model) -> list[Range]:
    """Return the range of each parameter from a text or from numbers."""
    ranges = []
    for name, values in over.items():
        if isinstance(values, str):
            ranges.append(read_range(f"{name}={values}", model))
        else:
            ranges.append(given_range(name, values, model))
    return ranges


def _starts(
    ranges: Sequence[Range], settings: Mapping[str, Value], model: Model
) -> dict[str, float]:
    """Return the value of each parameter while another is varied: its setting, or its start."""
    known = model.settable
    return {one.name: float(settings.get(one.name, known[one.name].start)) for one in ranges}


def _reductions(keep: Sequence[str] | None, kind: str) -> list[str]:
    """Return the reductions to keep; UserError for traces only if the design needs numbers."""
    kept = checked_reductions(KEPT if keep is None else keep)
    if kind in (SOBOL_INDICES, TORNADO) and not {*kept} - {TRACE}:
        raise UserError(
            f"{option('keep', [TRACE])}: {option('kind', kind)} asks for numbers, such as last"
        )
    return kept


def _refuse_unfit(options: SweepKeywords) -> None:
    """Raise UserError for a wrong number of workers."""
    workers = options["workers"]
    scheduler = options["scheduler"]
    if not 1 <= workers <= MOST_WORKERS:
        raise UserError(f"workers {workers}: from 1 to {MOST_WORKERS:,}")
    if scheduler is not None and workers > 1:
        raise UserError(
            f"workers {workers}: they are of this machine; the cluster at {scheduler} has its own"
        )


@takes(SweepFileKeywords, NoteOption)
def sweep_file(
    path: str | Path,
    *,
    note: Callable[[str], None] | None = None,
    **options: Unpack[SweepFileKeywords],
) -> SweepResult:
    """Run a sweep that a TOML file describes.

    Parameters
    ----------
    path : str or Path
        An experiment, the values of its parameters, and the reductions to keep.

    Returns
    -------
    SweepResult
        As from `sweep`.

    Raises
    ------
    UserError
        If a value in the file is wrong, or does not fit the model.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> found = ppy.sweep_file("examples/release.toml")
    >>> dict(found["voltage_largest"].sizes)
    {'case': 64}
    """
    request = read_sweep(Path(path), note or (lambda line: None))
    table = request.table
    data = sweep(
        request.model,
        request.over,
        request.inputs,
        time=request.time,
        settings=request.settings,
        kind=request.kind,
        samples=request.samples,
        seed=table.seed,
        outputs=request.outputs,
        keep=request.keep,
        **options,
    )
    return data.assign_attrs({"title": table.title} if table.title else {})
