"""Excitation: reversals of the current, whether there are enough of them to estimate from, and how
often they come.

A reversal is a change by more than a swing back from the extreme. Two reversals of equal sign are a
period apart, in whatever shape the current swings; so the sum of the latest two times between
reversals is a period.
"""

from __future__ import annotations

from math import pi
from typing import Any

from ..kit import Discrete, Output, Parameter, exp, logical_and, maximum, minimum, where
from .measurement import Measurement

# The first movement and the reversal after it need not be half a period apart, the next two are.
_REVERSALS_BEFORE_A_PERIOD = 3


class Excitation(Measurement):
    """Excitation of the current: its reversals and their period."""

    minimum_swing = Parameter(
        0.1,
        "A",
        min=1e-9,
        max=1e3,
        doc="change of the current that counts as a reversal of its direction",
    )
    excitation_timeout = Parameter(
        20.0,
        "s",
        min=1e-3,
        max=1e7,
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
        doc="time constant with which the tracked frequency follows the reversals",
    )

    direction = Discrete(
        "1",
        update="next_direction",
        period="sample_period",
        min=-1,
        max=1,
        doc="direction in which the current moves; 0 before it has moved",
    )
    turning_current = Discrete(
        "A",
        update="next_turning_current",
        period="sample_period",
        doc="extreme of the current since it turned",
    )
    reversals = Discrete(
        "1",
        update="next_reversals",
        period="sample_period",
        min=0,
        doc="how often the current changed its direction",
    )
    time_since_reversal = Discrete(
        "s",
        update="next_time_since_reversal",
        period="sample_period",
        min=0,
        doc="time since the latest reversal",
    )
    excited_time = Discrete(
        "s", update="next_excited_time", period="sample_period", min=0, doc="time spent estimating"
    )
    steady_reversals = Discrete(
        "1",
        update="next_steady_reversals",
        period="sample_period",
        min=0,
        doc="reversals since excitation began",
    )
    half_period = Discrete(
        "s",
        update="next_half_period",
        period="sample_period",
        min=0,
        doc="time between the latest two reversals",
    )
    excitation_period = Discrete(
        "s",
        update="next_excitation_period",
        period="sample_period",
        min=0,
        doc="period of the current as tracked; 0 before it is known",
    )

    # --- reversals
    # ----------------------------------------------------------------------------------------------

    def extreme_current(self) -> Any:
        """Extreme of the current in its direction, this sample included."""
        current = self.measured_current()
        extreme = self.turning_current
        # before the current has moved it has no direction: its extreme is where it started
        falling_or_at_rest = where(self.direction < 0.0, minimum(extreme, current), extreme)
        return where(self.direction > 0.0, maximum(extreme, current), falling_or_at_rest)

    def reverses(self) -> Any:
        """Whether the current has come back from its extreme by more than the swing, or first
        moves.
        """
        back = self.measured_current() - self.extreme_current()
        swing = where(self.direction == 0.0, abs(back), -self.direction * back)
        return swing > self.minimum_swing

    def next_direction(self) -> Any:
        """Direction of the current after this sample."""
        moved = where(self.measured_current() > self.extreme_current(), 1.0, -1.0)
        return where(self.reverses(), moved, self.direction)

    def next_turning_current(self) -> Any:
        """Extreme of the current since it turned."""
        return where(self.reverses(), self.measured_current(), self.extreme_current())

    def next_reversals(self) -> Any:
        """Count a reversal."""
        return self.reversals + where(self.reverses(), 1.0, 0.0)

    def next_time_since_reversal(self) -> Any:
        """Time since the latest reversal."""
        return where(self.reverses(), 0.0, self.time_since_reversal + self.sample_period)

    # --- enough to estimate from
    # ------------------------------------------------------------------------------------

    def turned_lately(self) -> Any:
        """Whether there was a reversal before this sample, and not too long ago."""
        return logical_and(self.reversals > 0.0, self.time_since_reversal < self.excitation_timeout)

    def excited(self) -> Any:
        """Whether this sample counts: there is one before it, and the current turned lately before
        it.
        """
        return logical_and(self.samples > 0.0, self.turned_lately())

    def next_excited_time(self) -> Any:
        """Time spent estimating."""
        return self.excited_time + where(self.excited(), self.sample_period, 0.0)

    # --- frequency
    # ----------------------------------------------------------------------------------------------

    def next_steady_reversals(self) -> Any:
        """Count a reversal; the first after a rest begins anew."""
        counted = where(self.turned_lately(), self.steady_reversals + 1.0, 1.0)
        return where(self.reverses(), counted, self.steady_reversals)

    def next_half_period(self) -> Any:
        """Time between the latest two reversals."""
        return where(
            self.reverses(), self.time_since_reversal + self.sample_period, self.half_period
        )

    def next_excitation_period(self) -> Any:
        """Period, a low-pass of the time between reversals of equal sign; held while none is known
        anew.
        """
        latest = self.time_since_reversal + self.sample_period
        steady = logical_and(
            self.turned_lately(), self.steady_reversals >= _REVERSALS_BEFORE_A_PERIOD
        )
        share = where(self.excitation_period > 0.0, 1.0 - exp(-latest / self.tracking_time), 1.0)
        followed = self.excitation_period + share * (
            self.half_period + latest - self.excitation_period
        )
        return where(logical_and(self.reverses(), steady), followed, self.excitation_period)

    def fundamental(self, period: Any) -> Any:
        """Angular frequency of a period; the one given while the period is not known."""
        known = period > 0.0
        return where(known, 2.0 * pi / where(known, period, 1.0), self.angular_frequency)

    def evaluation_frequency(self, period: Any) -> Any:
        """Angular frequency at which the impedance is evaluated: tracked or given."""
        return where(self.track_frequency, self.fundamental(period), self.angular_frequency)

    @Output("rad/s")
    def tracked_angular_frequency(self) -> Any:
        """Fundamental angular frequency of the current, whether it is used or not; the one given
        before it is known.
        """
        return self.fundamental(self.excitation_period)
