"""Stepping of one FMU in Python along a course computed in advance.

A course is the times and inputs of all steps. With a C compiler, the stepping kernel follows it
instead of Python.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu.instance import Fmu
from orchestration.fmu.isolation import tracked_run


class StepPart(NamedTuple):
    """One part of the step to each communication point; no step leads to the first point.

    Attributes
    ----------
    begins, ends : ndarray, shape (n,)
        Start and end times in seconds.
    rows : ndarray, shape (n, inputs), or None
        Values to which inputs are set before the part; None keeps those of the point before.
    slopes : ndarray, shape (n, linear inputs), or None
        Time derivatives of the inputs that the FMU interpolates, in its units per second.
    """

    begins: Array
    ends: Array
    rows: Array | None = None
    slopes: Array | None = None


class Course(NamedTuple):
    """Communication points, inputs at them, and the parts of the steps in between.

    Attributes
    ----------
    time : ndarray, shape (n,)
        In seconds.
    inputs : list of str
    table : ndarray, shape (n, inputs)
        Values of the inputs at the points.
    linear : list of str
        Inputs whose time derivatives are set.
    parts : list of StepPart
    """

    time: Array
    inputs: list[str]
    table: Array
    linear: list[str]
    parts: list[StepPart]


def plan_course(
    fmu: Fmu, time: Array, inputs: Mapping[str, Array], linear: Collection[str], parts: int
) -> Course:
    """Return the times and inputs of all steps of an instance.

    Parameters
    ----------
    fmu : Fmu
    time : ndarray, shape (n,)
        Communication points in s.
    inputs : Mapping of str to ndarray, shape (n,)
        In the FMU's units.
    linear : collection of str
        Inputs that are interpolated linearly between points; the others are constant.
    parts : int
        Number of equal parts into which each step is divided.

    Returns
    -------
    Course
        With time derivatives of the linear inputs if the FMU can interpolate; else with their
        values at the middle of each part.
    """
    # the instance starts at the first point: the step to it has no length
    starts_and_end = np.concatenate([time[:1], time]).astype(float, copy=False)
    starts = starts_and_end[:-1]
    points = starts_and_end[1:]
    names = list(inputs)
    table = np.empty((len(points), len(names)))
    for k, values in enumerate(inputs.values()):
        table[:, k] = values
    is_linear = np.array([name in linear for name in names], dtype=bool)
    if not is_linear.any():
        constant_parts = [StepPart(begins, ends) for begins, ends in _divide(starts, points, parts)]
        return Course(points, names, table, [], constant_parts)
    interpolates = fmu.description.coSimulation.canInterpolateInputs
    with_slopes = [name for name in names if name in linear] if interpolates else []
    linear_parts = _divide_linear(starts, points, parts, table, is_linear, interpolates)
    return Course(points, names, table, with_slopes, linear_parts)


def _divide(starts: Array, points: Array, parts: int) -> list[tuple[Array, Array]]:
    """Return start and end times of the equal parts of the steps from `starts` to `points`."""
    intervals = []
    begins = starts
    for part in range(1, parts + 1):
        ends = points if part == parts else starts + (points - starts) * part / parts
        intervals.append((begins, ends))
        begins = ends
    return intervals


def _divide_linear(
    starts: Array, points: Array, parts: int, table: Array, is_linear: Array, interpolates: bool
) -> list[StepPart]:
    """Return the equal parts of steps, with the inputs to set before each.

    Parameters
    ----------
    starts, points : ndarray, shape (n,)
        Start and end times of the steps in seconds.
    parts : int
    table : ndarray, shape (n, inputs)
        Values of the inputs at the points.
    is_linear : ndarray of bool, shape (inputs,)
    interpolates : bool
        Whether inputs are set to their value at the start of a part, with their time derivative;
        else to their value at its middle.
    """
    before = np.concatenate([table[:1], table[:-1]])
    spans = points - starts
    spans[0] = 1.0  # no step leads to the first point
    slopes = np.where(is_linear, table - before, 0.0) / spans[:, np.newaxis]
    step_parts = []
    for begins, ends in _divide(starts, points, parts):
        times = begins if interpolates else 0.5 * (begins + ends)
        rows = before + slopes * (times - starts)[:, np.newaxis]
        set_slopes = np.ascontiguousarray(slopes[:, is_linear]) if interpolates else None
        step_parts.append(StepPart(begins, ends, rows, set_slopes))
    return step_parts


class StepFailed(UserError):
    """Raised when a call of an FMU fails along its course.

    Attributes
    ----------
    point : int
        Number of completed communication points.
    """

    def __init__(self, message: str, point: int):
        super().__init__(message)
        self.point = point


def follow_course(
    fmu: Fmu,
    course: Course,
    outputs: Sequence[str],
    result: Array,
    progress: Callable[[int], None],
    every: int,
) -> None:
    """Step a started instance along its course.

    Parameters
    ----------
    fmu : Fmu
    course : Course
    outputs : sequence of str
        Variables to read at every point, after its inputs are set.
    result : ndarray, shape (n, outputs)
        Array to fill with the outputs.
    progress : callable
        Function that is called with the index of a point.
    every : int
        Number of points from one call of `progress` to the next.

    Raises
    ------
    StepFailed
        If a call fails, with the time and the FMU's message.
    """
    write = fmu.writer(course.inputs)
    read = fmu.reader(outputs)
    set_slopes = fmu.slope_writer(course.linear) if course.linear else None
    parts = [
        (part.begins.tolist(), part.ends.tolist(), part.rows, part.slopes) for part in course.parts
    ]

    def step_to(k: int) -> None:
        """Make the parts of the step to a point."""
        for begins, ends, rows, slopes in parts:
            if rows is not None:
                write(rows[k])
            if set_slopes is not None and slopes is not None:
                set_slopes(slopes[k])
            fmu.step(begins[k], ends[k] - begins[k])

    with tracked_run() as run:
        for k, now in enumerate(course.time.tolist()):
            run.point = k
            try:
                if k > 0:
                    step_to(k)
                _exchange(write, read, course.table[k], result[k], now)
            except UserError as error:
                raise StepFailed(str(error), k) from error
            if k % every == 0:
                progress(k)
        run.point = len(course.time)


def _exchange(
    write: Callable[[Array], None],
    read: Callable[[Array], None],
    inputs: Array,
    outputs: Array,
    now: float,
) -> None:
    """Set the inputs and read the outputs at a communication point."""
    try:
        write(inputs)
        read(outputs)
    except UserError as error:
        raise UserError(f"{error} (at {now:g} s)") from error
