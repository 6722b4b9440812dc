"""Steps of the master that are as long as the coupling error permits, by step doubling."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.master.executor import Executor
from orchestration.master.instances import SavedState
from orchestration.master.interrupt import Interrupt

Array = NDArray[np.float64]
_SHORTEST = 1e-12  # of the time, or of a second


class Checkpoint:
    """Where an executor is, to go back to any number of times: states, values in the buffers, slopes."""

    def __init__(self, executor: Executor):
        self._buffers = [executor.inputs.values, executor.outputs.values]
        self._values = [values.copy() for values in self._buffers]
        self._histories = [step.history for step in executor.complete.extrapolating]
        self._slopes: list[list[float]] = []
        self._states = SavedState(executor.members, executor.clock)
        executor.saved_states.append(self._states)

    def save(self) -> None:
        """Keep everything as it is now; UserError if a member refuses."""
        self._states.save()
        for kept, values in zip(self._values, self._buffers, strict=True):
            kept[:] = values
        self._slopes = [history.slopes.copy() for history in self._histories]

    def restore(self) -> None:
        """Go back to what was saved last; UserError if a member refuses."""
        self._states.restore()
        for kept, values in zip(self._values, self._buffers, strict=True):
            values[:] = kept
        for history, slopes in zip(self._histories, self._slopes, strict=True):
            history.slopes[:] = slopes


class StepDoubling:
    """Goes from one communication point to the next in steps of its own.

    Every step is made at once and then, after going back, as two halves. The halves stay; the difference between the
    two results, of all continuous outputs, is the error, relative to ``tolerance * (nominal + |value|)``.

    Parameters
    ----------
    executor : Executor
    tolerance : float

    Attributes
    ----------
    steps, rollbacks : int
        Steps that stayed, each in two halves, and those that had to be repeated with a shorter one.
    """

    def __init__(self, executor: Executor, tolerance: float):
        self._executor, self._tolerance = executor, tolerance
        self._checkpoint = Checkpoint(executor)
        by_name = {member.name: member for member in executor.members}
        self._ports = [
            p for p in executor.outputs.at if by_name[p.member].is_continuous(p.variable)
        ]
        self._places = [executor.outputs.at[port] for port in self._ports]
        self._nominal = np.array([by_name[p.member].nominal(p.variable) for p in self._ports])
        self._order = 1 + executor.settings.extrapolation
        self._hint = math.inf
        self.steps = self.rollbacks = 0

    def advance(self, start: float, end: float, k: int, interrupt: Interrupt) -> bool:
        """Step from point `k` to the next; false if Ctrl-C was pressed before it was reached.

        Raises
        ------
        UserError
            If a member fails, or the error stays too large however short the step.
        """
        time = start
        while time < end:
            if interrupt.pressed:
                return False
            size = min(self._hint, end - time)
            whole = size > 0.999 * (end - time)
            target = end if whole else time + size
            self._checkpoint.save()
            self._step(time, target, k)
            once = self._executor.outputs.values[self._places]
            self._checkpoint.restore()
            middle = time + 0.5 * (target - time)
            self._step(time, middle, k)
            self._step(middle, target, k)
            twice = self._executor.outputs.values[self._places]
            errors = self._errors(once, twice)
            error = float(np.max(errors, initial=0.0))
            factor = (
                5.0
                if error == 0.0
                else min(5.0, max(0.2, 0.9 * error ** (-1.0 / (self._order + 1))))
            )
            if error <= 1.0:
                self.steps += 1
                if not whole or size == self._hint:
                    self._hint = size * factor
                time = target
                continue
            self._checkpoint.restore()
            self.rollbacks += 1
            self._hint = (target - time) * factor
            if self._hint < _SHORTEST * max(1.0, abs(time)):
                port = self._ports[int(np.argmax(errors))]
                raise UserError(
                    f"{port} at {time:.10g} s: the coupling error stays above the tolerance {self._tolerance:g}, "
                    "however short the step"
                )
        return True

    def _errors(self, once: Array, twice: Array) -> Array:
        """Difference of two results over what is tolerated; where both are no number there is none."""
        with np.errstate(invalid="ignore"):
            errors = np.abs(twice - once) / (self._tolerance * (self._nominal + np.abs(twice)))
        errors[np.isnan(errors)] = math.inf
        errors[(once == twice) | (np.isnan(once) & np.isnan(twice))] = 0.0
        return errors

    def _step(self, start: float, end: float, k: int) -> None:
        executor = self._executor
        executor.step(executor.complete, start, end)
        executor.exchange(executor.complete.stages, k)
        executor.update_slopes(executor.complete)
