"""Stepping of one FMU along its course in the kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic
from typing import NoReturn

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu.instance import Fmu
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
from orchestration.fmu.stepping import Course, StepFailed, StepPart


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
        for part in course.parts:
            _add_part(program, fmu, course, part)
        before_first_point = len(program.operations)  # no step leads to the first point
        failures = _TransferFailures(fmu, course.time, course.inputs, course.table, at_point=True)
        _add_setting(program, fmu, course.inputs, course.table, failures.setting)
        _add_transfers(program, fmu, "Get", outputs, result, failures.reading(outputs))
        program.hold(course)  # the program points to the times of its parts
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


def _add_part(program: Program, fmu: Fmu, course: Course, part: StepPart) -> None:
    """Add operations that set the inputs for a part of a step and make it."""
    if part.rows is not None:
        failures = _TransferFailures(fmu, part.begins, course.inputs, part.rows, at_point=False)
        _add_setting(program, fmu, course.inputs, part.rows, failures.setting)
    if part.slopes is not None:

        def slopes_failed(returned: KernelReturn) -> NoReturn:
            raise fmu.failed(f"setting the slopes of {', '.join(course.linear)}", returned.status)

        references = [fmu.variable(name).valueReference for name in course.linear]
        call = fmu.bound("fmi2SetRealInputDerivatives")
        slopes = Values.in_rows(part.slopes)
        program.add_slopes(call, references, slopes, slopes_failed)

    def step_failed(returned: KernelReturn) -> NoReturn:
        raise fmu.step_failed(part.begins[returned.point], returned.status)

    begins = Values.in_rows(part.begins)
    ends = Values.in_rows(part.ends)
    program.add_step(fmu.bound("fmi2DoStep"), begins, ends, step_failed)


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
    positions_of: dict[str, list[int]] = {}  # by type, in the order of the calls
    for k, name in enumerate(names):
        positions_of.setdefault(type_of(fmu.variable(name)), []).append(k)
    values = Values.in_rows(table)
    for kind, positions in positions_of.items():
        call = fmu.bound(f"fmi2{verb}{kind.capitalize()}")
        references = [fmu.variable(names[k]).valueReference for k in positions]
        places = [columns.index(k) for k in positions]
        program.add_transfer(call, references, values, places, handler)


class _TransferFailures:
    """Handlers that raise the error of setting inputs or reading outputs.

    Parameters
    ----------
    fmu : Fmu
    time : ndarray, shape (n,)
        Times of the rows of the table in s.
    inputs : sequence of str
    table : ndarray, shape (n, inputs)
        Values of the inputs.
    at_point : bool
        Whether the message contains the time.
    """

    def __init__(self, fmu: Fmu, time: Array, inputs: Sequence[str], table: Array, at_point: bool):
        self._fmu = fmu
        self._time = time
        self._inputs = inputs
        self._table = table
        self._at_point = at_point

    def setting(self, returned: KernelReturn) -> None:
        """Raise the error of setting inputs.

        Values that are not of their type are set again in Python, whose error names the variable.
        """
        try:
            if returned.reason == library.NOT_OF_TYPE:
                self._fmu.writer(self._inputs)(self._table[returned.point])
            raise self._fmu.failed(f"setting {', '.join(self._inputs)}", returned.status)
        except UserError as error:
            self._raise(error, returned)

    def reading(self, outputs: Sequence[str]) -> Handler:
        """Return a handler that raises the error of reading these outputs."""

        def raise_error(returned: KernelReturn) -> None:
            error = self._fmu.failed(f"reading {', '.join(outputs)}", returned.status)
            self._raise(error, returned)

        return raise_error

    def _raise(self, error: UserError, returned: KernelReturn) -> NoReturn:
        if not self._at_point:
            raise error
        raise UserError(f"{error} (at {self._time[returned.point]:g} s)") from error
