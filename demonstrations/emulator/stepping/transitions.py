"""Transitions over recurring durations, and over the instant a film goes slack or taut."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from demonstrations.emulator.physics import Array, Motion, Transition

_MOST = 512  # transitions that are kept; steps of a controller or of a clock are few
_HALVINGS = 14  # of the longest piece, in search of the instant at which the regime changes
_NO_GAP = 1e-15  # m, below which slack and taut are the same


class Transitions:
    """Transitions of one motion, kept by duration, so that the same step always rounds alike.

    Parameters
    ----------
    motion : Motion
    """

    def __init__(self, motion: Motion):
        self.motion = motion
        self._kept: dict[float, Transition] = {}

    def __call__(self, state: Array, inputs: Array, duration: float) -> Array:
        """Return the state (order,) a duration (s) later, inputs (2,) held."""
        key = round(duration, 12)
        transition = self._kept.get(key)
        if transition is None:
            if len(self._kept) >= _MOST:
                self._kept.clear()
            transition = self._kept[key] = Transition(self.motion, key)
        return transition(state, inputs)


class Switching:
    """A motion of two regimes, slack and taut, that go over into each other continuously.

    At the instant of change both regimes have the same rates, so that an instant found to within
    `d` leaves an error of the order of `d` squared.

    Parameters
    ----------
    regimes : sequence of Motion
        Slack, taut.
    gap : callable
        Of state and inputs: how far (m) the spring is stretched; positive where taut.
    longest : float
        s, within which the regime is taken to change at most once.
    """

    def __init__(
        self, regimes: Sequence[Motion], gap: Callable[[Array, Array], float], longest: float
    ):
        self.regimes = [Transitions(regime) for regime in regimes]
        self.gap = gap
        self.longest = longest

    def __call__(self, state: Array, inputs: Array, duration: float) -> Array:
        """Return the state (order,) after a duration (s), at most the longest, inputs (2,) held."""
        before = self.gap(state, inputs)
        later = self.regimes[before > 0](state, inputs, duration)
        after = self.gap(later, inputs)
        alike = (before > 0) == (after > 0) or max(abs(before), abs(after)) < _NO_GAP
        if alike or duration <= self.longest / 2**_HALVINGS:
            return later
        half = duration / 2
        return self(self(state, inputs, half), inputs, duration - half)
