"""Guard process of the server: it watches the device process, and takes its place in need.

When the device hangs or dies, the guard opens the backend itself and calls ``safe``.

All that this needs is imported beforehand, so that it takes no longer than the driver. The guard
starts the device, and starts another one when an operator acknowledges.
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
from orchestration.rig.server.calls import BackendError, call, deadline, leave
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    GONE,
    OPENING,
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

LONGEST_OPENING = 30.0  # s that a backend may take to open before it is held to hang
ATTEMPTS = 5  # at the safe state, when the backend raises
# s; a guard that hangs for longer in the backend ends itself, and the front starts another
LONGEST_ATTEMPT = 5.0
_PAUSE = 0.2  # s between two attempts
_LONGEST_DYING = 0.5  # s that a killed process may take to end
# of the watchdog time, that a driver call may take: the remainder is for noticing and for the
# rescue
_SHARE = 0.75
_GRACE = 0.01  # s, at least: what the device gets beyond the watchdog time to go safe by itself


def main(settings: ServerSettings, memory: Any, rescue: str) -> None:
    """Run the process; its exit status is 0 if it leaves the rig in its safe state.

    Parameters
    ----------
    settings : ServerSettings
    memory : ctypes array
        Shared with front and device.
    rescue : str
        Why the rig has to be brought to its safe state at once; empty to start a device.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    guard = Guard(settings, memory)
    if hasattr(signal, "SIGTERM"):
        signal.signal(signal.SIGTERM, guard.end)
    leave(0 if guard.run(rescue) else 1)


def fault_of(beat: Beat, command: Command, now: float, watchdog: float, period: float) -> str:
    """Describe what is wrong with a living device, by its last sign of life.

    Parameters
    ----------
    beat : Beat
    command : Command
        The newest.
    now, watchdog, period : float
        In s.

    Returns
    -------
    str
        Empty if nothing is wrong.
    """
    where = read_text(beat.call)
    age = now - beat.time
    if age > _SHARE * watchdog:
        if where == device.SLEEP:
            return (
                f"the device's process has not run for {age:.3g} s, outside of the driver: this"
                " computer is too busy"
            )
        return f"the device hangs: {where} for {age:.3g} s"
    late = now - command.accepted - watchdog
    if command.order == RUN and not beat.safe and late > max(period / 2, _GRACE):
        return (
            f"no fresh command for {watchdog:g} s, and the device did not go safe ({where} for"
            f" {age:.3g} s)"
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
        self._tick = min(0.01, max(0.002, settings.watchdog / 10))

    def end(self, *_: object) -> None:
        """End the watch, with the rig in its safe state."""
        self._ending = True

    def run(self, rescue: str) -> bool:
        """Watch until the front, a signal or the end of the front ends it.

        Parameters
        ----------
        rescue : str
            As for :func:`main`.

        Returns
        -------
        bool
            True if the rig is in its safe state at the end.
        """
        with suppress(Exception):  # the device will say what is wrong with it
            backend_class(self._settings.backend)
        self._acknowledged = self._command().acknowledged
        if rescue:
            self._rescue_after_another(rescue)
        else:
            self._start()
        parent = parent_process()
        while not self._is_to_end(parent):
            self._look()
            watched = [process for process in (parent, self._device) if process is not None]
            wait([process.sentinel for process in watched], self._tick)
        self._end()
        return self._reached

    def _command(self) -> Command:
        return self._shared.command.read() or Command()

    def _is_to_end(self, parent: Any) -> bool:
        return (
            self._ending
            or self._command().order == END
            or (parent is not None and not parent.is_alive())
        )

    def _start(self) -> None:
        self._device = self._context.Process(
            target=device.main, args=(self._settings, self._memory), name="device"
        )
        self._started = monotonic()
        self._device.start()
        self._tell(OPENING)

    def _look(self) -> None:
        """Check the device once, and take its place if it has failed."""
        # before all else: an acknowledgement is of what was in the shared memory before it
        command = self._command()
        trip = self._shared.trip.read()
        beat = self._shared.beat.read()
        now = monotonic()
        if self._device is None:
            if command.acknowledged != self._acknowledged:
                self._acknowledged = command.acknowledged
                self._start()
            return
        if not self._is_final(trip):  # else an acknowledgement asks for another device
            self._acknowledged = command.acknowledged
        if not self._device.is_alive():
            self._look_at_ended_device()
        elif beat is None or beat.process != self._device.pid or not beat.opened:
            if now - self._started > LONGEST_OPENING:
                self._take_over(f"the device has not opened in {LONGEST_OPENING:g} s")
        else:
            fault = fault_of(beat, command, now, self._settings.watchdog, self._settings.period)
            if fault:
                self._take_over(fault)
            else:
                self._tell(SERVING)

    def _is_final(self, trip: Trip | None) -> bool:
        """Return True if a report is the last one of this device."""
        return trip is not None and trip.ended and trip.time > self._started

    def _look_at_ended_device(self) -> None:
        """Take the place of a device that has ended, unless it left the rig in its safe state."""
        trip = self._shared.trip.read()
        if trip is None or not self._is_final(trip):
            self._take_over(f"the device process has ended, exit status {self._device.exitcode}")
        elif not trip.reached and self._shared.description.read() is not None:
            # without a description the backend was never open
            self._take_over(read_text(trip.reason))
        else:
            self._device = None
            self._tell(GONE)

    def _take_over(self, reason: str) -> None:
        """Kill the device and bring the rig to its safe state in its place."""
        begun = monotonic()
        self._reached = False
        self._report(f"{reason}; the guard brings it to the safe state", begun)
        if self._device.is_alive():
            self._device.kill()
            # a call inside the kernel may hold it for longer; that must not hold the guard
            self._device.join(_LONGEST_DYING)
        self._device = None
        self._reach(reason, begun)

    def _rescue_after_another(self, reason: str) -> None:
        """Take the place of a guard that died, and of its device."""
        beat = self._shared.beat.read()
        begun = monotonic()
        self._reached = False
        if beat is not None and not self._has_ended():
            with suppress(OSError):
                os.kill(beat.process, getattr(signal, "SIGKILL", signal.SIGTERM))
        self._reach(reason, begun)

    def _reach(self, reason: str, begun: float) -> None:
        """Try for the safe state, a bounded number of times."""
        self._tell(GONE)
        for attempt in range(1, ATTEMPTS + 1):
            try:
                with deadline(LONGEST_ATTEMPT):
                    self._attempt(reason, begun)
            except BackendError as error:
                if not self._reached:
                    text = (
                        f"{reason}; THE SAFE STATE WAS NOT REACHED, attempt {attempt} of"
                        f" {ATTEMPTS}: {error}"
                    )
                    self._report(text, monotonic())
                    sleep(_PAUSE)
            if self._reached:
                return

    def _attempt(self, reason: str, begun: float) -> None:
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
        self._tell(GONE, ending=True)
        if self._device is None:
            return
        fault = ""
        until = monotonic() + self._settings.watchdog + self._settings.period + 1.0
        while self._device.is_alive() and monotonic() < until and not fault:
            self._device.join(self._tick)
            fault = self._fault_at_the_end()
        if fault or self._device.is_alive():
            self._take_over(fault or "the device does not end")
        elif not self._has_ended() and self._was_open():
            self._take_over("the device has ended")

    def _fault_at_the_end(self) -> str:
        beat = self._shared.beat.read()
        if beat is None or not beat.opened or self._has_ended():
            return ""
        return fault_of(
            beat, self._command(), monotonic(), self._settings.watchdog, self._settings.period
        )

    def _was_open(self) -> bool:
        beat = self._shared.beat.read()
        return beat is not None and beat.opened

    def _has_ended(self) -> bool:
        """Return True if the device reported its end in the safe state; it may still be running."""
        beat = self._shared.beat.read()
        return beat is not None and read_text(beat.call) == device.ENDED and beat.safe

    def _report(self, text: str, now: float) -> None:
        self._shared.rescue.write(Trip(now, self._reached, True, write_text(text)))

    def _tell(self, state: int, *, ending: bool = False) -> None:
        self._shared.watch.write(Watch(state, self._acknowledged, ending))
