"""One FMU along its course, step by step in Python: what the kernel does where there is a compiler."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.course import Course
from orchestration.fmu.instance import Fmu

Array = NDArray[np.float64]


def stepped(fmu: Fmu, course: Course, outputs: Sequence[str], progress: Callable[[int], None], every: int) -> Array:
    """Step a started instance along its course.

    Parameters
    ----------
    fmu : Fmu
    course : Course
    outputs : sequence of str
        What is read at every point, after its inputs are set.
    progress : callable
        Called with the number of a point that was reached, ...
    every : int
        ... at every so many of them.

    Returns
    -------
    ndarray, shape (n, outputs)

    Raises
    ------
    UserError
        If a call fails, with the time and the FMU's message.
    """
    feed, read = fmu.writer(course.inputs), fmu.reader(outputs)
    set_slopes = fmu.slope_writer(course.linear) if course.linear else None
    result = np.full((len(course.time), len(outputs)), np.nan)
    parts = [(part.begins.tolist(), part.ends.tolist(), part.rows, part.slopes) for part in course.parts]
    for k, now in enumerate(course.time.tolist()):
        if k > 0:
            for begins, ends, rows, slopes in parts:
                if rows is not None:
                    feed(rows[k])
                if set_slopes is not None and slopes is not None:
                    set_slopes(slopes[k])
                fmu.step(begins[k], ends[k] - begins[k])
        try:
            feed(course.table[k])
            read(result[k])
        except UserError as error:
            raise UserError(f"{error} (at {now:g} s)") from error
        if k % every == 0:
            progress(k)
    return result
