"""Drives a rig in real time and notes what it does: which output belongs to which command, and what is missing.

A command takes effect when the rig next writes, and is measured when it next reads. So the value of an output that
belongs to a command is the first that was measured after the server accepted it; a value from before would show the
command before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, nan
from time import monotonic, perf_counter, sleep
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.rig_proxy.link import Link, LinkError
from fmus.rig_proxy.protocol import SAFE
from orchestration.experiment.live import Moment
from orchestration.master.interrupt import Interrupt
from orchestration.master.pacing import Pacer, Pacing, RealTime
from orchestration.rig.record.plan import Plan

Array = NDArray[np.float64]
Rows = Callable[[float, list[float]], None]
_SILENCE = 1.0  # s without an answer, at least, after which the link is lost
_LEAST_WAIT = 0.002  # s for an answer
_WAITING = 0.9  # of an interval, for an answer
_NEVER = 1e9  # s of lag that end it: what is too late is left out instead
_OPENING = 2.0  # s for the server to accept


@dataclass(frozen=True)
class Recorded:
    """What came of a plan.

    Attributes
    ----------
    inputs : ndarray, shape (m, number of inputs)
        As applied, for the first m rows; NaN where the rig was not heard.
    outputs, ages : ndarray, shape (m, number of outputs)
        As measured, and how old each value was when the rig sent it, in s; NaN where there is none.
    failure : str
        Why it ended before its time; empty if it did not, or was interrupted.
    pacing : Pacing
        How well real time was kept.
    """

    inputs: Array
    outputs: Array
    ages: Array
    failure: str
    pacing: Pacing


class _Row:
    """A row while it comes about."""

    def __init__(self, k: int, commands: list[float], outputs: int):
        self.k, self.commands = k, commands
        self.accepted: float | None = None  # on the rig's clock
        self.values, self.ages = [nan] * outputs, [nan] * outputs

    def offer(self, sample: Mapping[str, Any], max_age: float, since: float = inf) -> None:
        """Take from a sample what is still missing.

        Parameters
        ----------
        sample : Mapping
        max_age : float
            In s.
        since : float
            From when on, on the rig's clock, the commands are what they are now; default that of this row.
        """
        if self.accepted is None:
            self.accepted = sample["clock"]
        first = min(self.accepted, since)
        for place, (value, age) in enumerate(zip(sample["values"], sample["ages"], strict=True)):
            if value is None or age is None or self.values[place] == self.values[place]:
                continue
            if age <= max_age and sample["clock"] - age > first:
                self.values[place], self.ages[place] = value, age

    @property
    def is_complete(self) -> bool:
        """Whether every output has a value."""
        return all(value == value for value in self.values)

    def cells(self) -> list[float]:
        """Return inputs, outputs and ages."""
        heard = self.accepted is not None
        return [*(self.commands if heard else [nan] * len(self.commands)), *self.values, *self.ages]


def drive(
    link: Link,
    planned: Plan,
    interrupt: Interrupt,
    add: Rows,
    look: Callable[[Moment], None],
    trouble: Callable[[], str],
) -> Recorded:
    """Drive a rig, and leave it at rest.

    Parameters
    ----------
    link : Link
        With the plan's signals; not connected yet.
    planned : Plan
    interrupt : Interrupt
        Ends it.
    add : callable
        Called with time and cells of every row when it is complete.
    look : callable
        Called at every row.
    trouble : callable
        Tells what `look` is to say besides.

    Returns
    -------
    Recorded

    Raises
    ------
    UserError
        If the server does not accept the session.
    """
    driving = _Drive(link, planned, interrupt, add, look, trouble)
    try:
        accepted = link.connect(0.0, _OPENING)
        sleep(_between_samples(accepted))
        failure = driving.run()
    finally:
        link.disconnect()
    cells = np.array(driving.rows).reshape(-1, len(planned.inputs) + 2 * len(planned.outputs))
    inputs, outputs, ages = np.split(
        cells, np.cumsum([len(planned.inputs), len(planned.outputs)]), axis=1
    )
    return Recorded(inputs, outputs, ages, failure, driving.pacing())


def _between_samples(accepted: Mapping[str, Any]) -> float:
    """Return how long to wait so that commands arrive in the middle between two samples, whatever their jitter."""
    ages = [age for age in accepted["ages"] if age is not None]
    return float((0.5 * accepted["period"] - min(ages, default=0.0)) % accepted["period"])


class _Drive:
    def __init__(
        self,
        link: Link,
        planned: Plan,
        interrupt: Interrupt,
        add: Rows,
        look: Callable[[Moment], None],
        trouble: Callable[[], str],
    ):
        self._link, self._plan, self._interrupt = link, planned, interrupt
        self._add, self._look, self._trouble = add, look, trouble
        self._commands = planned.values.tolist()
        # the last exchange, after the last row, is there to fetch what was measured in its step
        self._points = (
            np.arange(planned.time.size * planned.exchanges + 1) * planned.interval
        ).tolist()
        self._pacer = Pacer(RealTime(lag=_NEVER, watch=self._watch), self._points, interrupt)
        self._lag, self._missed, self._left_out = 0.0, 0, 0
        self._row: _Row | None = None
        self._newest: Mapping[str, Any] | None = None
        self._since = inf  # on the rig's clock, from when on the commands are what they are
        self.rows: list[list[float]] = []

    def run(self) -> str:
        """Exchange until the end; return why it came early."""
        self._pacer.begin(())
        began, answered = perf_counter(), monotonic()
        for number, point in enumerate(self._points):
            if perf_counter() - began > point + self._plan.interval:
                self._left_out += 1  # what is late by that is not sent: the next one is due
                continue
            if number:
                self._pacer.keep(number, ())
            if self._interrupt.pressed:
                break
            try:
                sample = self._exchange(number // self._plan.exchanges, point)
            except LinkError as error:
                return str(error)
            if sample is not None:
                answered = monotonic()
                if sample["state"] == SAFE:
                    return f"the rig went to its safe state: {sample['reason']}"
                if sample["refused"]:
                    return f"the rig refused a command: {sample['refused'][0]}"
            elif (silent := monotonic() - answered) > max(_SILENCE, self._plan.watchdog):
                return f"no answer from {self._link.endpoint} for {silent:.1f} s"
        if self._row is not None and (not self._interrupt.pressed or self._row.is_complete):
            self._finish(self._row)
        return ""

    def _exchange(self, k: int, point: float) -> Mapping[str, Any] | None:
        """Send the commands of a row, and see to the rows with what comes back."""
        interval = self._plan.interval
        commands = self._commands[min(k, len(self._commands) - 1)]
        wait = max(_LEAST_WAIT, _WAITING * interval)
        sample = self._link.exchange(commands, point, interval, wait)
        if sample is not None and (sample["state"] == SAFE or sample["refused"]):
            return sample
        before = self._row
        if before is None or before.k != k:
            if before is not None:
                self._offer(before, sample)
                self._finish(before)
            if before is None or commands != before.commands:
                self._since = inf
            self._row = self._begin(k, commands)
        if self._row is not None:
            self._offer(self._row, sample)
        return sample

    def _offer(self, row: _Row, sample: Mapping[str, Any] | None) -> None:
        if sample is not None:
            row.offer(sample, self._plan.max_age)
            self._newest, self._since = sample, min(self._since, sample["clock"])

    def _begin(self, k: int, commands: list[float]) -> _Row | None:
        outputs = len(self._plan.outputs)
        while len(self.rows) < min(k, len(self._commands)):  # rows that were left out
            self._finish(_Row(len(self.rows), commands, outputs))
        if k >= len(self._commands):
            return None
        link = {"round_trip_time": self._link.round_trip_time}
        if self._newest is not None:
            link |= {
                f"{n}_age": nan if a is None else a
                for n, a in zip(self._plan.outputs, self._newest["ages"], strict=True)
            }
        time = self._plan.time
        self._look(
            Moment(
                time[k], time[-1], self._lag, self._missed + self._left_out, link, self._trouble()
            )
        )
        return _Row(k, commands, outputs)

    def _finish(self, row: _Row) -> None:
        if self._newest is not None and row.accepted is not None:
            row.offer(self._newest, self._plan.max_age, self._since)
        self.rows.append(row.cells())
        self._add(float(self._plan.time[row.k]), self.rows[-1])

    def _watch(self, number: int, values: Sequence[float], lag: float, missed: int) -> None:
        self._lag, self._missed = lag, missed

    def pacing(self) -> Pacing:
        """How well real time was kept; what was left out is missed."""
        kept = self._pacer.statistics()
        return replace(
            kept, deadlines=kept.deadlines + self._left_out, missed=kept.missed + self._left_out
        )
