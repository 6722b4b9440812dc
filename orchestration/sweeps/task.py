"""Cases of a sweep, one after the other: what each has in common, and what it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.repeated import RepeatedFmu
from orchestration.fmu.signal import Value
from orchestration.sweeps.compiled import CompiledCases, Equations
from orchestration.sweeps.reductions import TRACE, reduced

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """What every case has in common: numbers and paths only, so that a worker can be told it.

    Attributes
    ----------
    path : Path
        Of the FMU.
    names : tuple of str
        What the values of a case are of: parameters, or inputs that are held.
    settings : dict of str to float or str
        Other parameters, in the FMU's units.
    time : ndarray, shape (n,)
        Communication points, s.
    inputs : dict of str to ndarray, shape (n,)
        In the FMU's units.
    outputs : tuple of str
        That are kept, m of them.
    keep : tuple of str
        Reductions, r of them, and ``trace`` for the whole course.
    equations : Equations, optional
        Compiled code that runs the cases; else the FMU does.
    """

    path: Path
    names: tuple[str, ...]
    settings: dict[str, Value]
    time: Array
    inputs: dict[str, Array]
    outputs: tuple[str, ...]
    keep: tuple[str, ...]
    equations: Equations | None = None

    @property
    def engine(self) -> str:
        """What runs the cases, ``compiled`` or ``fmu``."""
        return "compiled" if self.equations else "fmu"


@dataclass(frozen=True)
class Outcome:
    """What a case left.

    Attributes
    ----------
    numbers : ndarray, shape (r, m)
        By reductions and outputs, in the FMU's units; NaN where the case failed.
    trace : ndarray, shape (n, m) or (0, m)
        The whole course, where it is kept.
    failure : str
        Why there is nothing; empty if there is.
    """

    numbers: Array
    trace: Array
    failure: str = ""


def failed(task: Task, reason: str) -> Outcome:
    """An outcome of nothing."""
    kept, m = [name for name in task.keep if name != TRACE], len(task.outputs)
    points = len(task.time) if TRACE in task.keep else 0
    return Outcome(np.full((len(kept), m), np.nan), np.full((points, m), np.nan), reason)


class Repeated:
    """A task's FMU, or its compiled code, ready for cases; a context manager.

    Parameters
    ----------
    task : Task

    Raises
    ------
    UserError
        If it cannot be opened.
    """

    def __init__(self, task: Task):
        self.task = task
        self._model = CompiledCases(task.equations, task.path) if task.equations else RepeatedFmu(task.path)
        self._parameters = {*task.names} - {*self._model.inputs}

    def __enter__(self) -> Repeated:
        self._model.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._model.__exit__(kind, error, trace)

    def run(self, values: Array) -> Outcome:
        """Run one case from the start; what the FMU refuses is the outcome.

        Parameters
        ----------
        values : ndarray, shape (p,)
            Of the task's names, in the FMU's units.
        """
        task, given = self.task, dict(zip(self.task.names, values.tolist(), strict=True))
        settings = {**task.settings, **{n: v for n, v in given.items() if n in self._parameters}}
        held = {n: np.full(len(task.time), v) for n, v in given.items() if n not in self._parameters}
        try:
            course = self._model.run(task.time, {**task.inputs, **held}, settings, task.outputs)
        except UserError as error:
            return failed(task, str(error))
        return Outcome(reduced(course, task.keep), course if TRACE in task.keep else course[:0])
