"""Drive of a rig through an experiment in real time, and the record of its outputs.

A command takes effect when the rig next writes, and is measured when it next reads. So the value of
an output that belongs to a command is the first that was measured after the server accepted it; an
earlier one would show the effect of the command before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isnan, nan
from time import monotonic, perf_counter, sleep
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.interrupt import Interrupt
from fmus.rig_proxy import Link, LinkError, describe_latch
from orchestration.experiment.live import Moment
from orchestration.master import Pacer, Pacing, RealTime
from orchestration.rig.record.planning import RecordingPlan

Rows = Callable[[float, list[float]], None]
_ALARM = 0.4  # s without an answer, after which somebody has to look
_SILENCE = 1.0  # s without an answer, at least, after which the link is lost
_LEAST_WAIT = 0.002  # s for an answer
_WAITING = 0.9  # of an interval, for an answer
_NEVER = 1e9  # s of lag that would end the run: an exchange that is too late is skipped instead
_OPENING = 2.0  # s for the server to accept


@dataclass(frozen=True)
class RecordedRun:
    """The record of a rig that was driven.

    Attributes
    ----------
    inputs : ndarray, shape (m, number of inputs)
        Inputs as applied, for the first m rows; NaN where the rig was not heard.
    outputs, ages : ndarray, shape (m, number of outputs)
        Outputs as measured, and the age of each value in s when the rig sent it; NaN without a
        value.
    failure : str
        The reason for an early end; empty without one, or after an interrupt.
    pacing : Pacing
        Statistics of the timing of exchanges.
    """

    inputs: Array
    outputs: Array
    ages: Array
    failure: str
    pacing: Pacing


@dataclass(frozen=True)
class RecordingObserver:
    """Observer of a recording.

    Attributes
    ----------
    add : callable
        Called with time and cells of every row when it is complete.
    look : callable
        Called at every row.
    trouble : callable
        Returns a remark for `look`.
    alarm : callable
        Called with a message for the operator, at the beginning of every silence of the rig.
    """

    add: Rows
    look: Callable[[Moment], None]
    trouble: Callable[[], str]
    alarm: Callable[[str], None]


class _Row:
    """A row of the record while its values arrive."""

    def __init__(self, k: int, commands: list[float], outputs: int):
        self.k = k
        self.commands = commands
        self.accepted: float | None = None  # on the rig's clock
        self.values = [nan] * outputs
        self.ages = [nan] * outputs

    def offer(self, sample: Mapping[str, Any], max_age: float, since: float = inf) -> None:
        """Store the values of a sample that the row still lacks and that belong to its commands.

        Parameters
        ----------
        sample : Mapping
        max_age : float
            Largest age of a value in s.
        since : float
            Time on the rig's clock from which the commands are those of this row; default when this
            row was accepted.
        """
        if self.accepted is None:
            self.accepted = sample["clock"]
        first = min(self.accepted, since)
        for place, (value, age) in enumerate(zip(sample["values"], sample["ages"], strict=True)):
            if value is None or age is None or not isnan(self.values[place]):
                continue
            if age <= max_age and sample["clock"] - age > first:
                self.values[place] = value
                self.ages[place] = age

    @property
    def is_complete(self) -> bool:
        """True if every output has a value."""
        return not any(isnan(value) for value in self.values)

    def cells(self) -> list[float]:
        """Return inputs, outputs and ages."""
        was_accepted = self.accepted is not None
        applied = self.commands if was_accepted else [nan] * len(self.commands)
        return [*applied, *self.values, *self.ages]


def drive(
    link: Link,
    planned: RecordingPlan,
    interrupt: Interrupt,
    observer: RecordingObserver,
) -> RecordedRun:
    """Drive a rig, and leave it at rest.

    Parameters
    ----------
    link : Link
        Link with the plan's signals; not connected yet.
    planned : RecordingPlan
    interrupt : Interrupt
        Ends the run.
    observer : RecordingObserver

    Returns
    -------
    RecordedRun

    Raises
    ------
    UserError
        If the server does not accept the session.
    """
    driving = _Drive(link, planned, interrupt, observer)
    try:
        accepted = link.connect(0.0, _OPENING)
        sleep(_between_samples(accepted))
        failure = driving.run()
    finally:
        link.disconnect()
    widths = [len(planned.inputs), len(planned.outputs), len(planned.outputs)]
    cells = np.array(driving.rows).reshape(-1, sum(widths))
    inputs, outputs, ages = np.split(cells, np.cumsum(widths[:2]), axis=1)
    return RecordedRun(inputs, outputs, ages, failure, driving.pacing())


def _between_samples(accepted: Mapping[str, Any]) -> float:
    """Return the time in s to wait, so that commands arrive midway between two samples.

    Jitter then moves none of them to another sample.
    """
    ages = [age for age in accepted["ages"] if age is not None]
    return float((0.5 * accepted["period"] - min(ages, default=0.0)) % accepted["period"])


class _Drive:
    """The exchange of commands and samples with a rig, from the first row to the last."""

    def __init__(
        self,
        link: Link,
        planned: RecordingPlan,
        interrupt: Interrupt,
        observer: RecordingObserver,
    ):
        self._link = link
        self._plan = planned
        self._interrupt = interrupt
        self._observer = observer
        self._commands = planned.values.tolist()
        # the exchange after the last row fetches the values measured in the step of that row
        exchanges = planned.time.size * planned.exchanges + 1
        self._points = (np.arange(exchanges) * planned.interval).tolist()
        self._pacer = Pacer(RealTime(lag=_NEVER, watch=self._watch), self._points, interrupt)
        self._lag = 0.0
        self._missed = 0
        self._skipped = 0
        self._alarmed = -inf  # time of the last answer before the silence of the last alarm
        self._row: _Row | None = None
        self._newest: Mapping[str, Any] | None = None
        self._since = inf  # on the rig's clock, when it first had the present commands
        self.rows: list[list[float]] = []

    def run(self) -> str:
        """Exchange until the end; return the reason for an early end."""
        self._pacer.begin(())
        began = perf_counter()
        for number, point in enumerate(self._points):
            if perf_counter() - began > point + self._plan.interval:
                self._skipped += 1  # the next exchange is due already
                continue
            if number:
                self._pacer.keep(number, ())
            if self._interrupt.pressed:
                break
            try:
                sample = self._exchange(number // self._plan.exchanges, point)
            except LinkError as error:
                return str(error)
            failure = self._silence() if sample is None else self._failure(sample)
            if failure:
                return failure
        if self._row is not None and (not self._interrupt.pressed or self._row.is_complete):
            self._finish(self._row)
        return ""

    def _silence(self) -> str:
        """Alarm the operator if the rig is silent; return the reason to end, or an empty text."""
        answered = self._link.last_answer
        silent = monotonic() - answered
        if silent > _ALARM and answered != self._alarmed:
            self._alarmed = answered
            self._observer.alarm(
                f"no answer from {self._link.endpoint} for {silent:.1f} s: the rig goes to its safe"
                f" state by itself, {self._plan.watchdog:g} s after its last command; see that it"
                " does"
            )
        if silent > max(_SILENCE, self._plan.watchdog):
            return f"no answer from {self._link.endpoint} for {silent:.1f} s"
        return ""

    def _failure(self, sample: Mapping[str, Any]) -> str:
        """Return the reason to end after an answer; empty if there is none."""
        if latch := describe_latch(sample):
            return latch
        if sample["refused"]:
            return f"the rig refused a command: {sample['refused'][0]}"
        return ""

    def _exchange(self, k: int, point: float) -> Mapping[str, Any] | None:
        """Send the commands of row `k`, and store the sample that answers them.

        Returns
        -------
        Mapping of str to object or None
            The sample; None if none came in time. One that tells of a latch or of a refused command
            ends the run, and is not stored.
        """
        interval = self._plan.interval
        commands = self._commands[min(k, len(self._commands) - 1)]
        wait = max(_LEAST_WAIT, _WAITING * interval)
        sample = self._link.exchange(commands, point, interval, wait)
        if sample is not None and (describe_latch(sample) or sample["refused"]):
            return sample
        previous = self._row
        if previous is not None and previous.k != k:
            # the first answer to new commands was measured under the previous ones
            self._offer(previous, sample)
            self._finish(previous)
            if commands != previous.commands:
                self._since = inf  # no sample has come yet since the rig has these commands
        if previous is None or previous.k != k:
            self._row = self._begin(k, commands)
        if self._row is not None:
            # of a new row, this notes when the rig accepted it; values must be measured later
            self._offer(self._row, sample)
        return sample

    def _offer(self, row: _Row, sample: Mapping[str, Any] | None) -> None:
        """Complete a row with a sample, if there is one, and note it as the newest."""
        if sample is not None:
            row.offer(sample, self._plan.max_age)
            self._newest = sample
            self._since = min(self._since, sample["clock"])

    def _begin(self, k: int, commands: list[float]) -> _Row | None:
        """Return a new row, after rows without values for those skipped; None after the last."""
        outputs = len(self._plan.outputs)
        while len(self.rows) < min(k, len(self._commands)):  # rows that were skipped
            self._finish(_Row(len(self.rows), commands, outputs))
        if k >= len(self._commands):
            return None
        self._observer.look(self._moment(k))
        return _Row(k, commands, outputs)

    def _moment(self, k: int) -> Moment:
        """Describe the present, at the beginning of a row."""
        link = {"round_trip_time": self._link.round_trip_time}
        if self._newest is not None:
            for name, age in zip(self._plan.outputs, self._newest["ages"], strict=True):
                link[f"{name}_age"] = nan if age is None else age
        time = self._plan.time
        missed = self._missed + self._skipped
        return Moment(time[k], time[-1], self._lag, missed, link, self._observer.trouble())

    def _finish(self, row: _Row) -> None:
        """Append a row to the record, completed with the newest sample.

        A value that was measured under the same commands before the row was accepted is as good.
        """
        if self._newest is not None and row.accepted is not None:
            row.offer(self._newest, self._plan.max_age, self._since)
        self.rows.append(row.cells())
        self._observer.add(float(self._plan.time[row.k]), self.rows[-1])

    def _watch(self, number: int, values: Sequence[float], lag: float, missed: int) -> None:
        """Store the lag of this exchange and the number of missed ones; the pacer calls it."""
        self._lag = lag
        self._missed = missed

    def pacing(self) -> Pacing:
        """Return statistics of the timing of exchanges; skipped exchanges count as missed."""
        kept = self._pacer.statistics()
        return replace(
            kept, deadlines=kept.deadlines + self._skipped, missed=kept.missed + self._skipped
        )
