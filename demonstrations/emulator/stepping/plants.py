"""The specimen in the clamps: the actuator driven by force, or by length."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

import numpy as np

from demonstrations.emulator.physics import Array, Physics
from demonstrations.emulator.stepping.transitions import Switching, Transitions

_LONGEST = 0.1  # s, piece of a length-driven actuator, whose slowest dynamics take seconds
_EXACT = 1e-12  # N, of the tension of a spring that is not linear
_ITERATIONS = 50


class Plant(Protocol):
    """Something that is driven and moves.

    Attributes
    ----------
    physics : Physics
        Of its actuator, whose states are the first of its own.
    inputs : tuple of str
    order : int
        Number of states.
    """

    inputs: ClassVar[tuple[str, ...]]
    physics: Physics
    order: int

    def hold(self, state: Array, commands: Array, time: float) -> Array:
        """Return the held inputs (2,) from an instant (s) on, from commands and state (order,)."""
        ...

    def longest(self, time: float) -> float:
        """Return how long (s) from an instant on it is held, and may be advanced at once."""
        ...

    def advance(self, state: Array, held: Array, duration: float) -> Array:
        """Return the state (order,) a duration (s) later."""
        ...

    def terminal(self, state: Array, held: Array) -> Array:
        """Return current (A) and tension (N) of the actuator, shape (2,)."""
        ...

    def shown(self, state: Array, held: Array) -> dict[str, float]:
        """Return what it shows beside the actuator's own outputs."""
        ...


class ForceDriven:
    """The actuator under a current and a force."""

    inputs: ClassVar[tuple[str, ...]] = ("current", "force")

    def __init__(self, physics: Physics):
        self.physics = physics
        self.order = physics.order
        self._transitions = Transitions(physics)

    def hold(self, state: Array, commands: Array, time: float) -> Array:
        """Hold the commands."""
        return commands

    def longest(self, time: float) -> float:
        """Set no bound: variations that are not linear have steps of their own."""
        return np.inf

    def advance(self, state: Array, held: Array, duration: float) -> Array:
        """Propagate."""
        return self._transitions(state, held, duration)

    def terminal(self, state: Array, held: Array) -> Array:
        """Return current and force, which are both given."""
        return held

    def shown(self, state: Array, held: Array) -> dict[str, float]:
        """Return nothing more."""
        return {}


class Spring:
    """The instantaneous spring of a physics, the other way round: tension from length.

    Parameters
    ----------
    physics : Physics
    """

    def __init__(self, physics: Physics):
        kind = type(physics)
        self.physics = physics
        self._plain = kind.spring_length is Physics.spring_length
        # Only then are the rates under a given length linear where those under a given force are.
        self.is_linear = (
            physics.is_linear
            and self._plain
            and kind.electrochemical_length is Physics.electrochemical_length
        )

    def gap(self, state: Array, length: float) -> float:
        """Return how far (m) a length (m) stretches the spring."""
        p = self.physics
        free = p.mechanical_length(state, 0.0) + p.electrochemical_length(p.active_charge(state))
        return float(length - free)

    def tension(self, state: Array, gap: float) -> Any:
        """Return the force (N) that stretches the spring so far (m); negative where compressed."""
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
    """The actuator under a current and a length; its instantaneous spring is tense or slack."""

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
        """Hold the commands."""
        return commands

    def longest(self, time: float) -> float:
        """Look for slack that often."""
        return _LONGEST

    def advance(self, state: Array, held: Array, duration: float) -> Array:
        """Propagate, from slack to taut and back."""
        return self._switching(state, held, duration)

    def terminal(self, state: Array, held: Array) -> Array:
        """Solve for the tension; a film does not push."""
        gap = self.spring.gap(state, held[1])
        return np.array([held[0], self.spring.tension(state, gap) if gap > 0 else 0.0])

    def shown(self, state: Array, held: Array) -> dict[str, float]:
        """Show the tension."""
        return {"tension": float(self.terminal(state, held)[1])}


class _Regime:
    """Motion of a length-driven actuator that stays taut, or slack."""

    def __init__(self, spring: Spring, taut: bool):
        self.spring = spring
        self.taut = taut
        self.order = spring.physics.order
        self.is_linear = spring.is_linear if taut else spring.physics.is_linear

    def rates(self, state: Array, current: Any, length: Any) -> list[Any]:
        """Return the actuator's rates under the tension of the length."""
        force = self.spring.tension(state, self.spring.gap(state, length)) if self.taut else 0.0
        return self.spring.physics.rates(state, current, force)
