"""The Python build of a proxy: an FMU instance over its memory, and a link to the rig.

A step sends the commands, waits on the rig's clock for its own end, and takes the values of then.
So the values are those of the communication point that the master reads them at, whatever master it
is. All waits together stay below ``communication_timeout``.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from ..kit import Component, UserError, describe_error
from .link import FAREWELL, Link, LinkError
from .protocol import LOCKSTEP, SAFE
from .proxy import AGE, CONNECTED, FAIL, HOLD, LOST, REFUSED, STALE

_TEXT_SIZE = 512  # bytes, of fmi2/engine.h
_START_TIME = 1  # among the internals, of fmi2/engine.h
# share of the rig's watchdog time after which held commands are sent again during a long step
_AWAKE = 0.25
_ROUNDING = 1e-6  # s


class ProxySlave:
    """One instance of a proxy.

    Parameters
    ----------
    cls : type[Component]
        The proxy.
    memory : memoryview
        Doubles in the order of :class:`fmus.kit.layout.Layout`, then the internals
        (``fmi2/engine.h``).
    texts : memoryview
        Text parameters, 512 bytes each.
    """

    def __init__(self, cls: type[Component], memory: Any, texts: Any):
        self._cls, self._memory, self._texts = cls, memory, texts
        layout = cls.layout
        self._at = {name: index for index, name in enumerate(layout.names)}
        outputs = [o for o in layout.outputs if AGE.format(o.name) in self._at]
        self._inputs = {v.name: v.unit for v in layout.inputs}
        self._outputs = {v.name: v.unit for v in outputs}
        self._first_input = len(layout.parameters)
        self._internals = len(layout.names)
        self._link: Link | None = None
        self._warning: str | None = None
        self._rig: Mapping[str, Any] = {}  # what it said when it accepted the session
        self._begin: float | None = (
            None  # our clock at the start of the simulation; it runs from the first step on
        )
        self._start = self._heard = (
            0.0  # simulation time at the start; our clock at the last answer
        )
        self._taken = [0.0] * len(
            outputs
        )  # our clock when each value was taken, at the latest that it can have been

    def initialize(self) -> str | None:
        """Connect to the rig; a message means that it cannot be used."""
        try:
            self.terminate()
            self._check_parameters()
            keys = self._text("credentials")
            self._link = Link(
                self._text("endpoint"),
                self._inputs,
                self._outputs,
                Path(keys) if keys else None,
                self._cls.name,
            )
            self._start = self._memory[self._internals + _START_TIME]
            self._connect(self._start, self._value("communication_timeout"))
            self._begin = None
            missing = [
                name
                for name, value in zip(self._outputs, self._rig["values"], strict=True)
                if value is None
            ]
            if missing:
                raise UserError(f"the rig has no value of {missing[0]}")
            self._set("missed_deadlines", 0.0)
            self._look(CONNECTED)
        except BaseException as error:
            self._drop()
            return describe_error(error)
        return None

    def evaluate(self, time: float) -> str | None:
        """Leave the outputs as the last step has left them."""
        return None

    def differentiate(self, time: float) -> str | None:
        """There are no states."""
        return None

    def advance(self, time: float, step: float) -> str | None:
        """Command the rig for a step, and measure at its end.

        Parameters
        ----------
        time, step : float
            In s.

        Returns
        -------
        str or None
            Message of an error.
        """
        timeout = self._value("communication_timeout")
        last = monotonic() + timeout
        try:
            self._warning = None
            if self._link is None:
                raise UserError("there is no link to the rig")
            if step > timeout:
                raise UserError(
                    f"a step of {step:g} s is longer than communication_timeout, {timeout:g} s"
                )
            if not self._link.session:
                self._again(time)
            self._look(self._make(time, step, last))
        except BaseException as error:
            text = describe_error(error)
            self._end(last - monotonic())  # a rig that nobody steers any more is to be at zero
            return text
        return None

    def warning(self) -> str | None:
        """Say what is to be told of the last step."""
        return self._warning

    def terminate(self) -> None:
        """End the session in order."""
        self._end(FAREWELL)

    def close(self) -> None:
        """Let go of the link and of the memory before the front-end frees it."""
        try:
            self.terminate()
        finally:
            self._memory.release()

    # --- one step
    # ----------------------------------------------------------------------------------------------

    def _make(self, time: float, step: float, last: float) -> int:
        """Make one step, which ends before a time of our clock; return the state of the link."""
        assert self._link is not None
        lockstep = self._rig["mode"] == LOCKSTEP
        timeout, deadline = self._value("communication_timeout"), self._value("deadline")
        if (
            self._begin is None
        ):  # what a master does between initialization and its first step takes no time of the rig
            self._begin = monotonic() - (time - self._start)
        due = -inf if lockstep else self._begin + (time + step - self._start)
        if late := self._link.late():
            self._take(late)
        wait = self._rig["watchdog"] * _AWAKE
        while True:
            sent = monotonic()
            ends = sent >= due - _ROUNDING
            until = last if lockstep else min(sent + deadline, last if ends else due)
            answer = self._exchange(time, step, until - sent)
            if answer is not None:
                self._take(answer)
            if ends:
                break
            sleep(max(0.0, min(due - monotonic(), wait)))
        if answer is None:
            if lockstep:
                raise LinkError(
                    f"no answer within {timeout:g} s: the rig's time and ours are apart"
                )
            self._set("missed_deadlines", self._value("missed_deadlines") + 1.0)
            return LOST if monotonic() - self._heard > timeout else CONNECTED
        return REFUSED if answer["refused"] else CONNECTED

    def _exchange(self, time: float, step: float, timeout: float) -> Mapping[str, Any] | None:
        """Exchange once; without a session there is no answer until the link is made again."""
        assert self._link is not None
        if not self._link.session:
            return None
        first = self._first_input
        values = self._memory[first : first + len(self._inputs)].tolist()
        try:
            return self._link.exchange(values, time, step, timeout)
        except LinkError:
            if self._text("on_stale") == FAIL:
                raise
            return None

    def _take(self, sample: Mapping[str, Any]) -> None:
        """Take the values of a sample; one that is missing is held and goes on growing older.

        Raises
        ------
        UserError
            If the rig is in its safe state.
        """
        assert self._link is not None
        self._heard = now = monotonic()
        trip = self._link.round_trip_time
        for index, (name, value, age) in enumerate(
            zip(self._outputs, sample["values"], sample["ages"], strict=True)
        ):
            if value is not None and age is not None:
                self._set(name, float(value))
                self._taken[index] = now - age - trip
        self._set("round_trip_time", trip)
        if sample.get("state") == SAFE:
            raise UserError(f"the rig is in its safe state: {sample['reason']}")
        if (
            sample.get("refused") and self._value("link_state") != REFUSED
        ):  # told once, when it begins
            self._warning = f"refused by the rig: {sample['refused'][0]}"

    def _look(self, state: int) -> None:
        """Bring ages and the state of the link up to date.

        Raises
        ------
        UserError
            If a value is too old, or the link is lost, and the FMU is to fail then.
        """
        now, oldest, limit, fails = (
            monotonic(),
            0.0,
            self._value("max_age"),
            self._text("on_stale") == FAIL,
        )
        for name, taken in zip(self._outputs, self._taken, strict=True):
            age = max(0.0, now - taken)
            self._set(AGE.format(name), age)
            oldest = max(oldest, age)
            if age > limit and fails:
                raise UserError(f"{name} is {age:.3g} s old; max_age is {limit:g} s")
        if state == LOST and fails:
            raise UserError(f"no answer from the rig for {now - self._heard:.3g} s")
        self._set("link_state", float(max(state, STALE) if oldest > limit else state))
        if state == LOST:
            assert self._link is not None
            self._link.accepted = {}  # connect anew with the next step

    # --- the link
    # ----------------------------------------------------------------------------------------------

    def _connect(self, time: float, timeout: float) -> None:
        assert self._link is not None
        sent = monotonic()
        accepted = self._link.connect(time, timeout)
        self._link.round_trip_time = monotonic() - sent
        self._rig = accepted
        self._take({**accepted, "state": "", "refused": []})

    def _again(self, time: float) -> None:
        """Try once to connect anew."""
        try:
            self._connect(time, self._value("deadline"))
        except LinkError as error:
            if self._value("link_state") != LOST:
                self._warning = str(error)
        else:
            self._begin = None  # nobody shall race to make up for the time without a link

    def _end(self, longest: float) -> None:
        """End the session in order, and wait no longer than that (s) for the rig to say so."""
        if self._link is not None:
            try:
                self._link.disconnect(max(0.0, min(longest, FAREWELL)))
            finally:
                self._drop()

    def _drop(self) -> None:
        if self._link is not None:
            self._link.close()
            self._link = None

    # --- memory
    # ----------------------------------------------------------------------------------------------

    def _check_parameters(self) -> None:
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
        return float(self._memory[self._at[name]])

    def _set(self, name: str, value: float) -> None:
        self._memory[self._at[name]] = value

    def _text(self, name: str) -> str:
        place = [text.name for text in self._cls.layout.texts].index(name)
        held = bytes(self._texts[place * _TEXT_SIZE : (place + 1) * _TEXT_SIZE])
        return held.partition(b"\0")[0].decode(errors="replace")
