"""Pacing of runs in real time: waiting for each communication point, and counting of delays."""

from __future__ import annotations

import os
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from time import perf_counter, sleep

from fmus.kit import UserError
from fmus.kit.interrupt import Interrupt

MISSED = ("warn", "stop")
# Upper bounds in s of the bins of the histogram of lateness; one more bin has no bound.
EDGES = (1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5, 1.0)
# A sleep ends some 80 us late. Busy waiting for the last part takes a tenth of a core at 1 kHz and
# leaves 0 in the median, 15 us at the 99th percentile (docs/decisions/0018).
_SPIN = 1e-4  # s
_LONGEST_SLEEP = 0.1  # s; the longest time for which Ctrl-C has to wait

Watch = Callable[[int, Sequence[float], float, int], None]


def _ignore(k: int, values: Sequence[float], lag: float, missed: int) -> None:
    """Do nothing at a communication point."""


@dataclass(frozen=True)
class RealTime:
    """The options of a run in real time.

    Attributes
    ----------
    missed : {"warn", "stop"}
        Whether a missed deadline is counted, or ends the run.
    lag : float
        Seconds; a run that is later than that ends in any case, for it is not in real time any
        more.
    allowance : float, optional
        Seconds by which a point may be reached late before its deadline counts as missed; default
        the step before it.
    makes_up : bool
        Whether a run that is late by more than allowed hurries until it is on time again. With a
        rig it must not: measurements would be as old as ever in a time that goes faster, and a
        loop that closes over it diverges.
    processor : int, optional
        The only processor to run on, where the system permits that.
    priority : bool
        Whether to raise the priority; where that is not allowed, `Run.notes` says so.
    watch : callable
        Called at every point, before the wait for it: with the number of the point, the recorded
        values in the order of `record`, the lateness of the point before in s, and the number of
        deadlines missed so far. Its time is part of the time of the step.

    Raises
    ------
    UserError
        If a value is not possible.
    """

    missed: str = "warn"
    lag: float = 1.0
    allowance: float | None = None
    makes_up: bool = True
    processor: int | None = None
    priority: bool = False
    watch: Watch = _ignore

    def __post_init__(self) -> None:
        if self.missed not in MISSED:
            raise UserError(f"missed deadlines {self.missed!r}; there are: {', '.join(MISSED)}")
        for name, value in (("lag", self.lag), ("allowance", self.allowance)):
            if value is not None and not (isfinite(value) and value > 0.0):
                raise UserError(f"{name} {value:g} s: must be above 0")
        count = os.cpu_count() or 1
        if self.processor is not None and not 0 <= self.processor < count:
            raise UserError(
                f"processor {self.processor}: there are {', '.join(map(str, range(count)))}"
            )


@dataclass(frozen=True)
class Pacing:
    """The statistics of the lateness of a run in real time.

    Attributes
    ----------
    deadlines, missed : int
        Number of points with a deadline, and of those that were later than allowed.
    worst_lag, worst_at : float
        Largest lateness, and its communication point, in s.
    edges, counts : tuple
        Histogram of the lateness: upper bounds of the bins in s, and the number of points in each
        bin and beyond the last.
    """

    deadlines: int
    missed: int
    worst_lag: float
    worst_at: float
    edges: tuple[float, ...]
    counts: tuple[int, ...]

    def __str__(self) -> str:
        missed = f"{self.missed} of {self.deadlines} deadlines missed"
        if not self.deadlines:
            return missed
        return f"{missed}, the latest by {self.worst_lag * 1e3:.3g} ms at {self.worst_at:.10g} s"


class Pacer:
    """A clock that waits for each communication point.

    Times are measured from the beginning of the run, so errors do not add up.

    Parameters
    ----------
    settings : RealTime
    points : sequence of float
        Communication points in s.
    interrupt : Interrupt
        Ends a wait.
    """

    def __init__(self, settings: RealTime, points: Sequence[float], interrupt: Interrupt):
        self._settings = settings
        self._points = points
        self._interrupt = interrupt
        self._counts = [0] * (len(EDGES) + 1)
        self._missed = 0
        self._lag = 0.0  # s, of the latest point
        self._worst = (0.0, points[0])  # largest lag and its point, s
        self._start = 0.0  # our clock at time 0 of the run, s

    def begin(self, values: Sequence[float]) -> None:
        """Start the clock at the first point, with the recorded values there."""
        self._settings.watch(0, values, 0.0, 0)
        self._start = perf_counter() - self._points[0]

    def keep(self, k: int, values: Sequence[float]) -> None:
        """Wait for the time of point `k`, which has been computed, and record how late it is.

        Parameters
        ----------
        k : int
        values : sequence of float
            Recorded values at the point.

        Raises
        ------
        UserError
            If the deadline was missed and that ends the run, or the lag is beyond its bound.
        """
        self._settings.watch(k, values, self._lag, self._missed)
        deadline = self._start + self._points[k]
        while (wait := deadline - perf_counter()) > 0.0:
            if self._interrupt.pressed:
                return
            if wait > _SPIN:
                sleep(min(wait - _SPIN, _LONGEST_SLEEP))
        lag = -wait
        self._lag = lag
        self._counts[bisect_left(EDGES, lag)] += 1
        if lag > self._worst[0]:
            self._worst = (lag, self._points[k])
        step = self._points[k] - self._points[k - 1]
        allowance = step if self._settings.allowance is None else self._settings.allowance
        if lag > allowance:
            self._miss_deadline(k, lag, allowance)

    def _miss_deadline(self, k: int, lag: float, allowance: float) -> None:
        """Count the missed deadline of point `k`; lag and allowance are in s.

        Unless the run makes up for lost time, all later points are due later by the lag.

        Raises
        ------
        UserError
            If a missed deadline ends the run, or the lag is beyond its bound.
        """
        self._missed += 1
        if not self._settings.makes_up:
            self._start += lag
        point = f"{self._points[k]:.10g} s"
        if lag > self._settings.lag:
            raise UserError(
                f"not in real time: {point} was reached {lag:.3g} s late; the lag may be"
                f" {self._settings.lag:g} s"
            )
        if self._settings.missed == "stop":
            raise UserError(
                f"deadline missed: {point} was reached {lag * 1e3:.3g} ms late;"
                f" {allowance * 1e3:.3g} ms are allowed"
            )

    def statistics(self) -> Pacing:
        """Return the statistics until now."""
        return Pacing(sum(self._counts), self._missed, *self._worst, EDGES, tuple(self._counts))
