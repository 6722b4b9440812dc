"""What one FMU is fed on its way from communication point to communication point, computed before it is stepped."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.instance import Fmu

Array = NDArray[np.float64]


class Part(NamedTuple):
    """A step, or a part of one, to each communication point; what leads to the first is no step and never looked at.

    Attributes
    ----------
    begins, ends : ndarray, shape (n,)
        In seconds.
    rows : ndarray, shape (n, inputs), or None
        Values that inputs are set to before; None: they keep those of the point before.
    slopes : ndarray, shape (n, linear inputs), or None
        Of those that an FMU interpolates, in its units per second.
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
    linear : list of str
        Inputs of which slopes are set.
    parts : list of Part
    """

    time: Array
    inputs: list[str]
    table: Array
    linear: list[str]
    parts: list[Part]


def course(
    fmu: Fmu, time: Array, inputs: Mapping[str, Array], linear: Collection[str], parts: int
) -> Course:
    """Compute what an instance is fed; see :func:`orchestration.fmu.simulate.simulate_instance`."""
    both = np.concatenate([time[:1], time]).astype(float, copy=False)
    starts, points = both[:-1], both[1:]
    table = np.empty((len(points), len(inputs)))
    for k, values in enumerate(inputs.values()):
        table[:, k] = values
    if parts == 1 and not linear:
        return Course(points, list(inputs), table, [], [Part(starts, points)])
    moving = np.array([name in linear for name in inputs], dtype=bool)
    interpolates = bool(moving.any()) and bool(fmu.description.coSimulation.canInterpolateInputs)
    before, spans = np.concatenate([table[:1], table[:-1]]), points - starts
    spans[0] = 1.0  # of no step
    slopes = np.where(moving, table - before, 0.0) / spans[:, np.newaxis]
    made, begins = [], starts
    for part in range(1, parts + 1):
        ends = points if part == parts else starts + (points - starts) * part / parts
        after = begins - starts if interpolates else 0.5 * (begins + ends) - starts
        rows = before + slopes * after[:, np.newaxis] if moving.any() else None
        made.append(
            Part(
                begins,
                ends,
                rows,
                np.ascontiguousarray(slopes[:, moving]) if interpolates else None,
            )
        )
        begins = ends
    named = [name for name, moves in zip(inputs, moving, strict=True) if moves]
    return Course(points, list(inputs), table, named if interpolates else [], made)
