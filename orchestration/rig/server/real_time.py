"""A rig in real time, as the front sees it: two guard processes and the device process."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from math import isnan
from multiprocessing import get_context
from time import monotonic, sleep
from typing import Any, TypeVar

from fmus.rig_proxy import REAL_TIME
from orchestration.rig.archive import columns_of
from orchestration.rig.server import device, guard
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.processes import Output, undisturbed
from orchestration.rig.server.rig import Notice, RigState, cannot_open
from orchestration.rig.server.scheduling import WAKE_UPS
from orchestration.rig.server.settings import BUSY, ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    HOLDING,
    RESCUING,
    REST,
    RETIRED,
    RUN,
    SERVING,
    Alarm,
    Beat,
    Command,
    Sample,
    SharedMemory,
    SignOfLife,
    Slot,
    Trip,
    Watch,
    new_memory,
    pack,
    read_text,
    unpack,
)
from orchestration.rig.server.standby import longest_attempt, longest_silence

_Values = tuple[float | None, ...]
_Report = TypeVar("_Report", Trip, Alarm)
_LOOK = 0.01  # s
# s between two starts of guards: from the first pause on they are doubled, until all has been calm
_PAUSES = (0.1, 5.0)
_CALM = 10.0  # s without a start of a guard, after which the next is not delayed
_LONGEST_START = 5.0  # s that a process may take to show its first sign of life
_SPARE = 3.0  # s, beyond the time that guard and device may take to end


class RealTimeRig:
    """A backend in a device process, with a guard process on duty and a standby.

    Parameters
    ----------
    settings : ServerSettings
    tell : callable
        Called with what the backend prints, and the kind of such lines.

    Raises
    ------
    UserError
        If the backend cannot be opened, or its signals not be archived; nothing goes on then.

    Attributes
    ----------
    memory : ctypes array
        Shared with the other processes.
    output : Output
        For what they print.
    """

    mode = REAL_TIME

    def __init__(self, settings: ServerSettings, tell: Callable[[str, str], None]) -> None:
        self._settings = settings
        self._tell = tell
        self.output = Output()
        self.watchdog = settings.watchdog
        with undisturbed():
            self.memory = new_memory()
        self._shared = SharedMemory(self.memory)
        self._command = Command()
        self._shared.command.write(self._command)
        self._shared.commands.write(self._command)  # the first one takes some milliseconds
        self._rests = 0  # number of the order to rest whose confirmation counts
        self._seen: dict[str, float] = {}
        self._guards: dict[int, Any] = {}  # processes by number
        self._pause = 0.0  # s between two starts of a guard
        self._changed = 0.0  # when one was started or failed, s
        self._cannot_start = False  # as was reported
        self._is_silent = False  # as was reported of the guard on duty
        self.bound = 0.0
        self.beat()
        trouble = self._start_guard("")
        if trouble:
            raise cannot_open(settings, trouble[0])
        try:
            self.signals = self._wait_until_open()
            if settings.archive is not None:
                columns_of(self.signals.inputs, self.signals.outputs)
        except BaseException:
            self.close()
            self.kill()
            raise

    clock = staticmethod(monotonic)

    def _start_guard(self, rescue: str, *, stands_by: bool = False) -> list[str]:
        """Start a guard process, with arguments of `guard.main`; return why it cannot be.

        There is a pause after each start. What keeps a guard from being started is said once.
        """
        now = monotonic()
        if now - self._changed < self._pause:
            return []
        least, most = _PAUSES
        self._pause = min(max(least, 2 * self._pause), most)
        self._changed = now
        try:
            process = self._start_process(rescue, stands_by)
        except Exception as error:  # no process, memory or descriptor is left
            is_news = not self._cannot_start
            self._cannot_start = True
            return [f"no guard process can be started: {error}"] * is_news
        self._cannot_start = False
        self._guards[process.pid or 0] = process
        return []

    def _start_process(self, rescue: str, stands_by: bool) -> Any:
        arguments = (self._settings, self.memory, self.output, rescue, stands_by)
        name = "standby" if stands_by else "guard"
        process = get_context("spawn").Process(target=guard.main, args=arguments, name=name)
        with undisturbed():
            process.start()
        return process

    def _wait_until_open(self) -> BackendSignals:
        """Wait until the device serves and a standby guard runs; return the signals.

        Raises
        ------
        UserError
            If the backend cannot be opened, or not in time, or all guards have ended.
        """
        until = monotonic() + guard.LONGEST_OPENING + _SPARE
        latest = 0.0  # of all wake-ups, s
        while monotonic() < until:
            # asked first: a guard that ends has reported why before
            is_alive = any(one.is_alive() for one in self._guards.values())
            self.beat()
            self._raise_if_failed()
            if not is_alive:
                raise cannot_open(self._settings, "its guard process ended before it was open")
            signals = self._opened_signals()
            if signals is not None:
                signals.notes.extend(self._warn_of_wake_ups(latest))
                return signals
            due = monotonic() + _LOOK
            sleep(_LOOK)
            latest = max(latest, monotonic() - due)
        raise cannot_open(self._settings, f"it did not open in {guard.LONGEST_OPENING:g} s")

    def _raise_if_failed(self) -> None:
        """Raise UserError if device or guard has reported that the backend cannot be used."""
        for trip in (self._shared.trip.read(), self._shared.rescue.read()):
            if trip is not None and trip.ended:
                raise cannot_open(self._settings, read_text(trip.reason))

    def _opened_signals(self) -> BackendSignals | None:
        """Return the signals once the device serves; start a standby guard if there is none."""
        watch = self._shared.watch.read()
        description = self._shared.description.read()
        if watch is None:
            return None
        self._keep_a_standby(watch)
        has_standby = self._shared.standby.read() is not None
        if watch.at != SERVING or not has_standby or description is None:
            return None
        self.bound = self.watchdog + self._settings.period + description.opening
        return BackendSignals.from_record(description)

    def _warn_of_wake_ups(self, latest: float) -> list[str]:
        """Return a line if processes of this machine wake too late for the watchdog time.

        They sleep for a quarter of it at most, and count as hung after three quarters.
        """
        least = WAKE_UPS * latest
        if self.watchdog >= least:
            return []
        return [
            f"this machine wakes a process up to {1e3 * latest:.3g} ms late: a watchdog below"
            f" {least:.2g} s may trip by itself; give --watchdog more than that, or the"
            " machine less to do"
        ]

    def beat(self) -> None:
        """Show device and guards that the front is alive, and tell what they print."""
        self._shared.front.write(SignOfLife(monotonic(), os.getpid()))
        printed = self.output.read()
        if printed:
            self._tell(f"printed: {printed}", "printed")

    def apply(self, values: Sequence[float], now: float) -> None:
        """Command every input.

        Parameters
        ----------
        values : sequence of float
        now : float
            Time in s at which they were accepted.
        """
        self._order(self._command._replace(order=RUN, accepted=now, values=pack(values)))

    def advance(self, step: float) -> None:
        """Do nothing: time passes by itself."""

    def go_safe(self) -> None:
        """Order the rig to its safe state, whatever it is believed to be in."""
        self._order(self._command._replace(order=REST))

    def safe_since(self) -> float | None:
        """Return since when the rig is confirmed to be in its safe state; None while it is not.

        The process counts that has the backend, once it has carried out the last order to rest, and
        while it shows signs of life; or for good, if this is the last one of the device.
        """
        holder = self._holder()
        if holder is None or not holder.safe or holder.rested < self._rests:
            return None
        is_over = isinstance(holder, Beat) and read_text(holder.call) == device.ENDED
        return holder.safe if is_over or self._hears(holder) else None

    def denial(self) -> str:
        """Return what the device reports in place of its safe values; empty if it does not."""
        holder = self._holder()
        if holder is None or not holder.denied:
            return ""
        report = (self._shared.trip if isinstance(holder, Beat) else self._shared.rescue).read()
        return "" if report is None else read_text(report.reason)

    def _holder(self) -> Beat | Watch | None:
        """Return the newest sign of life of the process that has the backend, device or guard."""
        watch = self._shared.watch.read()
        if watch is not None and watch.at in (RESCUING, HOLDING):
            return watch
        return self._shared.beat.read()

    def _hears(self, holder: Beat | Watch | None) -> bool:
        """Return True if a process has shown a sign of life recently."""
        return holder is not None and monotonic() - holder.time <= self._settings.silence

    def release(self) -> None:
        """Let the device serve again, or another one if it has ended."""
        self._pause = 0.0
        self._order(self._command._replace(order=REST, acknowledged=self._command.acknowledged + 1))
        if not self._guards:
            self._start_guard("")

    def _order(self, command: Command) -> None:
        """Publish a command with the next number.

        Orders to rest that follow each other share a confirmation, so that a flood of them can be
        confirmed at all; the first one after a confirmation waits for its own.
        """
        number = self._command.number + 1
        holder = self._holder()
        is_confirmed = holder is not None and holder.rested >= self._rests
        if command.order == REST and (self._command.order != REST or is_confirmed):
            self._rests = number
        self._command = command._replace(number=number)
        self._shared.command.write(self._command)
        self._shared.commands.write(self._command)

    def opening(self) -> str:
        """Return the reason for which the rig cannot be used.

        It can if its device is open, and has measured every output that has limits since it is in
        the safe state of the release: what is beyond a limit has been reported by then.
        """
        watch = self._shared.watch.read()
        if watch is None or watch.at != SERVING or watch.acknowledged != self._command.acknowledged:
            return "the device is being opened"
        since = self.safe_since()
        sample = self._shared.sample.read()
        if since is None or sample is None or sample.clock < since:
            return "the device has not measured yet"
        taken = unpack(sample.taken, len(self.signals.outputs))
        lacking = [
            name
            for name, time in zip(self.signals.outputs, taken, strict=True)
            if time < since and name in self.signals.limits
        ]
        return f"no finite {', '.join(lacking)} yet, and it has limits" if lacking else ""

    def troubles(self) -> list[str]:
        """Return why the rig went safe by itself since the last call, or failed to."""
        reasons = self._new_reason("device", self._shared.trip) + self._new_reason(
            "guard", self._shared.rescue
        )
        return reasons + self._supervise_guards()

    def alarms(self) -> list[Notice]:
        """Return messages for the operator since the last call."""
        alarm = self._new("alarm", self._shared.alarm)
        return [] if alarm is None else [Notice(read_text(alarm.source), read_text(alarm.reason))]

    def _new_reason(self, who: str, slot: Slot[Trip]) -> list[str]:
        """Return the reason in the newest report, in a list that is empty if it was seen before."""
        report = self._new(who, slot)
        return [] if report is None else [read_text(report.reason)]

    def _new(self, who: str, slot: Slot[_Report]) -> _Report | None:
        """Return the newest report; None if it was seen before."""
        report = slot.read()
        if report is None or report.time == self._seen.get(who):
            return None
        self._seen[who] = report.time
        return report

    def _supervise_guards(self) -> list[str]:
        """Replace guards that have ended, and both if neither shows a sign of life.

        The standby ends a silent guard on duty; the front waits twice as long before it does so
        itself.
        """
        for number, process in list(self._guards.items()):
            if not process.is_alive():
                process.join()
                del self._guards[number]
        watch = self._shared.watch.read()
        if not self._guards or watch is None:
            return self._replace_guards("the guard process has ended")
        silent, longest = self._silence(watch)
        if silent > 2.0 * longest:
            for process in self._guards.values():
                process.kill()
                process.join(_LOOK)
            self._guards = {}
            return self._replace_guards(f"no guard shows a sign of life for {silent:.3g} s")
        was_silent = self._is_silent
        self._is_silent = silent > longest
        if not self._is_silent:
            return self._keep_a_standby(watch)
        if not was_silent:
            return [f"the guard shows no sign of life for {silent:.3g} s; {BUSY}"]
        return []

    def _silence(self, watch: Watch) -> tuple[float, float]:
        """Return the time since the last sign of life of the guard on duty, and its limit, in s.

        A guard that has just started, or that replaces another, has shown no sign of life yet.
        """
        now = monotonic()
        if watch.process in self._guards:
            return now - watch.time, longest_silence(watch.at, self._settings, self._shared)
        return now - self._changed, _LONGEST_START

    def _keep_a_standby(self, watch: Watch) -> list[str]:
        """Start a standby guard if there is none; return why it cannot be."""
        if list(self._guards) == [watch.process]:
            return self._start_guard("", stands_by=True)
        if monotonic() - self._changed > _CALM:
            self._pause = 0.0
        return []

    def _replace_guards(self, reason: str) -> list[str]:
        """Start a guard that brings the rig to its safe state."""
        if self._guards:
            return []
        trouble = self._start_guard(reason)
        return [f"{reason}; another process tries for the safe state"] if self._guards else trouble

    def state(self) -> RigState:
        """Return the newest sample."""
        inputs = len(self.signals.inputs)
        outputs = len(self.signals.outputs)
        sample = self._shared.sample.read()
        if sample is None:
            at_rest = self.signals.safe_values
            nothing = (None,) * inputs
            return RigState(0, at_rest, nothing, (None,) * outputs, (0.0,) * outputs, 0)
        taken = unpack(sample.taken, outputs)
        measured = zip(unpack(sample.values, outputs), taken, strict=True)
        values = tuple(value if time else None for value, time in measured)
        applied, reported = self._inputs_of(sample)
        return RigState(sample.number, applied, reported, values, taken, sample.missed)

    def _inputs_of(self, sample: Sample) -> tuple[_Values, _Values]:
        """Return applied and reported values of the inputs; None where they are unknown.

        They are unknown of a device that is silent or has been replaced since, and while an order
        to rest is the last one that it has not carried out yet. Of one that a command has overtaken
        nobody hears any more.
        """
        inputs = len(self.signals.inputs)
        unknown = (None,) * inputs
        since = self.safe_since()
        if since is not None and since > sample.clock:  # a guard took the device's place
            return self.signals.safe_values, unknown
        beat = self._shared.beat.read()
        is_present = beat is not None and beat.process == sample.process
        is_to_rest = self._command.order == REST and sample.rested < self._rests
        if is_to_rest or not is_present or (since is None and not self._hears(beat)):
            return unknown, unknown
        reported = unpack(sample.read_back, inputs)
        applied: _Values = unpack(sample.applied, inputs)
        return applied, tuple(None if isnan(value) else value for value in reported)

    def close(self) -> str:
        """End device and guards with the rig in its safe state, as soon as it is there."""
        if self._command.order != END:
            self._order(self._command._replace(order=END))
        until = monotonic() + self.watchdog + self._settings.period
        until += longest_attempt(self._shared) + _SPARE
        while monotonic() < until:
            self.beat()
            watch = self._shared.watch.read()
            is_retired = watch is not None and watch.at == RETIRED
            if is_retired and not any(one.is_alive() for one in self._guards.values()):
                return ""
            if not is_retired:
                self._supervise_guards()
            sleep(_LOOK)
        rescue = self._shared.rescue.read()
        if is_retired:
            self.kill()  # they have done what they were there for
            return ""
        return "the guard does not end" if rescue is None else read_text(rescue.reason)

    def kill(self) -> None:
        """End all guards, whether or not the rig is in its safe state."""
        for process in self._guards.values():
            process.kill()
            process.join(1.0)
