"""Times in effects, which depend on the sample time and the length of a record.

An effect needs a time constant for a state that follows its input at once, and a period for the
samples of a delay. They are 10 ms and 20 ms, which suits a bench. They are scaled for other
records: one of 40 kHz may be shorter than 20 ms, and with one sample a minute 10 ms makes a model
stiff. Without a record they are scaled for the experiment of a component that is slower than a
bench, such as a tank.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from .declare import Constant

_AT_ONCE = 0.01  # s
_DELAY_PERIOD = 0.02  # s
_TIME_CONSTANT = 1.0  # s
# No record shows times within a sample, and those below a hundredth of a sample cost many steps.
_FINEST = 0.01  # samples
# A longer time can hardly be distinguished from a drift.
_LONGEST = 0.1  # relative to the record
_FIRST = 10.0  # samples; a lag of this time is visible
_BENCH = 0.1  # s; longest step of the experiment of a bench, also that of a component by default

DELAY_SAMPLES = 64  # length of the shift register of a delay


@dataclass(frozen=True)
class Sampling:
    """Sampling of a record; by default one that suits the times for a bench.

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
    def at_once(self) -> Constant:
        """Time constant of a state that follows its input at once, s."""
        return Constant(min(max(_AT_ONCE, _FINEST * self.step), self.step), "s")

    @property
    def delay_period(self) -> Constant:
        """Sample period of the shift register of a delay, s.

        It is at least the sample time of the record. The register covers at most a tenth of the
        record, or 64 samples of it.
        """
        shortest = min(_DELAY_PERIOD, _LONGEST * self.duration / DELAY_SAMPLES)
        return Constant(max(self.step, shortest), "s")

    def holding(self, delay: float) -> Sampling:
        """Return the sampling with the shortest delay period whose register covers 2 `delay`, s."""
        return replace(self, duration=min(self.duration, 2.0 * delay / _LONGEST))

    @property
    def time_constant(self) -> float:
        """Time constant from which a fit starts, s."""
        return max(_FIRST * self.step, min(_TIME_CONSTANT, _LONGEST * self.duration))


def sampling_of(experiment: tuple[float, float]) -> Sampling:
    """Return the sampling of an experiment (stop time, step), s, if it is slower than a bench."""
    stop, step = experiment
    return Sampling(step, stop) if step > _BENCH else Sampling()
