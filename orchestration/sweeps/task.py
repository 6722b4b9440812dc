"""Cases of a sweep, one after the other: what each has in common, and what it leaves."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.isolation.limits import Limits
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
    limits : Limits, optional
        Of a process beside this one in which the FMU runs; else it may run in this one.
    """

    path: Path
    names: tuple[str, ...]
    settings: dict[str, Value]
    time: Array
    inputs: dict[str, Array]
    outputs: tuple[str, ...]
    keep: tuple[str, ...]
    equations: Equations | None = None
    limits: Limits | None = None

    @property
    def engine(self) -> str:
        """What runs the cases, ``compiled`` or ``fmu``."""
        return "compiled" if self.equations else "fmu"

    @property
    def by_fmu(self) -> Task:
        """The same, run by the FMU."""
        return replace(self, equations=None)


@dataclass(frozen=True)
class Outcomes:
    """What cases left, k of them.

    Attributes
    ----------
    numbers : ndarray, shape (k, r, m)
        By reductions and outputs, in the FMU's units; NaN where a case failed.
    traces : ndarray, shape (k, n, m) or (k, 0, m)
        The whole courses, where they are kept.
    failures : dict of int to str
        Why there is nothing of a case, by its place.
    left : tuple of int
        Places of cases that only the FMU can run: nothing is known of them.
    seconds : float
        That all took.
    """

    numbers: Array
    traces: Array
    failures: dict[int, str]
    left: tuple[int, ...] = ()
    seconds: float = 0.0

    def at(self, places: Sequence[int]) -> Outcomes:
        """Those at some places, as often as they are named."""
        failures = {
            k: self.failures[place] for k, place in enumerate(places) if place in self.failures
        }
        return Outcomes(self.numbers[[*places]], self.traces[[*places]], failures, (), self.seconds)


def failed(task: Task, reason: str) -> Outcomes:
    """An outcome of nothing, of one case."""
    return _kept(task, np.full((1, len(task.time), len(task.outputs)), np.nan), {0: reason})


def _kept(
    task: Task, courses: Array, failures: dict[int, str], left: Sequence[int] = ()
) -> Outcomes:
    return Outcomes(
        reduced(courses, task.keep),
        courses if TRACE in task.keep else courses[:, :0],
        failures,
        tuple(left),
    )


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
        self._compiled = CompiledCases(task.equations) if task.equations else None
        self._fmu = None if task.equations else RepeatedFmu(task.path)

    def __enter__(self) -> Repeated:
        if self._fmu:
            self._fmu.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._fmu:
            self._fmu.__exit__(kind, error, trace)

    def run(self, cases: Array) -> Outcomes:
        """Run cases from the start; what the FMU refuses is an outcome.

        Parameters
        ----------
        cases : ndarray, shape (k, p)
            Values of the task's names, in the FMU's units.
        """
        begin = time.perf_counter()
        found = self._by_equations(self._compiled, cases) if self._compiled else self._by_fmu(cases)
        return replace(found, seconds=time.perf_counter() - begin)

    def _by_equations(self, compiled: CompiledCases, cases: Array) -> Outcomes:
        task = self.task
        over = dict(zip(task.names, cases.T, strict=True))
        courses, judged = compiled.run(task.time, task.inputs, task.settings, over, task.outputs)
        return _kept(task, courses, {}, np.flatnonzero(~judged).tolist())

    def _by_fmu(self, cases: Array) -> Outcomes:
        task, fmu, failures = self.task, self._fmu, {}
        assert fmu is not None
        courses = np.empty((len(cases), len(task.time), len(task.outputs)))
        parameters = {*task.names} - {*fmu.inputs}
        for k, values in enumerate(cases.tolist()):
            given = dict(zip(task.names, values, strict=True))
            settings = {**task.settings, **{n: v for n, v in given.items() if n in parameters}}
            held = {n: np.full(len(task.time), v) for n, v in given.items() if n not in parameters}
            try:
                courses[k] = fmu.run(task.time, {**task.inputs, **held}, settings, task.outputs)
            except UserError as error:
                courses[k], failures[k] = np.nan, str(error)
        return _kept(task, courses, failures)
