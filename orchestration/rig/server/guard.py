"""Guard process of the server: it watches the device process, and replaces one that fails.

When the device hangs or dies, the guard opens the backend itself and calls ``safe``. All modules
for this are imported beforehand, so that it takes no longer than the driver. The guard starts the
device, and starts another one when an operator acknowledges. There are two guards: one on duty, and
a standby, which ends the first if that shows no sign of life, and replaces it.
"""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from time import monotonic, sleep
from typing import Any

from orchestration.rig.backends import backend_class, open_backend
from orchestration.rig.server import device
from orchestration.rig.server.calls import call, leave
from orchestration.rig.server.processes import OtherProcess, Reserve, deadline, detach, undisturbed
from orchestration.rig.server.settings import BUSY, ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    GONE,
    OPENING,
    RESCUING,
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
from orchestration.rig.server.standby import LONGEST_ATTEMPT, LONGEST_DYING, Standby

LONGEST_OPENING = 30.0  # s that a backend may take to open before it is held to hang
ATTEMPTS = 5  # at the safe state, when the backend raises
_PAUSE = 0.2  # s between two attempts
_ORPHAN = 0.1  # of the watchdog time, that a device gets to go safe when its guard has ended
_GRACE = 0.01  # s, at least, that the device has beyond the watchdog time to go safe by itself


def main(settings: ServerSettings, memory: Any, rescue: str, stands_by: bool) -> None:
    """Run the process; its exit status is 0 if it leaves the rig in its safe state.

    Parameters
    ----------
    settings : ServerSettings
    memory : ctypes array
        Shared with front, device and the other guard.
    rescue : str
        Why the rig has to be brought to its safe state at once; empty to start a device.
    stands_by : bool
        Whether another guard is on duty, and this one waits until it fails.
    """
    detach()
    with suppress(Exception):  # the device will report its own fault
        backend_class(settings.backend)
    guard = Guard(settings, memory)
    if hasattr(signal, "SIGTERM"):
        signal.signal(signal.SIGTERM, guard.end)
    if stands_by:
        fault = guard.stand_by()
        leave(0 if not fault or guard.run(fault) else 1)
    leave(0 if guard.run(rescue) else 1)


def fault_of(beat: Beat, command: Command, now: float, settings: ServerSettings) -> str:
    """Return the fault of a living device in words, by its last sign of life.

    Parameters
    ----------
    beat : Beat
    command : Command
        The newest.
    now : float
        Present time in s.
    settings : ServerSettings

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
    """

    def __init__(self, settings: ServerSettings, memory: Any) -> None:
        self._settings = settings
        self._memory = memory
        self._shared = SharedMemory(memory)
        self._context = get_context("spawn")
        self._device: Any = None
        self._started = 0.0
        self._acknowledged = 0
        self._ending = False
        self._reached = True
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

    def run(self, rescue: str) -> bool:
        """Watch the device until the front or a signal orders the end, or the front has ended.

        Parameters
        ----------
        rescue : str
            Why the rig has to be brought to its safe state at once; empty to start a device.

        Returns
        -------
        bool
            True if the rig is in its safe state at the end.
        """
        self._acknowledged = self._command().acknowledged
        if rescue:
            self._rescue_after_another(rescue)
        else:
            self._start()
        parent = parent_process()
        while not self._is_to_end(parent):
            with suppress(Exception):  # such as MemoryError: it is tried again, or shows no life
                self._check_device()
            watched = [process for process in (parent, self._device) if process is not None]
            wait([process.sentinel for process in watched], self._tick)
        self._end()
        if self._reached:
            self._show_life(RETIRED, ending=True)
        return self._reached

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
            target=device.main, args=(self._settings, self._memory), name="device"
        )
        self._started = monotonic()
        self._show_life(OPENING)
        with undisturbed():
            started.start()
        self._device = started
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
            fault = fault_of(beat, command, now, self._settings)
            if fault:
                self._take_over(fault)
            else:
                self._show_life(SERVING)

    def _is_final(self, trip: Trip | None) -> bool:
        """Return True if a report is the last one of this device."""
        return trip is not None and trip.ended and trip.time > self._started

    def _check_ended_device(self) -> None:
        """Take the place of a device that has ended, unless the rig is in its safe state."""
        trip = self._shared.trip.read()
        if trip is None or not self._is_final(trip):
            self._take_over(f"the device process has ended, exit status {self._device.exitcode}")
        elif not trip.reached and self._shared.description.read() is not None:
            # without a description the backend was never open
            self._take_over(read_text(trip.reason))
        else:
            self._device = None
            self._show_life(GONE)

    def _take_over(self, reason: str) -> None:
        """Kill the device and bring the rig to its safe state in its place."""
        begun = monotonic()
        self._reached = False
        self._show_life(RESCUING)
        self._report(f"{reason}; the guard brings it to the safe state", begun)
        if self._device.is_alive():
            self._device.kill()
            # a call inside the kernel may hold it for longer; that must not hold the guard
            self._device.join(LONGEST_DYING)
        self._device = None
        self._reach_safe_state(reason, begun)

    def _rescue_after_another(self, reason: str) -> None:
        """Replace a guard that died, and its device, which goes safe if it still can.

        The rig is brought to its safe state once more in any case, as no other process has
        confirmed it.
        """
        begun = monotonic()
        self._reached = False
        self._show_life(RESCUING)
        beat = self._shared.beat.read()
        if beat is not None:
            device = OtherProcess(beat.process)
            device.join(_ORPHAN * self._settings.watchdog)
            if not self._has_ended():
                device.kill()
                device.join(LONGEST_DYING)
        self._reach_safe_state(reason, begun)

    def _reach_safe_state(self, reason: str, begun: float) -> None:
        """Try to bring the rig to its safe state, a bounded number of times."""
        self._reserve.release()
        for attempt in range(1, ATTEMPTS + 1):
            self._show_life(RESCUING)
            try:
                with deadline(LONGEST_ATTEMPT):
                    self._try_safe_state(reason, begun)
            except Exception as error:
                if not self._reached:
                    text = (
                        f"{reason}; THE SAFE STATE WAS NOT REACHED, attempt {attempt} of"
                        f" {ATTEMPTS}: {error}"
                    )
                    self._report(text, monotonic())
                    sleep(_PAUSE)
            if self._reached:
                break
        self._show_life(GONE)

    def _try_safe_state(self, reason: str, begun: float) -> None:
        """Open the backend, bring it to its safe state, report that, and close it."""
        backend = call("opening", open_backend, self._settings.backend, self._settings.options)
        call("safe()", backend.safe)
        self._reached = True
        now = monotonic()
        text = (
            f"{reason}; the guard opened the backend and brought it to the safe state in"
            f" {now - begun:.3f} s"
        )
        self._report(text, now)
        call("close()", backend.close)

    def _end(self) -> None:
        """Wait for the device to end; take its place if it fails to end in the safe state."""
        self._show_life(GONE, ending=True)
        if self._device is None:
            return
        fault = ""
        until = monotonic() + self._settings.watchdog + self._settings.period + 1.0
        while self._device.is_alive() and monotonic() < until and not fault:
            self._device.join(self._tick)
            self._show_life(GONE, ending=True)
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

    def _report(self, text: str, now: float) -> None:
        """Publish a report on the rescue."""
        self._shared.rescue.write(Trip(now, self._reached, True, write_text(text)))

    def _show_life(self, at: int, *, ending: bool = False) -> None:
        """Show a sign of life with the present action."""
        watch = Watch(monotonic(), os.getpid(), at, self._acknowledged, ending)
        self._shared.watch.write(watch)
