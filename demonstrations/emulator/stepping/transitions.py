"""Transitions over recurring durations, and over instants at which a film becomes slack or taut."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from demonstrations.emulator.physics import Array, Motion, Transition

_MOST = 512  # cached transitions; steps of a controller or of a clock are few
_HALVINGS = 14  # of the longest piece, to locate a change of regime
_NO_GAP = 1e-15  # m, below which slack and taut are equal


class Transitions:
    """Cache of the transitions of a motion by duration, so that equal steps give equal bits.

    Parameters
    ----------
    motion : Motion
    """

    def __init__(self, motion: Motion):
        self.motion = motion
        self._kept: dict[float, Transition] = {}

    def __call__(self, state: Array, inputs: Array, duration: float) -> Array:
        """Return the state (order,) after a duration (s) with constant inputs (2,)."""
        key = round(duration, 12)
        transition = self._kept.get(key)
        if transition is None:
            if len(self._kept) >= _MOST:
                self._kept.clear()
            transition = self._kept[key] = Transition(self.motion, key)
        return transition(state, inputs)


class Switching:
    """Motion with two regimes, slack and taut, whose rates are equal at the change of regime.

    An error `d` of the instant of change therefore causes an error of the order of `d` squared.

    Parameters
    ----------
    regimes : sequence of Motion
        Motion when slack, and when taut.
    gap : callable
        Returns the elongation (m) of the spring for state and inputs, positive when taut.
    longest : float
        Longest duration in s, in which the regime is assumed to change at most once.
    """

    def __init__(
        self, regimes: Sequence[Motion], gap: Callable[[Array, Array], float], longest: float
    ):
        self.regimes = [Transitions(regime) for regime in regimes]
        self.gap = gap
        self.longest = longest

    def __call__(self, state: Array, inputs: Array, duration: float) -> Array:
        """Return the state (order,) after a duration (s) with constant inputs (2,)."""
        before = self.gap(state, inputs)
        later = self.regimes[before > 0](state, inputs, duration)
        after = self.gap(later, inputs)
        alike = (before > 0) == (after > 0) or max(abs(before), abs(after)) < _NO_GAP
        if alike or duration <= self.longest / 2**_HALVINGS:
            return later
        half = duration / 2
        return self(self(state, inputs, half), inputs, duration - half)
