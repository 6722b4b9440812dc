"""Real time: communication points that are reached when the clock says so, and how well that went."""

from __future__ import annotations

import os
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from time import perf_counter, sleep

from fmus.kit.errors import UserError
from orchestration.master.interrupt import Interrupt

MISSED = ("warn", "stop")
# Upper bounds in s of the bins that latenesses are counted in; one more bin has no bound.
EDGES = (1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5, 1.0)
# A sleep ends some 80 us late; turning round for the last part takes a tenth of a core at 1 kHz and leaves 0 in the
# median, 15 us at the 99th percentile (docs/decisions/0018).
_SPIN = 1e-4  # s
_LONGEST_SLEEP = 0.1  # s; so long an interrupt may have to wait

Watch = Callable[[int, Sequence[float], float, int], None]


def _nobody(k: int, values: Sequence[float], lag: float, missed: int) -> None:
    """Watch nothing."""


@dataclass(frozen=True)
class RealTime:
    """How a run keeps pace with the clock.

    Attributes
    ----------
    missed : {"warn", "stop"}
        What a missed deadline does: it is counted, or it ends the run.
    lag : float
        Seconds; a run that is later than that ends in any case, for it is not in real time any more.
    allowance : float, optional
        Seconds by which a point may be reached late before its deadline counts as missed; default the step before it.
    processor : int, optional
        The only one to run on, where the system can do that.
    priority : bool
        Whether to ask for a higher priority; where that is not allowed, `Run.notes` says so.
    watch : callable
        Called at every point, before it is waited for: with the number of the point, the recorded values in the order
        of `record`, the lateness of the point before in s, and how many deadlines were missed so far. What it takes is
        taken from the time of the step.

    Raises
    ------
    UserError
        If a value makes no sense.
    """

    missed: str = "warn"
    lag: float = 1.0
    allowance: float | None = None
    processor: int | None = None
    priority: bool = False
    watch: Watch = _nobody

    def __post_init__(self) -> None:
        if self.missed not in MISSED:
            raise UserError(f"missed deadlines {self.missed!r}; there are: {', '.join(MISSED)}")
        for name, value in (("lag", self.lag), ("allowance", self.allowance)):
            if value is not None and not (isfinite(value) and value > 0.0):
                raise UserError(f"{name} {value:g} s: must be above 0")
        there = os.cpu_count() or 1
        if self.processor is not None and not 0 <= self.processor < there:
            raise UserError(
                f"processor {self.processor}: there are {', '.join(map(str, range(there)))}"
            )


@dataclass(frozen=True)
class Pacing:
    """How well a run kept pace.

    Attributes
    ----------
    deadlines, missed : int
        Points that were to be reached in time, and those that were later than allowed.
    worst_lag, worst_at : float
        Largest lateness in s, and the communication point of it.
    edges, counts : tuple
        Histogram of latenesses: upper bounds of the bins in s, and how many were in each and beyond the last.
    """

    deadlines: int
    missed: int
    worst_lag: float
    worst_at: float
    edges: tuple[float, ...]
    counts: tuple[int, ...]

    def __str__(self) -> str:
        late = f"the latest by {self.worst_lag * 1e3:.3g} ms at {self.worst_at:.10g} s"
        return f"{self.missed} of {self.deadlines} deadlines missed" + (
            f", {late}" if self.deadlines else ""
        )


class Pacer:
    """Lets no communication point be reached before its time, measured from the beginning: errors do not add up.

    Parameters
    ----------
    settings : RealTime
    points : sequence of float
        Communication points in s.
    interrupt : Interrupt
        Ends a wait.
    """

    def __init__(self, settings: RealTime, points: Sequence[float], interrupt: Interrupt):
        self._settings, self._points, self._interrupt = settings, points, interrupt
        self._counts = [0] * (len(EDGES) + 1)
        self._missed, self._lag = 0, 0.0
        self._worst = (0.0, points[0])
        self._start = 0.0

    def begin(self, values: Sequence[float]) -> None:
        """Let the first point, with these values, be now."""
        self._settings.watch(0, values, 0.0, 0)
        self._start = perf_counter() - self._points[0]

    def keep(self, k: int, values: Sequence[float]) -> None:
        """Wait until it is time for point `k`, which has been computed.

        Parameters
        ----------
        k : int
        values : sequence of float
            What is recorded at the point.

        Raises
        ------
        UserError
            If the deadline was missed and that ends the run, or the lag is beyond its bound.
        """
        self._settings.watch(k, values, self._lag, self._missed)
        deadline = self._start + self._points[k]
        while (left := deadline - perf_counter()) > 0.0:
            if self._interrupt.pressed:
                return
            if left > _SPIN:
                sleep(min(left - _SPIN, _LONGEST_SLEEP))
        self._lag = lag = -left
        self._counts[bisect_left(EDGES, lag)] += 1
        if lag > self._worst[0]:
            self._worst = lag, self._points[k]
        self._judge(k, lag)

    def _judge(self, k: int, lag: float) -> None:
        allowance = self._settings.allowance
        if allowance is None:
            allowance = self._points[k] - self._points[k - 1]
        if lag <= allowance:
            return
        self._missed += 1
        here = f"{self._points[k]:.10g} s"
        if lag > self._settings.lag:
            raise UserError(
                f"not in real time: {here} was reached {lag:.3g} s late; the lag may be {self._settings.lag:g} s"
            )
        if self._settings.missed == "stop":
            raise UserError(
                f"deadline missed: {here} was reached {lag * 1e3:.3g} ms late; {allowance * 1e3:.3g} ms are allowed"
            )

    def statistics(self) -> Pacing:
        """How it went until now."""
        return Pacing(sum(self._counts), self._missed, *self._worst, EDGES, tuple(self._counts))
