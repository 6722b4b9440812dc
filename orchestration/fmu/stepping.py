"""One FMU along its course, step by step in Python: what the kernel does where there is a compiler."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.course import Course
from orchestration.fmu.instance import Fmu
from orchestration.fmu.isolation.box import running

Array = NDArray[np.float64]


class Failed(UserError):
    """A call on the way has failed; `point` is how many communication points were complete."""

    def __init__(self, message: str, point: int):
        super().__init__(message)
        self.point = point


def stepped(
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
        What is read at every point, after its inputs are set.
    result : ndarray, shape (n, outputs)
        Where it goes.
    progress : callable
        Called with the number of a point that was reached, ...
    every : int
        ... at every so many of them.

    Raises
    ------
    Failed
        If a call fails, with the time and the FMU's message.
    """
    feed, read = fmu.writer(course.inputs), fmu.reader(outputs)
    set_slopes = fmu.slope_writer(course.linear) if course.linear else None
    parts = [
        (part.begins.tolist(), part.ends.tolist(), part.rows, part.slopes) for part in course.parts
    ]
    with running() as run:
        for k, now in enumerate(course.time.tolist()):
            run.point = k
            try:
                if k > 0:
                    for begins, ends, rows, slopes in parts:
                        if rows is not None:
                            feed(rows[k])
                        if set_slopes is not None and slopes is not None:
                            set_slopes(slopes[k])
                        fmu.step(begins[k], ends[k] - begins[k])
                _exchange(feed, read, course.table[k], result[k], now)
            except UserError as error:
                raise Failed(str(error), k) from error
            if k % every == 0:
                progress(k)
        run.point = len(course.time)


def _exchange(
    feed: Callable[[Array], None],
    read: Callable[[Array], None],
    given: Array,
    found: Array,
    now: float,
) -> None:
    try:
        feed(given)
        read(found)
    except UserError as error:
        raise UserError(f"{error} (at {now:g} s)") from error
