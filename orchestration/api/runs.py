"""Experiments and systems from Python: ``ppy.run``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import UserError
from orchestration.api.declaration import takes
from orchestration.api.options import RunKeywords
from orchestration.experiment import ExperimentResult, UnfinishedExperiment, read
from orchestration.experiment import run as make
from orchestration.fmu.isolation import Limits, isolation
from orchestration.master import Run
from orchestration.master import run as run_system
from orchestration.system import System


@overload
def run(
    what: System, time: ArrayLike, inputs: Mapping[str, ArrayLike] | None = None, **options: Any
) -> Run: ...


@overload
def run(what: str | Path, **options: Unpack[RunKeywords]) -> ExperimentResult: ...


@takes(RunKeywords)
def run(
    what: System | str | Path,
    time: ArrayLike | None = None,
    inputs: Mapping[str, ArrayLike] | None = None,
    *,
    settings: Mapping[str, object] | None = None,
    isolate: bool | Limits = False,
    folder: str | Path | None = None,
    **options: Any,
) -> Run | ExperimentResult:
    """Run an experiment, or a system over time.

    Parameters
    ----------
    what : str, Path or System
        An experiment that ships (``ppy run --list``), a TOML file, a result that is repeated; or a
        system of FMUs.
    time : array_like, shape (n,)
        For a system: communication points, s.
    inputs : Mapping of str to array_like, shape (n,), optional
        For a system: inputs by name.
    **options
        For a system: ``method``, ``record``, ``tolerance``, ``real_time``, ... of
        `orchestration.master.simulation.run`.

    Returns
    -------
    ExperimentResult or Run
        Signals over time with units and the settings that repeat the experiment, a dataset of
        xarray; or the run of a system.

    Raises
    ------
    UserError
        If there is no such experiment, it does not fit its subject, or an FMU fails; after the
        first point the error has the computed part as ``result`` (``run`` for a system).

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> result = ppy.run("fig_3_4", settings={"duration": "2 s"})
    >>> result["voltage"].attrs["units"]
    'V'
    """
    if isinstance(what, System):
        _refuse("a system", settings=settings, folder=folder)
        if time is None:
            raise UserError(
                f"{what.name}: time is needed to run a system, such as numpy.arange(0, 10, 0.01)"
            )
        driven = {name: np.asarray(values, dtype=float) for name, values in (inputs or {}).items()}
        return run_system(
            what, np.asarray(time, dtype=float), driven, isolation=isolation(isolate), **options
        )
    _refuse("an experiment", time=time, inputs=inputs, **options)
    result = make(
        read(str(what), [f"{name}={value}" for name, value in (settings or {}).items()]),
        str(what),
        isolation=lambda foreign: isolation(isolate),
        folder=None if folder is None else Path(folder),
    )
    if "failure" in result.attrs:
        raise UnfinishedExperiment(result.attrs["failure"], result)
    return result


def _refuse(kind: str, **useless: object) -> None:
    """Raise UserError if an argument is given that is not for this kind of run."""
    for name, value in useless.items():
        if value is not None:
            raise UserError(f"{name}: {kind} has no use for it")
