"""One FMU along its course, stepped by the kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.course import Course, Part
from orchestration.fmu.instance import Fmu
from orchestration.fmu.isolation.box import keep
from orchestration.fmu.kernel import library
from orchestration.fmu.kernel.program import (
    WHOLE_NUMBERS,
    Execution,
    Handler,
    Program,
    Return,
    in_array,
)
from orchestration.fmu.kernel.pulse import Pulse
from orchestration.fmu.signal import type_of
from orchestration.fmu.stepping import Failed

Array = NDArray[np.float64]


class Prepared:
    """What the kernel does with an instance along a course, to be carried out from the start any number of times.

    Parameters
    ----------
    fmu : Fmu
        Its instance must stay the same.
    course : Course
    outputs : sequence of str
    result : ndarray, shape (n, outputs)
        Where they go, the reals first until a run is over.
    pulse : Pulse, optional
        That several runs share.
    """

    def __init__(
        self,
        fmu: Fmu,
        course: Course,
        outputs: Sequence[str],
        result: Array,
        pulse: Pulse | None = None,
    ):
        self._fmu, self._time, self._result = fmu, course.time, result
        self._program = Program(owners=[fmu.label])
        for part in course.parts:
            _add_part(self._program, fmu, course, part)
        before_first = len(self._program.operations)  # nothing leads to the first point
        at_point = _Failures(fmu, course.time, course.inputs, course.table, at_point=True)
        _add_setting(self._program, fmu, course.inputs, course.table, at_point.setting)
        _add_moves(self._program, fmu, "Get", outputs, self._result, at_point.reading(outputs))
        columns = _reals_first(fmu, outputs)
        self._order = None if columns == sorted(columns) else np.argsort(columns)
        self._program.hold(course)  # whose times it points to
        self._execution = Execution(self._program, skipped=before_first, pulse=pulse)

    def run(
        self,
        progress: Callable[[int], None] = lambda done: None,
        every: int = 0,
        longest: float = np.inf,
    ) -> None:
        """Carry it out with the instance as it was started.

        Parameters
        ----------
        progress : callable
            Called with the number of a point that was reached, ...
        every : int
            ... at every so many of them; 0 for never.
        longest : float
            Seconds that it may take.

        Raises
        ------
        Failed
            If a call fails, or it takes longer.
        """
        points, execution, end = len(self._result), self._execution, monotonic() + longest
        execution.again()
        with execution:
            try:
                for k in range(0, points if every else 0, max(1, every)):
                    self._carry_on(k + 1, end)
                    progress(k)
                self._carry_on(points, end)
            except UserError as error:
                raise Failed(str(error), execution.point) from error
            finally:
                self._fmu.warnings += int(execution.warnings[0])
                if self._order is not None:
                    self._result[:] = self._result[:, self._order]

    def _carry_on(self, until: int, end: float) -> None:
        while not self._execution.carry_on(until):  # an interrupt is heard here, in Python
            if monotonic() > end:
                raise UserError(
                    f"{self._fmu.path.name}: takes too long from {self._time[self._execution.point - 1]:g} s on: with "
                    "these parameters a time constant is far too short for the steps"
                )


def stepped(
    fmu: Fmu,
    course: Course,
    outputs: Sequence[str],
    result: Array,
    progress: Callable[[int], None],
    every: int,
) -> None:
    """Step a started instance along its course; as :func:`orchestration.fmu.stepping.stepped`, with the same bits."""
    keep([outputs[k] for k in _reals_first(fmu, outputs)])
    Prepared(fmu, course, outputs, result).run(progress, every)


def _reals_first(fmu: Fmu, names: Sequence[str]) -> list[int]:
    """Variables in the order of the kernel's tables: those that move in one call without a copy stand together."""
    return sorted(range(len(names)), key=lambda k: type_of(fmu.variable(names[k])) != "real")


def _add_part(program: Program, fmu: Fmu, course: Course, part: Part) -> None:
    begins, ends = in_array(part.begins), in_array(part.ends)
    if part.rows is not None:
        failures = _Failures(fmu, part.begins, course.inputs, part.rows, at_point=False)
        _add_setting(program, fmu, course.inputs, part.rows, failures.setting)
    if part.slopes is not None:

        def failed(why: Return) -> NoReturn:
            raise fmu.failed(f"setting the slopes of {', '.join(course.linear)}", why.status)

        references = [fmu.variable(name).valueReference for name in course.linear]
        call = fmu.bound("fmi2SetRealInputDerivatives")
        program.real(library.SET_SLOPES, call, references, in_array(part.slopes), failed)

    def step_failed(why: Return) -> NoReturn:
        raise fmu.failed(f"step from {part.begins[why.point]:g} s", why.status)

    program.step(fmu.bound("fmi2DoStep"), begins, ends, step_failed)


def _add_setting(
    program: Program, fmu: Fmu, names: Sequence[str], table: Array, handler: Handler
) -> None:
    columns = _reals_first(fmu, names)
    ordered = table if columns == sorted(columns) else np.ascontiguousarray(table[:, columns])
    program.hold(ordered)
    _add_moves(program, fmu, "Set", names, ordered, handler)


def _add_moves(
    program: Program, fmu: Fmu, verb: str, names: Sequence[str], table: Array, handler: Handler
) -> None:
    """Add one call for each type among variables, whose values are in the columns of a table, the reals first."""
    columns = _reals_first(fmu, names)
    kinds: dict[str, list[int]] = {}  # in the order in which they are called
    for k, name in enumerate(names):
        kinds.setdefault(type_of(fmu.variable(name)), []).append(k)
    for kind, own in kinds.items():
        call = fmu.bound(f"fmi2{verb}{kind.capitalize()}")
        references = [fmu.variable(names[k]).valueReference for k in own]
        if kind == "real":
            what = library.SET_REAL if verb == "Set" else library.GET_REAL
            program.real(what, call, references, in_array(table), handler)
        else:
            what = WHOLE_NUMBERS[kind] if verb == "Set" else library.GET_WHOLE
            program.whole(
                what, call, references, in_array(table), [columns.index(k) for k in own], handler
            )


class _Failures:
    """Puts into words what fails where values are moved."""

    def __init__(self, fmu: Fmu, time: Array, inputs: Sequence[str], table: Array, at_point: bool):
        self._fmu, self._time, self._inputs, self._table, self._at_point = (
            fmu,
            time,
            inputs,
            table,
            at_point,
        )

    def setting(self, why: Return) -> None:
        """Of inputs; a value that its type cannot hold is named by who sets them in Python."""
        try:
            if why.reason == library.NOT_OF_TYPE:
                self._fmu.writer(self._inputs)(self._table[why.point])
            raise self._fmu.failed(f"setting {', '.join(self._inputs)}", why.status)
        except UserError as error:
            self._raise(error, why)

    def reading(self, outputs: Sequence[str]) -> Handler:
        """Of these outputs."""

        def failed(why: Return) -> None:
            self._raise(self._fmu.failed(f"reading {', '.join(outputs)}", why.status), why)

        return failed

    def _raise(self, error: UserError, why: Return) -> NoReturn:
        if not self._at_point:
            raise error
        raise UserError(f"{error} (at {self._time[why.point]:g} s)") from error
