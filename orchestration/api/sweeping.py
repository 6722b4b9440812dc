"""Sweeps from Python: ``ppy.sweep``."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from pathlib import Path
from typing import Unpack

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
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
        What each parameter, or held input, goes through: ``"0.3..0.7:41"``, ``"1e-3..1e-1:7 log"``,
        ``"6.3 N/mm, 9 N/mm"``, or values in the model's unit; ``"0.3..0.7"`` for a design that
        chooses them.

    Returns
    -------
    SweepResult
        A dataset of xarray with units, over one dimension for each parameter of a grid, else over
        ``case``.

    Raises
    ------
    UserError
        If something does not fit the model.

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
    subject = as_model(model)
    _refuse_unfit(subject, options)
    kind = options["kind"]
    ranges = _ranges(over, subject)
    points = points_of(subject, options["time"], options["stop"], options["step"])
    driven = inputs_over(subject, inputs or {}, points)
    given = values_of(subject, options["settings"])
    # what a tornado sets is where the others stay
    starts = _starts(ranges, given, subject) if kind == TORNADO else {}
    settings = {name: value for name, value in given.items() if name not in starts}
    cases = design(ranges, kind, options["samples"], options["seed"], starts)
    keep = _kept(options["keep"], kind)
    _refuse_set_twice(cases.names, {*settings, *driven})
    isolate = subject.foreign if options["isolate"] is None else options["isolate"]
    task = Task(
        source_of(subject),
        tuple(cases.names),
        settings,
        points,
        driven,
        tuple(options["outputs"] or subject.kept or subject.outputs),
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


def _ranges(over: Mapping[str, str | Sequence[float] | Array], model: Model) -> list[Range]:
    """Return what each parameter goes through, of a text or of values."""
    return [
        read_range(f"{name}={values}", model)
        if isinstance(values, str)
        else given_range(name, values, model)
        for name, values in over.items()
    ]


def _starts(
    ranges: Sequence[Range], settings: Mapping[str, Value], model: Model
) -> dict[str, float]:
    """Return where each parameter stays while another is moved: what is set, or its start."""
    known = {**model.parameters, **model.inputs}
    return {one.name: float(settings.get(one.name, known[one.name].start)) for one in ranges}


def _kept(keep: Sequence[str] | None, kind: str) -> list[str]:
    """Return the reductions that are kept; refuse traces alone where a design needs numbers."""
    kept = checked_reductions(KEPT if keep is None else keep)
    if kind in (SOBOL_INDICES, TORNADO) and not {*kept} - {TRACE}:
        raise UserError(
            f"{option('keep', [TRACE])}: {option('kind', kind)} asks for numbers, such as last"
        )
    return kept


def _refuse_set_twice(swept: Sequence[str], given: Container[str]) -> None:
    twice = next((name for name in swept if name in given), None)
    if twice is not None:
        raise UserError(f"{twice} is swept, and set to one value besides")


def _refuse_unfit(subject: Model, options: SweepKeywords) -> None:
    """Refuse workers that there cannot be, and outputs that the model has not."""
    workers = options["workers"]
    scheduler = options["scheduler"]
    if not 1 <= workers <= MOST_WORKERS:
        raise UserError(f"workers {workers}: from 1 to {MOST_WORKERS:,}")
    if scheduler is not None and workers > 1:
        raise UserError(
            f"workers {workers}: they are of this machine; the cluster at {scheduler} has its own"
        )
    unknown = next((name for name in options["outputs"] if name not in subject.outputs), None)
    if unknown is not None:
        raise UserError(
            f"{subject.name}: no output named {unknown!r}{suggestion(unknown, subject.outputs)}"
        )


@takes(SweepFileKeywords, NoteOption)
def sweep_file(
    path: str | Path,
    *,
    note: Callable[[str], None] = lambda line: None,
    **options: Unpack[SweepFileKeywords],
) -> SweepResult:
    """Run a sweep that a TOML file describes.

    Parameters
    ----------
    path : str or Path
        An experiment, what its parameters go through, and what is kept.

    Returns
    -------
    SweepResult
        A dataset of xarray, as of `sweep`.

    Raises
    ------
    UserError
        If something in the file is wrong or does not fit the model.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> found = ppy.sweep_file("examples/release.toml")
    >>> dict(found["voltage_largest"].sizes)
    {'case': 64}
    """
    request = read_sweep(Path(path), note)
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
