"""Stepping of one FMU along its course in the kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic
from typing import NoReturn

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu.instance import Fmu, positions_by_type
from orchestration.fmu.isolation import describe_rows
from orchestration.fmu.kernel import library
from orchestration.fmu.kernel.program import (
    Execution,
    Handler,
    KernelReturn,
    Program,
    Pulse,
    Values,
)
from orchestration.fmu.signal import type_of
from orchestration.fmu.stepping import Course, StepFailed


class PreparedRun:
    """A kernel program that steps an instance along a course, for any number of runs.

    Parameters
    ----------
    fmu : Fmu
        The instance, which must not be replaced.
    course : Course
    outputs : sequence of str
    result : ndarray, shape (n, outputs)
        Array for the outputs of each run; during a run the real outputs are in the first columns.
    pulse : Pulse, optional
        A running pulse that several runs share; default one for each run.
    """

    def __init__(
        self,
        fmu: Fmu,
        course: Course,
        outputs: Sequence[str],
        result: Array,
        pulse: Pulse | None = None,
    ):
        self._fmu = fmu
        self._time = course.time
        self._result = result
        program = Program(owners=[fmu.label])
        _add_step(program, fmu, course.time)
        before_first_point = len(program.operations)  # no step leads to the first point
        failures = _TransferFailures(fmu, course)
        _add_setting(program, fmu, course.inputs, course.table, failures.setting)
        _add_transfers(program, fmu, "Get", outputs, result, failures.reading(outputs))
        program.hold(course)  # the program points to its times
        columns = _reals_first(fmu, outputs)
        # `columns` are the outputs in the order of the result; argsort inverts the permutation
        self._order = None if columns == sorted(columns) else np.argsort(columns)
        self._execution = Execution(program, skipped=before_first_point, pulse=pulse)

    def run(
        self,
        progress: Callable[[int], None] = lambda done: None,
        every: int = 0,
        longest: float = np.inf,
    ) -> None:
        """Execute the program on the instance, which has just been initialized.

        Parameters
        ----------
        progress : callable
            Function that is called with the index of a point.
        every : int
            Number of points from one call of `progress` to the next; 0 for no calls.
        longest : float
            Largest duration of the run in seconds.

        Raises
        ------
        StepFailed
            If a call fails or the run takes longer.
        """
        points = len(self._result)
        reported = range(0, points, every) if every else ()
        execution = self._execution
        end = monotonic() + longest
        execution.restart()
        with execution:
            try:
                for k in reported:
                    self._advance(k + 1, end)
                    progress(k)
                self._advance(points, end)
            except UserError as error:
                raise StepFailed(str(error), execution.point) from error
            finally:
                self._fmu.warnings += int(execution.warnings[0])
                if self._order is not None:
                    self._result[:] = self._result[:, self._order]

    def _advance(self, until: int, end: float) -> None:
        """Execute the program up to a point; UserError after `end` on the monotonic clock, s."""
        while not self._execution.advance(until):  # the pulse lets Python handle Ctrl-C
            if monotonic() > end:
                raise UserError(
                    f"{self._fmu.path.name}: takes too long from"
                    f" {self._time[self._execution.point - 1]:g} s on: with these parameters a time"
                    " constant is far too short for the steps"
                )


def follow_course(
    fmu: Fmu,
    course: Course,
    outputs: Sequence[str],
    result: Array,
    progress: Callable[[int], None],
    every: int,
) -> None:
    """Step a started instance along its course in the kernel.

    Parameters, errors and results are those of :func:`orchestration.fmu.stepping.follow_course`, to
    the last bit.
    """
    describe_rows([outputs[k] for k in _reals_first(fmu, outputs)])
    PreparedRun(fmu, course, outputs, result).run(progress, every)


def _reals_first(fmu: Fmu, names: Sequence[str]) -> list[int]:
    """Return indices of variables with the reals first, so that one call transfers all reals."""
    return sorted(range(len(names)), key=lambda k: type_of(fmu.variable(names[k])) != "real")


def _add_step(program: Program, fmu: Fmu, time: Array) -> None:
    """Add the operation of a step to each communication point from the one before."""

    def step_failed(returned: KernelReturn) -> NoReturn:
        raise fmu.step_failed(time[returned.point - 1], returned.status)

    ends = Values.in_rows(time)
    program.add_step(fmu.bound("fmi2DoStep"), ends.shifted(-1), ends, step_failed)


def _add_setting(
    program: Program, fmu: Fmu, names: Sequence[str], table: Array, handler: Handler
) -> None:
    """Add operations that set inputs to a table's rows, with columns in the order of the names."""
    columns = _reals_first(fmu, names)
    ordered = table if columns == sorted(columns) else np.ascontiguousarray(table[:, columns])
    program.hold(ordered)
    _add_transfers(program, fmu, "Set", names, ordered, handler)


def _add_transfers(
    program: Program, fmu: Fmu, verb: str, names: Sequence[str], table: Array, handler: Handler
) -> None:
    """Add operations that set or get variables, one for each type.

    The table has the columns of reals first, so that one call transfers them without a copy; values
    of other types are copied from or to their columns.
    """
    columns = _reals_first(fmu, names)
    values = Values.in_rows(table)
    for kind, positions in positions_by_type(names, fmu.variables).items():
        call = fmu.bound(f"fmi2{verb}{kind.capitalize()}")
        references = [fmu.variable(names[k]).valueReference for k in positions]
        places = [columns.index(k) for k in positions]
        program.add_transfer(call, references, values, places, handler)


class _TransferFailures:
    """Handlers that raise the error of setting inputs or reading outputs along a course."""

    def __init__(self, fmu: Fmu, course: Course):
        self._fmu = fmu
        self._course = course

    def setting(self, returned: KernelReturn) -> None:
        """Raise the error of setting inputs.

        Values that are not of their type are set again in Python, whose error names the variable.
        """
        inputs = self._course.inputs
        try:
            if returned.reason == library.NOT_OF_TYPE:
                self._fmu.writer(inputs)(self._course.table[returned.point])
            raise self._fmu.failed(f"setting {', '.join(inputs)}", returned.status)
        except UserError as error:
            self._raise(error, returned)

    def reading(self, outputs: Sequence[str]) -> Handler:
        """Return a handler that raises the error of reading these outputs."""

        def raise_error(returned: KernelReturn) -> None:
            error = self._fmu.failed(f"reading {', '.join(outputs)}", returned.status)
            self._raise(error, returned)

        return raise_error

    def _raise(self, error: UserError, returned: KernelReturn) -> NoReturn:
        raise UserError(f"{error} (at {self._course.time[returned.point]:g} s)") from error
