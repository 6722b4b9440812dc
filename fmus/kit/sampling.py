"""Times that effects are made for: how fast and for how long the record is that they explain.

What follows its input "at once", and how finely a delay is held, have to be times in an FMU. They
are 10 ms and 20 ms, which suits a bench. A record of 40 kHz is over before a delay of 20 ms has
passed, and of one sample a minute a hundredth of a second is stiff; there they are scaled.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

_AT_ONCE = 0.01  # s
_DELAY_PERIOD = 0.02  # s
_TIME_CONSTANT = 1.0  # s
# Within a sample nobody sees what happens, and beyond a hundredth of one it costs steps.
_FINEST = 0.01  # samples
# What takes longer than a tenth of a record can hardly be distinguished from a drift.
_LONGEST = 0.1  # of a record
_FIRST = 10.0  # samples: a lag that is seen

DELAY_SAMPLES = 64  # of the register that holds a delay


@dataclass(frozen=True)
class Sampling:
    """Sampling of a record; unless given, of one for which the usual times serve.

    Attributes
    ----------
    step : float
        Sample time, s.
    duration : float
        Length of the record, s.
    """

    step: float = 0.01
    duration: float = 100.0

    @property
    def at_once(self) -> float:
        """The time within which something follows that follows at once, s."""
        return min(max(_AT_ONCE, _FINEST * self.step), self.step)

    @property
    def delay_period(self) -> float:
        """The period of a register that holds a delay, s.

        It is not finer than the record; all of the register is a tenth of that at most, or 64
        samples.
        """
        return max(self.step, min(_DELAY_PERIOD, _LONGEST * self.duration / DELAY_SAMPLES))

    def holding(self, delay: float) -> Sampling:
        """Return the sampling that has the finest register for a delay, s, and for twice that."""
        return replace(self, duration=min(self.duration, 2.0 * delay / _LONGEST))

    @property
    def time_constant(self) -> float:
        """The time constant from which a fit starts, s."""
        return max(_FIRST * self.step, min(_TIME_CONSTANT, _LONGEST * self.duration))
