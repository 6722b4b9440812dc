"""Stepping of one FMU in Python along a course computed in advance.

A course is the times and inputs of all steps. With a C compiler, the stepping kernel follows it
instead of Python.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Indices
from orchestration.fmu.instance import Fmu
from orchestration.fmu.isolation import tracked_run
from orchestration.fmu.signal import type_of

_ROUNDING = 1e-9  # of a step, by which two times may differ and be the same


class Course(NamedTuple):
    """Communication points, the inputs that are set at them, and when outputs are wanted.

    Attributes
    ----------
    time : ndarray, shape (m,)
        Communication points in seconds.
    inputs : list of str
    table : ndarray, shape (m, inputs)
        Values of the inputs, which are held until the next point.
    wanted : ndarray, shape (n,)
        Times of the outputs in seconds; those of the points unless the FMU has a step of its own.
    """

    time: Array
    inputs: list[str]
    table: Array
    wanted: Array

    def at_wanted(self, result: Array, continuous: Sequence[bool]) -> Array:
        """Return outputs at the times at which they are wanted.

        Parameters
        ----------
        result : ndarray, shape (m, outputs)
            At the communication points.
        continuous : sequence of bool
            Outputs that are interpolated linearly between the points; others are held.

        Returns
        -------
        ndarray, shape (n, outputs)
        """
        if self.wanted is self.time:
            return result
        taken = result[last_before(self.time, self.wanted)]
        for k in np.flatnonzero(continuous):
            taken[:, k] = np.interp(self.wanted, self.time, result[:, k])
        return taken


def own_step(description: Any) -> float | None:
    """Return the step in s of an FMU that cannot vary it and declares one; else None.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
    """
    interface = description.coSimulation
    if interface.canHandleVariableCommunicationStepSize:
        return None
    declared = getattr(description.defaultExperiment, "stepSize", None)
    return float(interface.fixedInternalStepSize or declared or 0.0) or None


def communication_points(description: Any, time: Array) -> Array:
    """Return the points between which an FMU steps in a run with outputs at given times.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
    time : ndarray, shape (n,)
        Times of inputs and outputs in seconds.

    Returns
    -------
    ndarray, shape (m,)
        `time` itself, unless the FMU has only steps of one size and `time` has others: then
        equidistant points that cover it, at the step that the FMU declares, or else the median one.
    """
    if description.coSimulation.canHandleVariableCommunicationStepSize or time.size < 2:
        return time
    spans = np.diff(time)
    step = own_step(description) or float(np.median(spans))
    if np.abs(spans - step).max() <= _ROUNDING * step:
        return time
    count = int(np.ceil((time[-1] - time[0]) / step - _ROUNDING))
    points: Array = time[0] + step * np.arange(count + 1)
    return points


def plan_course(fmu: Fmu, time: Array, inputs: Mapping[str, Array]) -> Course:
    """Return the times and inputs of all steps of an instance.

    Parameters
    ----------
    fmu : Fmu
    time : ndarray, shape (n,)
        Times in s at which inputs are given and outputs are wanted.
    inputs : Mapping of str to ndarray, shape (n,)
        In the FMU's units.
    """
    wanted = np.ascontiguousarray(time, dtype=float)
    points = communication_points(fmu.description, wanted)
    table = np.empty((len(points), len(inputs)))
    for k, (name, values) in enumerate(inputs.items()):
        held = values if points is wanted else values[last_before(wanted, points)]
        table[:, k] = fmu.in_numbers(name, held)
    return Course(points, list(inputs), table, wanted)


def last_before(time: Array, instants: Array) -> Indices:
    """Return the index of the last of `time` that is not after each of `instants`."""
    rounding = _ROUNDING * float(np.median(np.diff(time)))
    index: Indices = np.searchsorted(time, instants + rounding, side="right") - 1
    return index


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


def is_continuous(fmu: Fmu, names: Sequence[str]) -> list[bool]:
    """Return whether each of some variables is a real number."""
    return [type_of(fmu.variable(name)) == "real" for name in names]


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
    result : ndarray, shape (m, outputs)
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
    time = course.time.tolist()
    with tracked_run() as run:
        for k, now in enumerate(time):
            run.point = k
            try:
                if k > 0:
                    fmu.step(time[k - 1], now - time[k - 1])
                _exchange(write, read, course.table[k], result[k], now)
            except UserError as error:
                raise StepFailed(str(error), k) from error
            if k % every == 0:
                progress(k)
        run.point = len(time)


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
