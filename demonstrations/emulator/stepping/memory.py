"""Hidden variations with memory, for a rig that is advanced step by step."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from demonstrations.emulator.hidden_coupling import PlayingStrain
from demonstrations.emulator.hidden_sensor import (
    LateSensor,
    SluggishSensor,
    two_stage_transition,
)
from demonstrations.emulator.physics import Array, Physics, Signals, Trajectory

_SAME = 1e-10  # s, largest difference of equal instants
_ROOM = 4096  # pieces in the past before old ones are removed


@dataclass(frozen=True)
class Instant(Trajectory):
    """One instant of a run; the time of a request is ignored."""

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return state (order, m) and inputs (2, m)."""
        return np.repeat(self.state, time.size, axis=1), np.repeat(self.inputs, time.size, axis=1)


class Remembering:
    """Base of variations with memory, which are informed of every step after it."""

    def passed(self, step: float, before: Instant, after: Instant) -> None:
        """Update the memory by a step (s) with constant inputs between two instants."""
        raise NotImplementedError


@dataclass
class RememberingPlay(PlayingStrain, Remembering):
    """Play operators with their own states."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._radii = self.widest_play * np.arange(1, 9) / 8
        self._memory = np.zeros(8)

    def play(self, charge: Any) -> Any:
        """Return the mean of the operators after a monotonic change to a charge."""
        return np.mean(self._move_operators(charge), axis=0)

    def _move_operators(self, charge: Any) -> Array:
        low, high = np.subtract.outer(-self._radii, -charge), np.add.outer(self._radii, charge)
        memory = self._memory.reshape(-1, *(1,) * np.ndim(charge))
        return np.maximum(low, np.minimum(high, memory))

    def passed(self, step: float, before: Instant, after: Instant) -> None:
        """Move the operators to the charge after the step."""
        self._memory = self._move_operators(self.active_charge(after.state[:, 0]))


@dataclass
class RememberingLag(SluggishSensor, Remembering):
    """A sensor whose two stages are states of its own."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._stages: Array | None = None
        self._transitions: dict[float, Array] = {}

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Return the signals with the second stage, at first in equilibrium."""
        signals = Physics.sensed(self, run, time)
        if self._stages is None:
            return signals
        return signals | {self.lag_output: np.repeat(self._stages[1], time.size)}

    def passed(self, step: float, before: Instant, after: Instant) -> None:
        """Advance the stages with an input that is linear over the step."""
        first, last = (
            float(Physics.sensed(self, i, i.time)[self.lag_output][0]) for i in (before, after)
        )
        if self._stages is None:
            self._stages = np.array([first, first])
        key = round(step, 9)
        if key not in self._transitions:
            self._transitions[key] = two_stage_transition(self.sensor_time, step)
        self._stages = self._transitions[key] @ np.array(
            [*self._stages, first, (last - first) / step]
        )


_IN_TIME: dict[type[Physics], type[Physics]] = {
    PlayingStrain: RememberingPlay,
    SluggishSensor: RememberingLag,
}


def in_time(variation: type[Physics]) -> type[Physics]:
    """Return the variation with a memory of its own if it needs one, else itself."""
    return _IN_TIME.get(variation, variation)


class Past:
    """Past of a run, as far back as the delay of a sensor.

    Parameters
    ----------
    physics : Physics
    move : callable
        Returns the state after a duration (s), for a state (order,) and constant inputs (2,).
    actuator : callable
        Returns the actuator's state, and its current and tension, for a state and inputs.
    """

    def __init__(
        self,
        physics: Physics,
        move: Callable[[Array, Array, float], Array],
        actuator: Callable[[Array, Array], tuple[Array, Array]],
    ):
        self.reach = physics.delay if isinstance(physics, LateSensor) else 0.0
        self._move = move
        self._actuator = actuator
        self._times: list[float] = []
        self._pieces: list[tuple[Array, Array]] = []

    def add(self, time: float, state: Array, held: Array) -> None:
        """Store the start of a piece with constant inputs."""
        self._times.append(time)
        self._pieces.append((state, held))
        if len(self._times) > _ROOM:
            old = bisect_right(self._times, time - self.reach - 1.0) - 1
            if old > _ROOM // 2:
                del self._times[:old], self._pieces[:old]

    def at(self, time: float) -> tuple[Array, Array] | None:
        """Return the actuator's state and inputs at an instant; None without a past.

        Before the run they are those of its start.
        """
        if not self._times:
            return None
        k = max(bisect_right(self._times, time + _SAME) - 1, 0)
        state, held = self._pieces[k]
        elapsed = round(max(time - self._times[k], 0.0), 9)
        return self._actuator(self._move(state, held, elapsed) if elapsed > 0 else state, held)


@dataclass(frozen=True)
class Reaching(Instant):
    """An instant of a run, with the past before it."""

    past: Past

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return states (order, m) and inputs (2, m) at instants of the past (s), or now."""
        now = (self.state[:, 0], self.inputs[:, 0])
        pairs = [
            now if t >= self.time[0] - _SAME else self.past.at(t) or now for t in time.tolist()
        ]
        states, inputs = zip(*pairs, strict=True)
        return np.array(states).T, np.array(inputs).T
