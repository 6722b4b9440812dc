"""Task of a sweep, which is common to its cases, and the runner of cases."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu import Source, Value
from orchestration.fmu.isolation import Limits
from orchestration.fmu.simulation import EndedSimulation
from orchestration.sweeps.compiled import CompiledCases, Equations
from orchestration.sweeps.reductions import TRACE, reduce_traces


@dataclass(frozen=True)
class Task:
    """The part of a sweep that is common to all cases, as numbers and paths, which can be sent.

    Attributes
    ----------
    source : Source
        Source of the runs: an FMU or a system.
    names : tuple of str
        Names of the values of a case: parameters or constant inputs.
    settings : dict of str to float or str
        Other parameters, in the FMU's units.
    time : ndarray, shape (n,)
        Communication points, s.
    inputs : dict of str to ndarray, shape (n,)
        In the FMU's units.
    outputs : tuple of str
        Names of m outputs to keep.
    keep : tuple of str
        Names of r reductions, and ``trace`` for the whole trace.
    equations : Equations, optional
        Compiled code that runs the cases; without it the FMU does.
    limits : Limits, optional
        Limits of a separate process for the FMU; without them it may run in this process.
    """

    source: Source
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
        """Engine that runs the cases, ``compiled`` or ``fmu``."""
        return "compiled" if self.equations else "fmu"

    @property
    def by_fmu(self) -> Task:
        """The same task, run by the FMU."""
        return replace(self, equations=None)


@dataclass(frozen=True)
class Outcomes:
    """The outcomes of k cases.

    Attributes
    ----------
    numbers : ndarray, shape (k, r, m)
        Numbers by case, reduction and output, in the FMU's units; NaN where a case failed.
    traces : ndarray, shape (k, n, m) or (k, 0, m)
        Whole traces, if they are kept.
    failures : dict of int to str
        Reasons of failed cases by index.
    undecided : tuple of int
        Indices of cases that only the FMU can run.
    seconds : float
        Duration of all cases.
    remarks : tuple of str
        What users have to know of cases that did not fail.
    """

    numbers: Array
    traces: Array
    failures: dict[int, str]
    undecided: tuple[int, ...] = ()
    seconds: float = 0.0
    remarks: tuple[str, ...] = ()

    def select(self, indices: Sequence[int]) -> Outcomes:
        """Return the outcomes at indices, which may be repeated."""
        failures = {k: self.failures[i] for k, i in enumerate(indices) if i in self.failures}
        numbers = self.numbers[[*indices]]
        traces = self.traces[[*indices]]
        return Outcomes(numbers, traces, failures, (), self.seconds, self.remarks)


def failed_case(task: Task, reason: str) -> Outcomes:
    """Return the outcomes of one case that failed."""
    return _reduce(task, np.full((1, len(task.time), len(task.outputs)), np.nan), {0: reason})


def _reduce(
    task: Task, traces: Array, failures: dict[int, str], undecided: Sequence[int] = ()
) -> Outcomes:
    """Return outcomes with the numbers and traces, shape (k, n, m), that a task keeps."""
    kept = traces if TRACE in task.keep else traces[:, :0]
    return Outcomes(reduce_traces(traces, task.keep), kept, failures, tuple(undecided))


class CaseRunner:
    """Runner of a task's cases, by its FMU or by compiled code; a context manager.

    Parameters
    ----------
    task : Task

    Raises
    ------
    UserError
        If the FMU or the library of compiled code cannot be opened.
    """

    def __init__(self, task: Task):
        self.task = task
        self._compiled = CompiledCases(task.equations) if task.equations else None
        self._fmu = None if task.equations else task.source.open()

    def __enter__(self) -> CaseRunner:
        if self._fmu:
            self._fmu.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        if self._fmu:
            self._fmu.__exit__(*error)

    def run(self, cases: Array) -> Outcomes:
        """Run cases from their start values; errors of the FMU become failures.

        Parameters
        ----------
        cases : ndarray, shape (k, p)
            Values of the task's names, in the FMU's units.

        Returns
        -------
        Outcomes
        """
        begin = time.perf_counter()
        compiled = self._compiled
        outcomes = self._by_equations(compiled, cases) if compiled else self._by_fmu(cases)
        return replace(outcomes, seconds=time.perf_counter() - begin)

    def _by_equations(self, compiled: CompiledCases, cases: Array) -> Outcomes:
        """Run all cases together by compiled code, which may leave some undecided."""
        task = self.task
        over = dict(zip(task.names, cases.T, strict=True))
        traces, decided = compiled.run(task.time, task.inputs, task.settings, over, task.outputs)
        return _reduce(task, traces, {}, np.flatnonzero(~decided).tolist())

    def _by_fmu(self, cases: Array) -> Outcomes:
        """Run cases one after another by the FMU, with values as parameters or constant inputs."""
        task = self.task
        fmu = self._fmu
        assert fmu is not None
        failures = {}
        ended: dict[int, EndedSimulation] = {}
        traces = np.empty((len(cases), len(task.time), len(task.outputs)))
        parameters = {*task.names} - {*fmu.inputs}
        for k, values in enumerate(cases.tolist()):
            settings = dict(task.settings)
            inputs = dict(task.inputs)
            for name, value in zip(task.names, values, strict=True):
                if name in parameters:
                    settings[name] = value
                else:
                    inputs[name] = np.full(len(task.time), value)
            try:
                traces[k] = fmu.run(task.time, inputs, settings, task.outputs)
            except UserError as error:
                traces[k] = np.nan
                # an end before the first step leaves nothing but the start
                if isinstance(error, EndedSimulation) and error.time.size > 1:
                    ended[k] = error
                else:
                    failures[k] = str(error)
        outcomes = _reduce(task, traces, failures)
        for k, end in ended.items():
            _keep_until_end(task, outcomes, traces, k, end)
        early = f"{task.source.name}: asks to end some cases early; their numbers are those so far"
        remarks = fmu.remarks | ({early} if ended else set())
        return replace(outcomes, remarks=tuple(sorted(remarks)))


def _keep_until_end(
    task: Task, outcomes: Outcomes, traces: Array, k: int, end: EndedSimulation
) -> None:
    """Set the numbers and the trace of a case to those until its FMU asked to end."""
    rows = np.column_stack([end.outputs[name] for name in task.outputs])
    outcomes.numbers[k] = reduce_traces(rows[np.newaxis], task.keep)[0]
    count = np.searchsorted(task.time, end.time[-1], side="right")
    traces[k, :count] = rows[:count]
