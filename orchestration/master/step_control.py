"""Adaptive steps of the master by step doubling: as long as the coupling error permits."""

from __future__ import annotations

import math

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.interrupt import Interrupt
from orchestration.master.executor import Executor
from orchestration.master.instances import SavedState

_SHORTEST = 1e-12  # relative to the time, or to a second
_LARGEST_GROWTH = 5.0  # of the step size from step to step
_LARGEST_REDUCTION = 0.2
_SAFETY = 0.9
_WHOLE = 0.999  # share of the rest of a communication step from which on a step covers all of it


class Checkpoint:
    """The saved state of an executor: states of members, values in the buffers, and slopes."""

    def __init__(self, executor: Executor):
        self._buffers = [executor.inputs.values, executor.outputs.values]
        self._values = [values.copy() for values in self._buffers]
        self._histories = [step.history for step in executor.complete.extrapolating]
        self._slopes: list[list[float]] = []
        self._states = SavedState(executor.members, executor.present_step)
        executor.saved_states.append(self._states)

    def save(self) -> None:
        """Save the present state; UserError if a member refuses."""
        self._states.save()
        for saved, values in zip(self._values, self._buffers, strict=True):
            saved[:] = values
        self._slopes = [history.slopes.copy() for history in self._histories]

    def restore(self) -> None:
        """Restore the state that was saved last; UserError if a member refuses."""
        self._states.restore()
        for saved, values in zip(self._values, self._buffers, strict=True):
            values[:] = saved
        for history, slopes in zip(self._histories, self._slopes, strict=True):
            history.slopes[:] = slopes


class StepDoubling:
    """Adaptive steps from one communication point to the next.

    Every step is made once as a whole and then, after going back, as two halves, which are kept.
    The difference of the results, of all continuous outputs and relative to
    ``tolerance * (nominal + |value|)``, is the error.

    Parameters
    ----------
    executor : Executor
    tolerance : float

    Attributes
    ----------
    steps, rollbacks : int
        Number of steps that were kept, and of those that were repeated with a shorter one.
    """

    def __init__(self, executor: Executor, tolerance: float):
        self._executor = executor
        self._tolerance = tolerance
        self._checkpoint = Checkpoint(executor)
        by_name = {member.name: member for member in executor.members}
        self._ports = [
            p for p in executor.outputs.at if by_name[p.member].is_continuous(p.variable)
        ]
        self._places = [executor.outputs.at[port] for port in self._ports]
        self._nominal = np.array([by_name[p.member].nominal(p.variable) for p in self._ports])
        self._order = 1 + executor.settings.extrapolation
        self._next_size = math.inf
        self.steps = 0
        self.rollbacks = 0

    def advance(self, start: float, end: float, k: int, interrupt: Interrupt) -> bool:
        """Step from point `k` to the next.

        Parameters
        ----------
        start, end : float
            Times of the two points in s.
        k : int
        interrupt : Interrupt

        Returns
        -------
        bool
            Whether it was reached; false if Ctrl-C was pressed before.

        Raises
        ------
        UserError
            If a member fails, or the error stays too large however short the step.
        """
        time = start
        while time < end:
            if interrupt.pressed:
                return False
            size = min(self._next_size, end - time)
            reaches_end = size > _WHOLE * (end - time)
            target = end if reaches_end else time + size
            errors = self._step_twice(time, target, k)
            error = float(np.max(errors, initial=0.0))
            factor = self._size_factor(error)
            if error <= 1.0:
                self.steps += 1
                # a step that the communication point has cut short does not limit the next one
                if not reaches_end or size == self._next_size:
                    self._next_size = size * factor
                time = target
                continue
            self._checkpoint.restore()
            self.rollbacks += 1
            self._next_size = (target - time) * factor
            if self._next_size < _SHORTEST * max(1.0, abs(time)):
                port = self._ports[int(np.argmax(errors))]
                raise UserError(
                    f"{port} at {time:.10g} s: the coupling error stays above the tolerance"
                    f" {self._tolerance:g}, however short the step"
                )
        return True

    def _step_twice(self, start: float, end: float, k: int) -> Array:
        """Make a step as a whole, go back, and make it in two halves; return the errors."""
        outputs = self._executor.outputs.values
        self._checkpoint.save()
        self._step(start, end, k)
        once = outputs[self._places]
        self._checkpoint.restore()
        middle = start + 0.5 * (end - start)
        self._step(start, middle, k)
        self._step(middle, end, k)
        twice = outputs[self._places]
        return self._errors(once, twice)

    def _size_factor(self, error: float) -> float:
        """Return the factor from this step size to the next."""
        if error == 0.0:
            return _LARGEST_GROWTH
        factor = _SAFETY * error ** (-1.0 / (self._order + 1))
        return min(_LARGEST_GROWTH, max(_LARGEST_REDUCTION, factor))

    def _errors(self, once: Array, twice: Array) -> Array:
        """Return the difference of two results relative to the tolerance; 0 where both are NaN."""
        with np.errstate(invalid="ignore"):
            errors = np.abs(twice - once) / (self._tolerance * (self._nominal + np.abs(twice)))
        errors[np.isnan(errors)] = math.inf
        errors[(once == twice) | (np.isnan(once) & np.isnan(twice))] = 0.0
        return errors

    def _step(self, start: float, end: float, k: int) -> None:
        """Step all members and exchange values, with the external values of point `k`."""
        executor = self._executor
        executor.step(executor.complete, start, end)
        executor.exchange(executor.complete.stages, k)
        executor.update_slopes(executor.complete)
