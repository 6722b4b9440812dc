"""Experiments and systems from Python: ``ppy.run``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit.errors import UserError
from orchestration.experiment.reading import read
from orchestration.experiment.run import Unfinished
from orchestration.experiment.run import run as make
from orchestration.fmu.isolation.limits import Limits, isolation
from orchestration.master import Run
from orchestration.master import run as run_system
from orchestration.system import System

if TYPE_CHECKING:
    import xarray


@overload
def run(
    what: System, time: ArrayLike, inputs: Mapping[str, ArrayLike] | None = None, **options: Any
) -> Run: ...


@overload
def run(
    what: str | Path,
    *,
    settings: Mapping[str, object] | None = None,
    isolate: bool | Limits = False,
) -> xarray.Dataset: ...


def run(
    what: System | str | Path,
    time: ArrayLike | None = None,
    inputs: Mapping[str, ArrayLike] | None = None,
    *,
    settings: Mapping[str, object] | None = None,
    isolate: bool | Limits = False,
    **options: Any,
) -> Run | xarray.Dataset:
    """Run an experiment, or a system over time.

    Parameters
    ----------
    what : str, Path or System
        An experiment that ships (``ppy run --list``), a TOML file, a result to make again; or a system of FMUs.
    time : array_like, shape (n,)
        Of a system: communication points, s.
    inputs : Mapping of str to array_like, shape (n,), optional
        Of a system: inputs by name.
    settings : Mapping of str to object, optional
        Of an experiment: what replaces values of its file, such as ``{"duration": "20 s", "R1": "610 mohm"}``.
    isolate : bool or Limits
        Run it in a process of its own, which an FMU may end or hang in without harm; with other limits than usual.
    **options
        Of a system: ``method``, ``record``, ``tolerance``, ``real_time``, ... as `orchestration.master.run` has.

    Returns
    -------
    xarray.Dataset or Run
        Signals over time with units and all that it takes to run the experiment again; or the run of a system.

    Raises
    ------
    UserError
        If there is no such experiment, something does not fit what it is made on, or an FMU fails; one that fails on
        its way leaves what was computed as ``result`` of the error (``run`` for a system).

    Examples
    --------
    >>> import orchestration as ppy
    >>> result = ppy.run("fig_3_4", settings={"duration": "2 s"})
    >>> result["voltage"].attrs["units"]
    'V'
    """
    if isinstance(what, System):
        if time is None:
            raise UserError(
                f"{what.name}: time is needed to run a system, such as numpy.arange(0, 10, 0.01)"
            )
        driven = {name: np.asarray(values, dtype=float) for name, values in (inputs or {}).items()}
        return run_system(
            what, np.asarray(time, dtype=float), driven, isolation=isolation(isolate), **options
        )
    result = make(
        read(str(what), [f"{name}={value}" for name, value in (settings or {}).items()]),
        str(what),
        isolation=lambda foreign: isolation(isolate),
    )
    if "failure" in result.attrs:
        raise Unfinished(result.attrs["failure"], result)
    return result
