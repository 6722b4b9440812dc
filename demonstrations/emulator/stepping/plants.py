"""Plants with an actuator that is driven by force, or by length."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

import numpy as np

from demonstrations.emulator.physics import Array, Physics
from demonstrations.emulator.stepping.transitions import Switching, Transitions

_LONGEST = 0.1  # s, piece of a length-driven actuator, whose slowest dynamics take seconds
_EXACT = 1e-12  # N, tolerance of the tension of a nonlinear spring
_ITERATIONS = 50


class Plant(Protocol):
    """Protocol of a driven plant with an actuator.

    Attributes
    ----------
    physics : Physics
        Physics of the actuator, whose states are the first states of the plant.
    inputs : tuple of str
    order : int
        Number of states.
    """

    inputs: ClassVar[tuple[str, ...]]
    physics: Physics
    order: int

    def hold(self, state: Array, commands: Array, time: float) -> Array:
        """Return the inputs (2,) from a time (s) on, for commands and a state (order,)."""
        ...

    def longest(self, time: float) -> float:
        """Return the longest step (s) from a time on, over which inputs are constant."""
        ...

    def advance(self, state: Array, held: Array, duration: float) -> Array:
        """Return the state (order,) after a duration (s)."""
        ...

    def terminal(self, state: Array, held: Array) -> Array:
        """Return current (A) and tension (N) of the actuator, shape (2,)."""
        ...

    def shown(self, state: Array, held: Array) -> dict[str, float]:
        """Return the outputs that are not those of the actuator, by name."""
        ...


class ForceDriven:
    """Actuator with current and force as inputs."""

    inputs: ClassVar[tuple[str, ...]] = ("current", "force")

    def __init__(self, physics: Physics):
        self.physics = physics
        self.order = physics.order
        self._transitions = Transitions(physics)

    def hold(self, state: Array, commands: Array, time: float) -> Array:
        """Return the commands."""
        return commands

    def longest(self, time: float) -> float:
        """Return infinity, as nonlinear variations have steps of their own."""
        return np.inf

    def advance(self, state: Array, held: Array, duration: float) -> Array:
        """Return the state after the duration, with constant inputs."""
        return self._transitions(state, held, duration)

    def terminal(self, state: Array, held: Array) -> Array:
        """Return current and force, which are the inputs."""
        return held

    def shown(self, state: Array, held: Array) -> dict[str, float]:
        """Return an empty dictionary."""
        return {}


class Spring:
    """Inverse of the instantaneous spring of a physics: tension from length.

    Parameters
    ----------
    physics : Physics
    """

    def __init__(self, physics: Physics):
        kind = type(physics)
        self.physics = physics
        self._plain = kind.spring_length is Physics.spring_length
        # only then rates are linear in a length if they are in a force
        self.is_linear = (
            physics.is_linear
            and self._plain
            and kind.electrochemical_length is Physics.electrochemical_length
        )

    def gap(self, state: Array, length: float) -> float:
        """Return the elongation (m) of the spring at a length (m) of the actuator."""
        p = self.physics
        free = p.mechanical_length(state, 0.0) + p.electrochemical_length(p.active_charge(state))
        return float(length - free)

    def tension(self, state: Array, gap: float) -> Any:
        """Return the force (N) for an elongation (m) of the spring, negative in compression."""
        force = self.physics.parameters.k1 * gap
        if self._plain:
            return force
        unloaded = self.physics.spring_length(state, 0.0)
        before = 0.0
        miss_before = -gap
        for _ in range(_ITERATIONS):  # secants
            miss = float(self.physics.spring_length(state, force) - unloaded - gap)
            if miss == miss_before or abs(force - before) <= _EXACT:
                break
            before, miss_before, force = (
                force,
                miss,
                force - miss * (force - before) / (miss - miss_before),
            )
        return force


class LengthDriven:
    """Actuator with current and length as inputs, whose instantaneous spring is taut or slack."""

    inputs: ClassVar[tuple[str, ...]] = ("current", "length_change")

    def __init__(self, physics: Physics):
        self.physics = physics
        self.order = physics.order
        self.spring = Spring(physics)
        regimes = [_Regime(self.spring, taut=False), _Regime(self.spring, taut=True)]
        self._switching = Switching(
            regimes, lambda state, held: self.spring.gap(state, held[1]), _LONGEST
        )

    def hold(self, state: Array, commands: Array, time: float) -> Array:
        """Return the commands."""
        return commands

    def longest(self, time: float) -> float:
        """Return the interval (s) of the checks for slack."""
        return _LONGEST

    def advance(self, state: Array, held: Array, duration: float) -> Array:
        """Advance the state, with changes between slack and taut."""
        return self._switching(state, held, duration)

    def terminal(self, state: Array, held: Array) -> Array:
        """Return current (A) and tension (N), which is zero for a slack film."""
        gap = self.spring.gap(state, held[1])
        return np.array([held[0], self.spring.tension(state, gap) if gap > 0 else 0.0])

    def shown(self, state: Array, held: Array) -> dict[str, float]:
        """Return the tension."""
        return {"tension": float(self.terminal(state, held)[1])}


class _Regime:
    """Motion of a length-driven actuator that is taut, or slack."""

    def __init__(self, spring: Spring, taut: bool):
        self.spring = spring
        self.taut = taut
        self.order = spring.physics.order
        self.is_linear = spring.is_linear if taut else spring.physics.is_linear

    def rates(self, state: Array, current: Any, length: Any) -> list[Any]:
        """Return the rates of the actuator under the tension of a length."""
        force = self.spring.tension(state, self.spring.gap(state, length)) if self.taut else 0.0
        return self.spring.physics.rates(state, current, force)
