"""A schedule carried out by the kernel, and what it leaves behind: rows of outputs, warnings, seconds, steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.isolation.box import rows
from orchestration.fmu.kernel.program import Execution
from orchestration.master.executor import Executor
from orchestration.master.kernel.schedule import translated

Array = NDArray[np.float64]


class KernelRun:
    """The steps and exchanges of all members, at every communication point after the first; a context manager.

    Parameters
    ----------
    executor : Executor
        In which all members take part in every step, and inputs are held.
    points : sequence of float
        Communication points in s.
    most : int
        Largest number of points between two looks at `taken`.
    """

    def __init__(self, executor: Executor, points: Sequence[float], most: int):
        self._executor = executor
        self._rows = rows((most, len(executor.outputs.at)))
        self._execution = Execution(
            translated(executor, points, self._rows), len(executor.members), first=1
        )

    def __enter__(self) -> KernelRun:
        self._execution.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._execution.__exit__(*error)
        execution, executor = self._execution, self._executor
        executor.complete.count += (
            execution.point - 1 + execution.inside
        )  # a step that failed was begun
        for k, member in enumerate(executor.members):
            member.fmu.warnings += int(execution.warnings[k])
            executor.seconds[k] += float(execution.seconds[k])

    @property
    def done(self) -> int:
        """How many communication points are complete."""
        return self._execution.point

    def carry_on(self, until: int) -> bool:
        """Go on up to a communication point, which is left out; false if Python should look around before.

        Raises
        ------
        UserError
            If a member fails, gives something that is no number to another, or a loop cannot be solved.
        """
        return self._execution.carry_on(until)

    def taken(self) -> Array:
        """Rows of outputs, one for each point completed since the last look; valid until the kernel goes on."""
        kept = self._rows[: self._execution.kept]
        self._execution.rewind()
        return kept
