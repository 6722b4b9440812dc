"""Excitation: reversals of the current, whether they suffice for an estimate, and their period.

A reversal is a return of the current from its extreme by more than a minimum swing. Two reversals
of equal sign are a period apart for any waveform, so the sum of the latest two times between
reversals is a period.
"""

from __future__ import annotations

from math import pi
from typing import Any

from ..kit import Output, Parameter, exp, logical_and, maximum, minimum, where
from .measurement import Measurement, sampled_state

# The first change and the reversal after it need not be half a period apart; the next two are.
_REVERSALS_BEFORE_A_PERIOD = 3


class Excitation(Measurement):
    """Excitation of the current: its reversals and their period."""

    minimum_swing = Parameter(
        0.1,
        "A",
        min=1e-9,
        max=1e3,
        tunable=True,
        doc="change of the current that counts as a reversal of its direction",
    )
    excitation_timeout = Parameter(
        20.0,
        "s",
        min=1e-3,
        max=1e7,
        tunable=True,
        doc="time after the latest reversal when estimation stops until the next",
    )
    angular_frequency = Parameter(
        0.628,
        "rad/s",
        min=0,
        max=1e6,
        source="thesis section 4.3",
        doc="where the impedance is evaluated, unless the frequency is tracked and known",
    )
    track_frequency = Parameter(
        False,
        "1",
        type="boolean",
        doc="whether the impedance is evaluated at the fundamental frequency of the current",
    )
    tracking_time = Parameter(
        30.0,
        "s",
        min=0.1,
        max=1e6,
        tunable=True,
        doc="time constant with which the tracked frequency follows the reversals",
    )

    direction = sampled_state(
        "1",
        "next_direction",
        "direction in which the current moves; 0 before it has moved",
        min=-1,
        max=1,
    )
    turning_current = sampled_state(
        "A", "next_turning_current", "extreme of the current since it turned"
    )
    reversals = sampled_state(
        "1", "next_reversals", "how often the current changed its direction", min=0
    )
    time_since_reversal = sampled_state(
        "s", "next_time_since_reversal", "time since the latest reversal", min=0
    )
    excited_time = sampled_state("s", "next_excited_time", "time spent estimating", min=0)
    steady_reversals = sampled_state(
        "1", "next_steady_reversals", "reversals since excitation began", min=0
    )
    half_period = sampled_state(
        "s", "next_half_period", "time between the latest two reversals", min=0
    )
    excitation_period = sampled_state(
        "s",
        "next_excitation_period",
        "period of the current as tracked; 0 before it is known",
        min=0,
    )

    # --- reversals
    # ----------------------------------------------------------------------------------------------

    def extreme_current(self) -> Any:
        """Extreme of the current in its direction, this sample included."""
        current = self.measured_current()
        extreme = self.turning_current
        # a current that has not changed yet has no direction: its extreme is its start value
        falling_or_at_rest = where(self.direction < 0.0, minimum(extreme, current), extreme)
        return where(self.direction > 0.0, maximum(extreme, current), falling_or_at_rest)

    def reverses(self) -> Any:
        """True if the current has returned from its extreme by more than the minimum swing, or
        first changes by it.
        """
        back = self.measured_current() - self.extreme_current()
        swing = where(self.direction == 0.0, abs(back), -self.direction * back)
        return swing > self.minimum_swing

    def next_direction(self) -> Any:
        """Direction of the current after this sample."""
        latest = where(self.measured_current() > self.extreme_current(), 1.0, -1.0)
        return where(self.reverses(), latest, self.direction)

    def next_turning_current(self) -> Any:
        """Extreme of the current since it turned."""
        return where(self.reverses(), self.measured_current(), self.extreme_current())

    def next_reversals(self) -> Any:
        """Number of reversals after this sample."""
        return self.reversals + where(self.reverses(), 1.0, 0.0)

    def next_time_since_reversal(self) -> Any:
        """Time since the latest reversal."""
        return where(self.reverses(), 0.0, self.time_since_reversal + self.sample_period)

    # --- sufficient excitation
    # ----------------------------------------------------------------------------------------------

    def has_recent_reversal(self) -> Any:
        """True if there was a reversal before this sample within the timeout."""
        return logical_and(self.reversals > 0.0, self.time_since_reversal < self.excitation_timeout)

    def excited(self) -> Any:
        """True if the estimate uses this sample: it has a previous one and a recent reversal."""
        return logical_and(self.samples > 0.0, self.has_recent_reversal())

    def next_excited_time(self) -> Any:
        """Time spent estimating."""
        return self.excited_time + where(self.excited(), self.sample_period, 0.0)

    # --- frequency
    # ----------------------------------------------------------------------------------------------

    def next_steady_reversals(self) -> Any:
        """Number of reversals since excitation began; the first after a rest counts 1."""
        number = where(self.has_recent_reversal(), self.steady_reversals + 1.0, 1.0)
        return where(self.reverses(), number, self.steady_reversals)

    def next_half_period(self) -> Any:
        """Time between the latest two reversals."""
        return where(
            self.reverses(), self.time_since_reversal + self.sample_period, self.half_period
        )

    def next_excitation_period(self) -> Any:
        """Low-pass of the time between reversals of equal sign, updated at reversals."""
        latest = self.time_since_reversal + self.sample_period
        period = self.half_period + latest
        is_steady = logical_and(
            self.has_recent_reversal(), self.steady_reversals >= _REVERSALS_BEFORE_A_PERIOD
        )
        previous = self.excitation_period
        # the first period is taken as it is; later ones are filtered over the time since the latest
        share = where(previous > 0.0, 1.0 - exp(-latest / self.tracking_time), 1.0)
        filtered = previous + share * (period - previous)
        return where(logical_and(self.reverses(), is_steady), filtered, previous)

    def fundamental(self, period: Any) -> Any:
        """Angular frequency of a period; ``angular_frequency`` while the period is unknown."""
        known = period > 0.0
        return where(known, 2.0 * pi / where(known, period, 1.0), self.angular_frequency)

    def evaluation_frequency(self, period: Any) -> Any:
        """Angular frequency at which the impedance is evaluated: the tracked or the given one."""
        return where(self.track_frequency, self.fundamental(period), self.angular_frequency)

    @Output("rad/s")
    def tracked_angular_frequency(self) -> Any:
        """Fundamental angular frequency of the current, whether it is used or not; the one given
        before it is known.
        """
        return self.fundamental(self.excitation_period)
