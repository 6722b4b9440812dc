"""The Python build of a proxy: an FMU instance over its memory, and a link to the rig.

A step sends the commands, waits until its end on the rig's clock, and takes the values measured
then. So any master reads the values of its communication point. All waits together stay below
``communication_timeout``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from secrets import token_hex
from time import monotonic, sleep
from typing import Any

from ..kit import Component, UserError
from ..kit.slave import describe_error
from .link import FAREWELL, NEVER, Link, LinkError, describe_latch
from .protocol import LOCKSTEP
from .proxy import AGE, CONNECTED, FAIL, HOLD, LOST, REFUSED, STALE

_TEXT_SIZE = 512  # bytes, of fmi/engine.h
_START_TIME_INDEX = 1  # among the internals, of fmi/engine.h
# share of the rig's watchdog time after which the commands of a long step are sent again
_RESEND_SHARE = 0.25
_ROUNDING = 1e-6  # s before the end of a step that count as its end


class ProxySlave:
    """One instance of a proxy.

    Parameters
    ----------
    cls : type[Component]
        The proxy.
    memory : memoryview
        Doubles in the order of :class:`fmus.kit.layout.Layout`, then the internals
        (``fmi/engine.h``).
    texts : memoryview
        Text parameters, 512 bytes each.
    """

    def __init__(self, cls: type[Component], memory: Any, texts: Any):
        self._cls, self._memory, self._texts = cls, memory, texts
        layout = cls.layout
        self._index = {name: index for index, name in enumerate(layout.names)}
        outputs = [o for o in layout.outputs if AGE.format(o.name) in self._index]
        self._inputs = {v.name: v.unit for v in layout.inputs}
        self._outputs = {v.name: v.unit for v in outputs}
        self._first_input = len(layout.parameters)
        self._internals = len(layout.names)
        self._instance = token_hex(8)
        self._link: Link | None = None
        self._warning: str | None = None
        self._accepted: Mapping[str, Any] = {}  # message with which the rig accepted the session
        self._start_time = 0.0  # simulation time at the start
        # Our clock at the start time, from the first step on; delays move it, see `_due`.
        self._clock_at_start: float | None = None
        self._reset()

    def _reset(self) -> None:
        """Reset the values, ages and counters of an earlier run."""
        self._values = dict.fromkeys(self._outputs, 0.0)
        # for each value the earliest time of our clock at which it can have been measured
        self._measured_at = dict.fromkeys(self._outputs, NEVER)
        self._missed = 0
        self._refusing = False

    def initialize(self) -> str | None:
        """Connect to the rig; return an error message if it cannot be used."""
        try:
            self.terminate()
            self._reset()
            self._check_parameters()
            keys = self._text("credentials")
            self._link = link = Link(
                self._text("endpoint"),
                self._inputs,
                self._outputs,
                Path(keys) if keys else None,
                self._cls.name,
                self._instance,
            )
            self._start_time = self._memory[self._internals + _START_TIME_INDEX]
            self._clock_at_start = None
            self._accepted = link.connect(self._start_time, self._value("communication_timeout"))
            self._store_sample(self._accepted)
            missing = [name for name, instant in self._measured_at.items() if instant == NEVER]
            if missing:
                raise UserError(f"the rig has no value of {missing[0]}")
            self._publish()
        except BaseException as error:
            self.terminate()
            return describe_error(error)
        return None

    def evaluate(self, time: float) -> str | None:
        """Write the measured values and their present ages."""
        self._write_outputs()
        return None

    def differentiate(self, time: float) -> str | None:
        """Do nothing: a proxy has no states."""
        return None

    def advance(self, time: float, step: float) -> str | None:
        """Command the rig for a step, and take the values measured at its end.

        Parameters
        ----------
        time, step : float
            Start and length of the step, s.

        Returns
        -------
        str or None
            Error message; None if the step succeeded.
        """
        timeout = self._value("communication_timeout")
        last = monotonic() + timeout
        try:
            self._warning = None
            if self._link is None or not self._link.is_open:
                raise UserError("there is no link to the rig")
            if step > timeout:
                raise UserError(
                    f"a step of {step:g} s is longer than communication_timeout, {timeout:g} s"
                )
            self._make_step(self._link, time, step, last)
            self._publish()
        except BaseException as error:
            text = describe_error(error)
            self._disconnect(last - monotonic())  # a rig without a client must go to zero
            return text
        return None

    def warning(self) -> str | None:
        """Return the warning of the last step, if any."""
        return self._warning

    def terminate(self) -> None:
        """End the session in order."""
        self._disconnect(FAREWELL)

    def close(self) -> None:
        """Close the link and release the memory before the front-end frees it."""
        try:
            self.terminate()
        finally:
            self._memory.release()

    def _disconnect(self, longest: float) -> None:
        """End the session in order; wait at most ``longest`` s for the rig to confirm it."""
        if self._link is not None:
            try:
                self._link.disconnect(max(0.0, min(longest, FAREWELL)))
            finally:
                self._link.close()

    # --- one step
    # ----------------------------------------------------------------------------------------------

    def _make_step(self, link: Link, time: float, step: float, last: float) -> None:
        """Make one step, which ends before the time ``last`` of our clock.

        Raises
        ------
        LinkError
            If a rig in lockstep does not answer.
        """
        self._refusing = False
        self._receive(link.late)
        if self._accepted["mode"] == LOCKSTEP:
            if not self._exchange(link, time, step, last - monotonic()):
                timeout = self._value("communication_timeout")
                raise LinkError(
                    f"no answer within {timeout:g} s: the rig's time and ours are apart"
                )
        elif not self._exchange_until_end(link, time, step, last):
            self._missed += 1

    def _exchange_until_end(self, link: Link, time: float, step: float, last: float) -> bool:
        """Exchange until the end of the step; return whether the last exchange was answered.

        The last exchange is the one at the end of the step, which brings the values measured then.
        Earlier ones command the rig during the step, often enough for its watchdog.
        """
        due = self._due(time - self._start_time, step)
        deadline = self._value("deadline")
        resend_interval = self._accepted["watchdog"] * _RESEND_SHARE
        while True:
            sent = monotonic()
            is_last = sent >= due - _ROUNDING
            until = min(sent + deadline, last if is_last else due)
            answered = self._exchange(link, time, step, until - sent)
            if not answered:
                self._receive(link.late)
            if is_last:
                return answered
            sleep(max(0.0, min(due - monotonic(), resend_interval)))

    def _due(self, begin: float, step: float) -> float:
        """Return the time of ``monotonic`` at which a step ends that begins at ``begin``.

        Parameters
        ----------
        begin : float
            Time from the start of the simulation in s.
        step : float
            Size of the step in s.
        """
        now = monotonic()
        if self._clock_at_start is None:
            self._clock_at_start = now - begin
        # A step that begins late is shortened by at most its own size, and a longer delay shifts
        # all later steps: were it made up for by steps without a wait, simulation time would run
        # faster than the rig, and a loop over it could diverge. The size of a step is the delay
        # that another proxy of the same master causes, as it waits for its end of the step first.
        self._clock_at_start = max(self._clock_at_start, now - begin - step)
        return self._clock_at_start + begin + step

    def _exchange(self, link: Link, time: float, step: float, timeout: float) -> bool:
        """Exchange once, unless the session is over; return whether an answer came."""
        if not link.session:
            return False
        first = self._first_input
        values = self._memory[first : first + len(self._inputs)].tolist()
        return self._receive(partial(link.exchange, values, time, step, timeout))

    def _receive(self, answer: Callable[[], Mapping[str, Any] | None]) -> bool:
        """Store the sample that a function returns; return whether it returned one.

        Parameters
        ----------
        answer : callable
            Returns a sample, or None without an answer.

        Raises
        ------
        LinkError
            If the rig has ended the session and the FMU must fail then.
        """
        try:
            sample = answer()
        except LinkError as error:
            if self._text("on_stale") == FAIL or self._accepted["mode"] == LOCKSTEP:
                raise
            self._warning = str(error)
            return False
        if sample is not None:
            self._store_sample(sample)
        return sample is not None

    def _store_sample(self, sample: Mapping[str, Any]) -> None:
        """Store the values of a sample; one that is missing in it keeps its value and grows older.

        Raises
        ------
        UserError
            If the rig is latched.
        """
        assert self._link is not None
        # An age is counted from the answer at the rig, which is not before our request was sent.
        sent = self._link.last_answer - self._link.trip
        for name, value, age in zip(self._outputs, sample["values"], sample["ages"], strict=True):
            if value is not None and age is not None:
                self._values[name] = float(value)
                self._measured_at[name] = sent - max(0.0, age)
        if latch := describe_latch(sample):
            raise UserError(latch)
        refused = sample.get("refused")
        self._refusing = bool(refused)
        if refused and self._value("link_state") != REFUSED:  # a new refusal, reported once
            self._warning = f"refused by the rig: {refused[0]}"

    # --- outputs
    # ----------------------------------------------------------------------------------------------

    def _write_outputs(self) -> None:
        """Write the values, their present ages and the state of the link."""
        now = monotonic()
        for name, value in self._values.items():
            self._set(name, value)
            self._set(AGE.format(name), now - self._measured_at[name])
        trip = now - NEVER if self._link is None else self._link.round_trip_time
        self._set("round_trip_time", trip)
        self._set("missed_deadlines", self._missed)
        self._set("link_state", self._link_state(now))

    def _publish(self) -> None:
        """Write the outputs at the end of a step.

        Raises
        ------
        UserError
            If a value is too old or the link is lost, and the FMU must fail then.
        """
        self._write_outputs()
        if self._text("on_stale") != FAIL:
            return
        now = monotonic()
        oldest = min(self._measured_at, key=self._measured_at.__getitem__)
        age = now - self._measured_at[oldest]
        limit = self._value("max_age")
        if age > limit:
            raise UserError(f"{oldest} is {age:.3g} s old; max_age is {limit:g} s")
        if self._is_lost(now):
            assert self._link is not None
            raise UserError(f"no answer from the rig for {now - self._link.last_answer:.3g} s")

    def _is_lost(self, now: float) -> bool:
        """Return whether the session is over, or the rig has been silent for too long."""
        link = self._link
        if link is None or not link.session:
            return True
        return now - link.last_answer > self._value("communication_timeout")

    def _link_state(self, now: float) -> int:
        """Return the value of the output ``link_state``, the worst of the states that apply."""
        if self._is_lost(now):
            return LOST
        if now - min(self._measured_at.values()) > self._value("max_age"):
            return STALE
        return REFUSED if self._refusing else CONNECTED

    # --- memory
    # ----------------------------------------------------------------------------------------------

    def _check_parameters(self) -> None:
        """Raise UserError if ``on_stale`` or ``deadline`` has a value that is not allowed."""
        if self._text("on_stale") not in (HOLD, FAIL):
            raise UserError(
                f"parameter 'on_stale' = {self._text('on_stale')!r}: must be {HOLD} or {FAIL}"
            )
        if self._value("deadline") > self._value("communication_timeout"):
            raise UserError(
                f"parameter 'deadline' = {self._value('deadline'):g} s is longer than"
                f" communication_timeout, {self._value('communication_timeout'):g} s"
            )

    def _value(self, name: str) -> float:
        return float(self._memory[self._index[name]])

    def _set(self, name: str, value: float) -> None:
        self._memory[self._index[name]] = value

    def _text(self, name: str) -> str:
        place = [text.name for text in self._cls.layout.texts].index(name)
        content = bytes(self._texts[place * _TEXT_SIZE : (place + 1) * _TEXT_SIZE])
        return content.partition(b"\0")[0].decode(errors="replace")
