"""Guard process of the server: it watches the device process, and replaces one that fails.

When the device hangs, dies or ends, the guard opens the backend itself, and holds the rig in its
safe state until an operator acknowledges: then it starts another device. If the backend fails it
tries again, for ever, and at once when somebody stops the rig. All modules for this are imported
beforehand, so that it takes no longer than the driver. There are two guards: one on duty, and a
standby, which ends the first if that shows no sign of life, and replaces it.
"""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from math import inf
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from time import monotonic, sleep
from typing import Any

from fmus.kit import files
from orchestration.rig.backends import backend_class, open_backend
from orchestration.rig.server import device
from orchestration.rig.server.calls import BackendSignals, call, leave
from orchestration.rig.server.processes import (
    OtherProcess,
    Output,
    Reserve,
    deadline,
    detach,
    undisturbed,
)
from orchestration.rig.server.safe_state import SafeState
from orchestration.rig.server.scheduling import GUARD, ProcessorTime, prefer_to_others
from orchestration.rig.server.settings import BUSY, ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    GONE,
    HOLDING,
    OPENING,
    RESCUING,
    REST,
    RETIRED,
    RUN,
    SERVING,
    Beat,
    Command,
    SharedMemory,
    Trip,
    Watch,
    read_text,
    write_text,
)
from orchestration.rig.server.standby import LONGEST_DYING, Standby, longest_attempt

LONGEST_OPENING = 30.0  # s that a backend may take to open before it is held to hang
# s between two attempts at the safe state; from the first on, pauses are doubled
_PAUSES = (0.2, 2.0)
_STANDBY = 0.5  # s for which a sign of life of the standby guard counts
_ORPHAN = 0.1  # of the watchdog time, that a device gets to go safe when its guard has ended
_GRACE = 0.01  # s, at least, that the device has beyond the watchdog time to go safe by itself


def main(
    settings: ServerSettings, memory: Any, output: Output, rescue: str, stands_by: bool
) -> None:
    """Run the process, until it leaves the rig in its safe state.

    Parameters
    ----------
    settings : ServerSettings
    memory : ctypes array
        Shared with front, device and the other guard.
    output : Output
        Of the front, for what the backend prints.
    rescue : str
        Why the rig has to be brought to its safe state at once; empty to start a device.
    stands_by : bool
        Whether another guard is on duty, and this one waits until it fails.
    """
    detach()
    output.redirect()
    files.keep(settings.files)
    with suppress(Exception):  # the device will report its own fault
        backend_class(settings.backend)
    prefer_to_others(max(GUARD, settings.priority or 0))
    guard = Guard(settings, memory, output)
    if hasattr(signal, "SIGTERM"):
        signal.signal(signal.SIGTERM, guard.end)
    if stands_by:
        fault = guard.stand_by()
        if not fault:
            leave(0)
        rescue = fault
    guard.run(rescue)
    leave(0)


def fault_of(
    beat: Beat,
    command: Command,
    now: float,
    settings: ServerSettings,
    processor: ProcessorTime | None = None,
) -> str:
    """Return the fault of a living device in words, by its last sign of life.

    Parameters
    ----------
    beat : Beat
    command : Command
        The newest.
    now : float
        Present time in s.
    settings : ServerSettings
    processor : ProcessorTime, optional
        Of the device, since that sign of life.

    Returns
    -------
    str
        Empty if nothing is wrong.
    """
    where = read_text(beat.call)
    age = now - beat.time
    if age > settings.silence:
        if where == device.SLEEP:
            return (
                f"the device's process has not run for {age:.3g} s, outside of the driver; {BUSY}"
            )
        if processor is not None and processor.was_withheld(age):
            return f"the machine did not run the device in {age:.3g} s, in {where}; {BUSY}"
        return f"the device hangs: {where} for {age:.3g} s"
    late = now - command.accepted - settings.watchdog
    if command.order == RUN and not beat.safe and late > max(settings.period / 2, _GRACE):
        return (
            f"no fresh command for {settings.watchdog:g} s, and the device did not go safe ({where}"
            f" for {age:.3g} s)"
        )
    return ""


class Guard:
    """A device process, and the watch over it.

    Parameters
    ----------
    settings : ServerSettings
    memory : ctypes array
    output : Output
        Of the front, for what the backend prints.
    """

    def __init__(self, settings: ServerSettings, memory: Any, output: Output) -> None:
        self._settings = settings
        self._output = output
        self._memory = memory
        self._shared = SharedMemory(memory)
        self._context = get_context("spawn")
        self._device: Any = None
        self._processor: ProcessorTime | None = None  # of the device
        self._started = 0.0
        self._acknowledged = 0
        self._ending = False
        self._fault = ""  # for which the device was replaced; empty while it was not
        self._begun = 0.0  # when it was, s
        self._backend: Any = None  # in place of the device
        self._safe_state: SafeState | None = None  # of this backend
        self._trouble = ""  # of the last attempt
        self._is_told = False  # that the rig is held in its safe state
        self._tried = 0  # number of the newest order for which the safe values were written
        self._rested = 0  # number of the newest of these that were taken
        self._due = 0.0  # when to try again, s
        self._pause = 0.0
        self._reserve = Reserve()
        self._tick = min(0.01, max(0.002, settings.watchdog / 10))

    def end(self, *_: object) -> None:
        """End the watch, with the rig in its safe state."""
        self._ending = True

    def stand_by(self) -> str:
        """Wait until the guard on duty fails.

        Returns
        -------
        str
            The reason; empty if all has ended in order, and there is nothing to do.
        """
        standby = Standby(self._settings, self._shared)
        parent = parent_process()
        while not self._ending:
            fault = standby.check()
            if standby.is_idle() and self._is_to_end(parent):
                break
            if fault:
                return fault
            sleep(self._tick)
        return ""

    def run(self, rescue: str) -> None:
        """Watch the device until the front or a signal orders the end, or the front has ended.

        It returns when the rig is in its safe state.

        Parameters
        ----------
        rescue : str
            Why the rig has to be brought to its safe state at once; empty to start a device.
        """
        self._acknowledged = self._command().acknowledged
        if rescue:
            self._rescue_after_another(rescue)
        else:
            self._start()
        parent = parent_process()
        while not self._is_to_end(parent):
            try:
                if self._fault:
                    self._hold()
                else:
                    self._check_device()
                watched = [process for process in (parent, self._device) if process is not None]
                wait([process.sentinel for process in watched], self._tick)
            except Exception:  # such as MemoryError: it is tried again, or shows no sign of life
                sleep(self._tick)
        self._end_device()
        while self._fault and not self._is_safe():
            with suppress(Exception):
                self._hold()
            sleep(self._tick)
        self._show_life(RETIRED)  # before it is closed, which may never return
        self._leave_backend()

    def _command(self) -> Command:
        return self._shared.command.read() or Command()

    def _is_to_end(self, parent: Any) -> bool:
        """Return True if a signal or the front has ordered the end, or the front has ended."""
        return (
            self._ending
            or self._command().order == END
            or (parent is not None and not parent.is_alive())
        )

    def _start(self) -> None:
        """Start a device process, which takes a while: with a sign of life before and after."""
        started = self._context.Process(
            target=device.main, args=(self._settings, self._memory, self._output), name="device"
        )
        self._started = monotonic()
        self._show_life(OPENING)
        with undisturbed():
            started.start()
        self._device = started
        self._processor = ProcessorTime(started.pid or 0)
        self._show_life(OPENING)

    def _check_device(self) -> None:
        """Check the device once, and take its place if it has failed."""
        # Read before the report: else a device might report its end, and be acknowledged, between
        # the two, and the acknowledgement would be taken for one of the device that still serves.
        command = self._command()
        trip = self._shared.trip.read()
        beat = self._shared.beat.read()
        now = monotonic()
        if self._device is None:
            if command.acknowledged != self._acknowledged:
                self._acknowledged = command.acknowledged
                self._start()
            else:
                self._show_life(GONE)
            return
        if not self._is_final(trip):  # else an acknowledgement asks for another device
            self._acknowledged = command.acknowledged
        if not self._device.is_alive():
            self._check_ended_device()
        elif beat is None or beat.process != self._device.pid or not beat.opened:
            self._show_life(OPENING)
            if now - self._started > LONGEST_OPENING:
                self._take_over(f"the device has not opened in {LONGEST_OPENING:g} s")
        else:
            fault = fault_of(beat, command, now, self._settings, self._processor)
            if fault:
                self._take_over(fault)
            else:
                self._show_life(SERVING)
                if self._processor is not None:
                    self._processor.note(beat.time)

    def _is_final(self, trip: Trip | None) -> bool:
        """Return True if a report is the last one of this device."""
        return trip is not None and trip.ended and trip.time > self._started

    def _check_ended_device(self) -> None:
        """Take the place of a device that has ended, unless it was never open."""
        trip = self._shared.trip.read()
        if trip is None or not self._is_final(trip):
            self._take_over(f"the device process has ended, exit status {self._device.exitcode}")
        elif self._shared.description.read() is not None:
            self._take_over(read_text(trip.reason), is_reported=trip.reached)
        else:
            self._device = None
            self._show_life(GONE)

    def _take_over(self, fault: str, *, is_reported: bool = False) -> None:
        """Kill the device and bring the rig to its safe state in its place."""
        self._replace(fault)
        if not is_reported:
            self._report(f"{fault}; the guard brings it to the safe state")
        if self._device.is_alive():
            self._device.kill()
            # a call inside the kernel may hold it for longer; that must not hold the guard
            self._device.join(LONGEST_DYING)
        self._device = None
        self._is_told = is_reported
        self._hold()

    def _rescue_after_another(self, fault: str) -> None:
        """Replace a guard that died, and its device, which goes safe if it still can.

        The rig is brought to its safe state once more in any case, as no other process has
        confirmed it.
        """
        self._replace(fault)
        beat = self._shared.beat.read()
        if beat is not None:
            device = OtherProcess(beat.process)
            device.join(_ORPHAN * self._settings.watchdog)
            if not self._has_ended():
                device.kill()
                device.join(LONGEST_DYING)
        self._hold()

    def _replace(self, fault: str) -> None:
        """Note that this process has to bring the rig to its safe state from now on."""
        self._reserve.release()
        self._fault = fault
        self._begun = monotonic()
        self._due = 0.0
        self._pause = 0.0
        self._trouble = ""
        self._is_told = False
        self._show_life(RESCUING)

    def _hold(self) -> None:
        """Hold the rig in its safe state, or try to bring it there; let go if acknowledged.

        A stop writes the safe values at once. What fails is tried again after a pause.
        """
        command = self._command()
        if self._is_safe() and command.acknowledged != self._acknowledged:
            self._acknowledged = command.acknowledged
            self._let_go()
            return
        is_told = command.order == REST and command.number > self._tried
        if self._backend is None and not is_told and monotonic() < self._due:
            self._show_life(RESCUING)
            return
        try:
            self._show_life(RESCUING if self._backend is None or is_told else HOLDING)
            if is_told:
                self._tried = command.number
            with deadline(self._longest_call()):
                self._try_to_hold(is_told)
            if is_told:
                self._rested = command.number
            self._pause = 0.0
        except Exception as error:
            self._lose(str(error) or repr(error))
        self._show_life(RESCUING if self._backend is None else HOLDING)

    def _try_to_hold(self, is_told: bool) -> None:
        """Open the backend if it is not, and command its safe state or look whether it holds."""
        if self._safe_state is None or self._backend is None:
            settings = self._settings
            self._backend = call("opening", open_backend, settings.backend, settings.options)
            call("safe()", self._backend.safe)
            record = self._shared.description.read()
            known = BackendSignals.from_backend(self._backend)
            signals = known if record is None else BackendSignals.from_record(record)
            self._safe_state = SafeState(self._backend, signals, lambda name: None)
            trouble = self._safe_state.command()
        elif is_told:
            trouble = self._safe_state.command()
        else:
            trouble = self._safe_state.keep()
        if trouble:
            self._report(trouble)
        elif self._safe_state.since and not self._is_told:
            self._is_told = True
            took = self._safe_state.since - self._begun
            self._report(
                f"{self._fault}; the guard opened the backend and brought it to the safe state in"
                f" {took:.3f} s"
            )

    def _lose(self, trouble: str) -> None:
        """Give up a backend that failed, until the next attempt."""
        backend = self._backend
        self._backend = None
        self._safe_state = None
        least, most = _PAUSES
        self._pause = min(max(least, 2 * self._pause), most)
        self._due = monotonic() + self._pause
        if self._is_told or trouble != self._trouble:
            self._is_told = False
            self._trouble = trouble
            self._report(f"{self._fault}; its safe state cannot be reached: {trouble}")
        if backend is not None:
            with suppress(Exception), deadline(self._longest_call()):
                backend.close()

    def _let_go(self) -> None:
        """Close the backend and start another device, which opens it anew."""
        fault = self._fault
        self._leave_backend()
        self._fault = ""
        try:
            self._reserve.fill()
            self._start()
        except Exception as error:  # no process can be started
            self._take_back(fault, f"no process can be started: {error}")

    def _take_back(self, fault: str, trouble: str) -> None:
        """Hold the rig again, as no device can be started."""
        self._replace(fault)
        self._report(f"{fault}; {trouble}")
        self._hold()

    def _leave_backend(self) -> None:
        """Close the backend, which the rig no longer needs to stay in its safe state."""
        backend = self._backend
        self._backend = None
        self._safe_state = None
        if backend is not None:
            with suppress(Exception), deadline(self._longest_call()):
                backend.close()

    def _is_safe(self) -> bool:
        """Return True if this process has the backend, and it reports the safe state."""
        return self._safe_state is not None and self._safe_state.since > 0.0

    def _longest_call(self) -> float:
        """Return the time in s that a call may take; without end if nobody would take this place.

        A driver that waits for its device may return some day, which is the last chance then.
        """
        parent = parent_process()
        standby = self._shared.standby.read()
        is_watched = (
            standby is not None
            and standby.process != os.getpid()
            and monotonic() - standby.time < _STANDBY
        )
        if is_watched or parent is None or parent.is_alive():
            return longest_attempt(self._shared)
        return inf

    def _end_device(self) -> None:
        """Wait for the device to end; take its place if it fails to end in the safe state."""
        self._ending = True
        if self._device is None:
            return
        self._show_life(GONE)
        fault = ""
        until = monotonic() + self._settings.watchdog + self._settings.period + 1.0
        while self._device.is_alive() and monotonic() < until and not fault:
            self._device.join(self._tick)
            self._show_life(GONE)
            fault = self._fault_at_the_end()
        if fault or self._device.is_alive():
            self._take_over(fault or "the device does not end")
        elif not self._has_ended() and self._was_open():
            self._take_over("the device has ended")

    def _fault_at_the_end(self) -> str:
        """Return the fault of a device that has not reported its end yet; empty if it has none."""
        beat = self._shared.beat.read()
        if beat is None or not beat.opened or self._has_ended():
            return ""
        return fault_of(beat, self._command(), monotonic(), self._settings)

    def _was_open(self) -> bool:
        """Return True if the device has read its backend at least once."""
        beat = self._shared.beat.read()
        return beat is not None and beat.opened

    def _has_ended(self) -> bool:
        """Return True if the device reported its end in the safe state; it may still be running."""
        beat = self._shared.beat.read()
        return beat is not None and read_text(beat.call) == device.ENDED and beat.safe > 0.0

    def _report(self, text: str) -> None:
        """Publish a report on the rescue."""
        self._shared.rescue.write(Trip(monotonic(), self._is_safe(), True, write_text(text)))

    def _show_life(self, at: int) -> None:
        """Show a sign of life with the present action."""
        safe, denied = 0.0, False
        if self._safe_state is not None:
            safe, denied = self._safe_state.since, self._safe_state.is_denied
        watch = Watch(
            monotonic(),
            os.getpid(),
            at,
            self._acknowledged,
            self._ending,
            safe,
            denied,
            self._rested,
        )
        self._shared.watch.write(watch)
