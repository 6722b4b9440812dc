"""Device process of the server: a loop around the backend that goes safe by itself.

It takes the newest command from the shared memory, writes it, reads, and publishes the sample
there, at fixed times. When the newest command is too old, a measured value is beyond its limit, the
backend raises, or front or guard show no sign of life, it brings the rig to its safe state and
publishes the reason. A backend that raised is not used any more: the process ends, and another one
opens the backend when an operator acknowledges.
"""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Sequence
from math import isfinite, isnan
from multiprocessing import parent_process
from multiprocessing.connection import wait
from time import monotonic, sleep
from typing import Any

from fmus.kit import files
from orchestration.rig.backends import Backend, device_names, open_backend
from orchestration.rig.safety import MeasurementMonitor, SlewLimiter, beyond, expired
from orchestration.rig.server.calls import (
    BackendError,
    BackendSignals,
    call,
    leave,
    measure,
    read_back,
)
from orchestration.rig.server.processes import Output, Reserve, detach
from orchestration.rig.server.safe_state import SafeState
from orchestration.rig.server.scheduling import (
    DEVICE,
    Collector,
    Deadlines,
    Suspension,
    prefer,
    prefer_to_others,
)
from orchestration.rig.server.settings import BUSY, ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    REST,
    RUN,
    Alarm,
    Beat,
    Command,
    Sample,
    SharedMemory,
    Trip,
    pack,
    unpack,
    write_text,
)
from orchestration.rig.stuck import StuckMonitor

# s: while the device waits for its deadline it looks this often whether it is to go safe or to end
_LOOK = 0.01
_HALF_BEAT = 0.02  # s, at least, between two changes of the heartbeat
_ALARM = 0.1  # s for which an alarm is there for the front, before the next one
SLEEP = "sleep"  # an activity of the device apart from calls of the backend
ENDED = "ended"
_END = Command(END)  # the order that holds when none can be read, which does not happen


def main(settings: ServerSettings, memory: Any, output: Output) -> None:
    """Run the device process of the rig server.

    Parameters
    ----------
    settings : ServerSettings
    memory : ctypes array
        Shared with the front process and the guard.
    output : Output
        Of the front, for what the backend prints.
    """
    detach()
    output.redirect()
    files.keep(settings.files)
    device = Device(settings, SharedMemory(memory))
    if hasattr(signal, "SIGTERM"):
        signal.signal(signal.SIGTERM, device.end)
    device.run(prefer(settings.priority, settings.cpu))
    leave(0)


def longest_sleep(watchdog: float) -> float:
    """Return the longest time in s for which the device may sleep without a sign of life.

    Parameters
    ----------
    watchdog : float
        Watchdog time in s.
    """
    # a quarter, well below `ServerSettings.silence`, after which the guard takes over, so that a
    # process that wakes late does not count as hung
    return min(_LOOK, watchdog / 4)


class Device:
    """A backend that is driven in real time from the shared memory.

    Parameters
    ----------
    settings : ServerSettings
    shared : SharedMemory
    """

    def __init__(self, settings: ServerSettings, shared: SharedMemory) -> None:
        self._settings = settings
        self._shared = shared
        self._ending = False
        self._opened = False
        self._backend: Any = None
        self._safe_state: SafeState | None = None  # of the backend, once it is open
        self._is_at_rest = False  # what was written last are safe values
        self._rested = 0  # number of the newest order to rest that was carried out
        self._lost = ""  # why nobody can watch over this process
        self._suspension = Suspension()
        self._slew = SlewLimiter((), {}, 0.0)
        self._acknowledgements_at_trip: int | None = None  # None while it has not tripped
        self._applied: tuple[float, ...] = ()
        self._number = 0
        self._level = False  # of the heartbeat
        self._toggled = 0.0  # when it changed, s
        self._alarms: deque[tuple[str, str]] = deque()  # signal and sentence, not published yet
        self._alarmed = 0.0  # when the last one was published, s
        self._looked = 0.0
        self._look = longest_sleep(settings.watchdog)
        self._reserve = Reserve()

    def end(self, *_: object) -> None:
        """End the loop, with the rig in its safe state."""
        self._ending = True

    def run(self, notes: Sequence[str] = ()) -> None:
        """Open the backend, serve it until it is to end, and leave the rig in its safe state.

        Parameters
        ----------
        notes : sequence of str
            Further remarks for the user who started the server.
        """
        try:
            self._open(notes)
            prefer_to_others(self._settings.priority or DEVICE)
            self._loop()
            self._rest_for_good()
            self._call("close()", self._backend.close)
        except Exception as error:  # such as MemoryError: whatever it is, the rig goes safe
            self._fail(str(error) if isinstance(error, BackendError) else repr(error))
        self._show(ENDED)

    def _open(self, notes: Sequence[str]) -> None:
        """Open the backend, bring the rig to its safe state, and publish the first sample."""
        settings = self._settings
        begun = monotonic()
        self._backend = self._call("opening", open_backend, settings.backend, settings.options)
        self._has_heartbeat = type(self._backend).heartbeat is not Backend.heartbeat
        self._call("safe()", self._backend.safe)
        first = self._shared.description.read()
        self._signals = BackendSignals.from_backend(self._backend)
        if first is not None:
            self._signals = self._signals.same_as(BackendSignals.from_record(first))
        elif device_names(settings.backend, settings.options):  # else nothing real is commanded
            self._signals.check_real()
            reported = read_back(self._backend, self._signals)
            pairs = zip(self._signals.inputs, reported, strict=True)
            self._signals.unreported.extend(name for name, value in pairs if isnan(value))
        self._signals.notes.extend(notes)
        self._slew = SlewLimiter(
            self._signals.inputs, self._signals.limits, monotonic(), self._signals.safe_values
        )
        self._applied = self._signals.safe_values
        self._safe_state = SafeState(self._backend, self._signals, self._show)
        self._rest_for_good()
        self._rest(self._command())
        opening = monotonic() - begun
        self._stuck = StuckMonitor(
            (self._signals.inputs, self._signals.outputs),
            self._signals.limits,
            settings.stuck_after,
        )
        self._monitor = MeasurementMonitor(
            self._signals.outputs, self._signals.limits, settings.watchdog
        )
        self._values = [0.0] * len(self._signals.outputs)
        self._taken = [0.0] * len(self._signals.outputs)
        self._deadlines = Deadlines(settings.period, monotonic())
        if first is None:
            description = self._signals.to_record()
            self._shared.description.write(description._replace(opening=opening))
        self._tick(self._command())
        self._opened = True

    def _loop(self) -> None:
        collector = Collector()
        while (command := self._wait()).order != END:
            self._tick(command)
            collector.collect(monotonic())

    def _wait(self) -> Command:
        """Sleep until the next deadline, and return the newest command.

        The sleep ends earlier if the command expires, the rig is to rest or the process is to end.
        """
        self._deadlines.advance(monotonic())
        while True:
            command = self._command()
            now = monotonic()
            until = self._deadlines.next
            tripped = self._acknowledgements_at_trip == command.acknowledged
            running = command.order == RUN and not tripped
            if running:
                until = min(until, command.accepted + self._settings.watchdog)
            is_to_rest = not running and self._is_to_rest(command)
            if command.order == END or now >= until or is_to_rest or (running and self._lost):
                return command
            if not running:
                self._rest(command)
            self._beat(SLEEP, now)
            sleep(min(until - now, self._look))

    def _command(self) -> Command:
        """Return the newest command, or the order to end."""
        now = monotonic()
        # looking takes some 20 microseconds, which a thousand periods a second cannot spare
        if now - self._looked > _LOOK:
            self._looked = now
            self._watch_others(now)
        if self._ending:
            return _END
        return self._shared.command.read() or _END

    def _watch_others(self, now: float) -> None:
        """Look for an end of the guard, a silent front or guard, and a suspend of the computer."""
        parent = parent_process()
        watch = self._shared.watch.read()
        front = self._shared.front.read()
        guard_is_gone = parent is not None and wait([parent.sentinel], 0)
        if guard_is_gone or (watch is not None and watch.ending):
            self._ending = True
        suspended = self._suspension.since()
        self._lost = ""
        if suspended > self._settings.silence:
            self._lost = f"this computer was suspended for {suspended:.3g} s"
        for who, sign in (("guard", watch), ("front", front)):
            if sign is not None and now - sign.time > self._settings.silence:
                silent = now - sign.time
                self._lost = f"the server's {who} shows no sign of life for {silent:.3g} s; {BUSY}"

    def _tick(self, command: Command) -> None:
        """Command, measure and publish."""
        # a trip lasts until the next acknowledgement
        if self._acknowledgements_at_trip != command.acknowledged:
            self._acknowledgements_at_trip = None
        if command.order != RUN or self._acknowledgements_at_trip is not None:
            self._rest(command)
        elif expired(command.accepted, monotonic(), self._settings.watchdog):
            late = f"no fresh command for {self._settings.watchdog:g} s; {BUSY}"
            self._trip(command, late)
        elif self._lost:
            self._trip(command, self._lost)
        else:
            self._write(command, unpack(command.values, len(self._applied)))
        now = monotonic()
        self._beat("read()", now)
        measured = measure(self._backend, self._signals)
        reason = self._monitor.check(measured, now)
        if reason and self._acknowledgements_at_trip is None:
            self._trip(command, reason)
        reported = read_back(self._backend, self._signals)
        if self._safe_state is not None and self._is_at_rest:
            self._tell_of_safe_state(self._safe_state.judge(reported))
        self._alarms.extend(self._stuck.check(self._applied, reported, measured))
        if self._alarms and now - self._alarmed > _ALARM:
            self._alarmed = now
            source, sentence = self._alarms.popleft()
            self._shared.alarm.write(Alarm(now, write_text(source), write_text(sentence)))
        self._publish(measured, reported, now)
        if self._has_heartbeat and now - self._toggled >= _HALF_BEAT and self._is_sure(now):
            self._toggled = now
            self._level = not self._level
            self._call("heartbeat()", self._backend.heartbeat, self._level)

    def _is_sure(self, now: float) -> bool:
        """Return True if all processes are heard, and the safe state is not denied."""
        standby = self._shared.standby.read()
        is_watched = standby is not None and now - standby.time <= self._settings.silence
        is_denied = self._safe_state is not None and self._safe_state.is_denied
        return is_watched and not (self._lost or is_denied)

    def _write(self, command: Command, values: tuple[float, ...]) -> None:
        """Write values (inputs,), SI, as far as limits of their rates allow; go safe beyond others.

        The front has refused what is beyond a limit: if such a value is here, the front is broken.
        """
        excess = beyond(self._signals.inputs, self._signals.limits, values)
        if excess:
            self._trip(command, f"a command has passed the limits of the front: {excess}")
            return
        self._is_at_rest = False
        if self._safe_state is not None:
            self._safe_state.leave()
        applied = self._slew.towards(values, monotonic())
        commands = dict(zip(self._signals.inputs, applied, strict=True))
        self._call("write()", self._backend.write, commands)
        self._applied = applied

    def _is_to_rest(self, command: Command) -> bool:
        """Return True if safe values are to be written, unless only to be kept."""
        is_ordered = command.order == REST and command.number > self._rested
        return is_ordered or not self._is_at_rest

    def _rest(self, command: Command) -> None:
        """Bring the rig to its safe state, again at every order, or keep it there."""
        if self._safe_state is None:
            return
        if self._is_to_rest(command):
            trouble = self._safe_state.command()
            self._is_at_rest = True
            self._applied = self._signals.safe_values
            if command.order == REST:
                self._rested = command.number
        else:
            trouble = self._safe_state.keep()
        self._slew.rest(monotonic())
        self._tell_of_safe_state(trouble)

    def _rest_for_good(self) -> None:
        """Bring the rig to its safe state and wait until the device reports that.

        Raises
        ------
        BackendError
            If it does not.
        """
        state = self._safe_state
        if state is None:
            return
        trouble = state.command()
        while not state.since:
            if state.is_denied:
                raise BackendError(trouble)
            sleep(self._look)
            trouble = state.keep()

    def _tell_of_safe_state(self, trouble: str) -> None:
        """Publish what the device reports in its safe state, if it is something else."""
        if trouble:
            self._report(trouble, reached=False, ended=False)

    def _trip(self, command: Command, reason: str) -> None:
        """Go safe by itself, and stay safe until the next acknowledgement."""
        self._acknowledgements_at_trip = command.acknowledged
        try:
            self._rest(command)
        except BackendError as error:
            raise BackendError(f"{reason}; {error}") from error
        self._report(reason, reached=True, ended=False)

    def _fail(self, reason: str) -> None:
        """Go safe with a backend that raised, if that is still possible; else the guard has to."""
        self._reserve.release()
        failures = [reason]
        is_safe = False
        if self._backend is not None:
            try:
                self._call("safe()", self._backend.safe)
                self._rest_for_good()
                is_safe = True
                self._call("close()", self._backend.close)
            except Exception as error:
                failures.append(str(error) if isinstance(error, BackendError) else repr(error))
        self._report("; ".join(filter(None, failures)), reached=is_safe, ended=True)

    def _report(self, reason: str, *, reached: bool, ended: bool) -> None:
        """Publish the reason for going to the safe state, and whether the rig reached it."""
        self._shared.trip.write(Trip(monotonic(), reached, ended, write_text(reason)))

    def _publish(self, measured: dict[str, float], reported: list[float], now: float) -> None:
        for k, value in enumerate(measured.values()):
            if isfinite(value):
                self._values[k] = value
                self._taken[k] = now
        self._number += 1
        packed = map(pack, (self._applied, reported, self._values, self._taken))
        applied, back, values, taken = packed
        about = (self._number, now, self._deadlines.missed)
        sample = Sample(*about, applied, back, values, taken, os.getpid(), self._rested)
        self._shared.sample.write(sample)
        self._shared.samples.write(sample)

    def _call(self, name: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call the backend after a sign of life that names the call."""
        self._show(name)
        return call(name, function, *arguments)

    def _show(self, action: str) -> None:
        """Show a sign of life with the next action."""
        self._beat(action, monotonic())

    def _beat(self, action: str, now: float) -> None:
        safe, denied = 0.0, False
        if self._safe_state is not None:
            safe, denied = self._safe_state.since, self._safe_state.is_denied
        beat = Beat(now, os.getpid(), self._opened, safe, action.encode(), denied, self._rested)
        self._shared.beat.write(beat)
