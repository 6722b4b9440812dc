"""The process that watches the device: when the device hangs or dies, it opens the backend itself and calls ``safe``.

All that this needs is imported beforehand, so that it takes no longer than the driver. The guard starts the device, and
starts another one when an operator acknowledges.
"""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from time import monotonic, sleep
from typing import Any

from orchestration.rig.backends.registry import backend_class, open_backend
from orchestration.rig.server import device
from orchestration.rig.server.board import (
    END,
    GONE,
    OPENING,
    RUN,
    SERVING,
    Beat,
    Board,
    Command,
    Trip,
    Watch,
    read_text,
    write_text,
)
from orchestration.rig.server.calls import BackendError, bounded, call, leave
from orchestration.rig.server.settings import Settings

LONGEST_OPENING = 30.0  # s that a backend may take to open before it is held to hang
ATTEMPTS = 5  # at the safe state, when the backend raises
LONGEST_ATTEMPT = (
    5.0  # s; a guard that hangs for longer in the backend ends itself, and the front starts another
)
_PAUSE = 0.2  # s between two attempts
_LONGEST_DYING = 0.5  # s that a killed process may take to end
_SHARE = 0.75  # of the watchdog time, that a driver call may take: what is left is for finding out and for the rescue
_GRACE = 0.01  # s, at least: what the device gets beyond the watchdog time to go safe by itself


def main(settings: Settings, memory: Any, rescue: str) -> None:
    """Run the process; its exit status is 0 if it leaves the rig in its safe state.

    Parameters
    ----------
    settings : Settings
    memory : ctypes array
        Of the board.
    rescue : str
        Why the rig has to be brought to its safe state at once; empty to start a device.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    guard = Guard(settings, memory)
    if hasattr(signal, "SIGTERM"):
        signal.signal(signal.SIGTERM, guard.end)
    leave(0 if guard.run(rescue) else 1)


def fault_of(beat: Beat, command: Command, now: float, watchdog: float, period: float) -> str:
    """Judge a living device by its last beat.

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
        What is wrong; empty if nothing is.
    """
    where, age = read_text(beat.call), now - beat.time
    if age > _SHARE * watchdog:
        if where == device.SLEEP:
            return f"the device's process has not run for {age:.3g} s, outside of the driver: this computer is too busy"
        return f"the device hangs: {where} for {age:.3g} s"
    late = now - command.accepted - watchdog
    if command.order == RUN and not beat.safe and late > max(period / 2, _GRACE):
        return f"no fresh command for {watchdog:g} s, and the device did not go safe ({where} for {age:.3g} s)"
    return ""


class Guard:
    """A device process and the watch over it.

    Parameters
    ----------
    settings : Settings
    memory : ctypes array
    """

    def __init__(self, settings: Settings, memory: Any) -> None:
        self._settings, self._memory, self._board = settings, memory, Board(memory)
        self._context = get_context("spawn")
        self._device: Any = None
        self._started = 0.0
        self._acknowledged = 0
        self._told_to_end = False
        self._reached = True
        self._tick = min(0.01, max(0.002, settings.watchdog / 10))

    def end(self, *_: object) -> None:
        """Let the watch end, with the rig in its safe state."""
        self._told_to_end = True

    def run(self, rescue: str) -> bool:
        """Watch until told to end.

        Parameters
        ----------
        rescue : str
            As for :func:`main`.

        Returns
        -------
        bool
            Whether the rig is left in its safe state.
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
            waits = [parent.sentinel] if parent is not None else []
            wait(waits + ([self._device.sentinel] if self._device is not None else []), self._tick)
        self._end()
        return self._reached

    def _command(self) -> Command:
        return self._board.command.read() or Command()

    def _is_to_end(self, parent: Any) -> bool:
        return (
            self._told_to_end
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
        """See whether the device is well; if not, take its place."""
        command = (
            self._command()
        )  # before all else: what an operator acknowledges was on the board before
        trip, beat, now = self._board.trip.read(), self._board.beat.read(), monotonic()
        if self._device is None:
            if command.acknowledged != self._acknowledged:
                self._acknowledged = command.acknowledged
                self._start()
            return
        if not self._is_of_the_end(
            trip
        ):  # else the acknowledgement, if there is one, asks for another device
            self._acknowledged = command.acknowledged
        if not self._device.is_alive():
            self._look_after_the_end()
        elif beat is None or beat.process != self._device.pid or not beat.opened:
            if now - self._started > LONGEST_OPENING:
                self._take_over(f"the device has not opened in {LONGEST_OPENING:g} s")
        elif fault := fault_of(beat, command, now, self._settings.watchdog, self._settings.period):
            self._take_over(fault)
        else:
            self._tell(SERVING)

    def _is_of_the_end(self, trip: Trip | None) -> bool:
        """Whether a report is the last one of this device."""
        return trip is not None and trip.ended and trip.time > self._started

    def _look_after_the_end(self) -> None:
        """See whether a device that has ended left the rig in its safe state."""
        trip = self._board.trip.read()
        if trip is None or not self._is_of_the_end(trip):
            self._take_over(f"the device process has ended, exit status {self._device.exitcode}")
        elif (
            not trip.reached and self._board.description.read() is not None
        ):  # else the backend was never open
            self._take_over(read_text(trip.reason))
        else:
            self._device = None
            self._tell(GONE)

    def _take_over(self, reason: str) -> None:
        """Kill the device and bring the rig to its safe state in its place."""
        begun, self._reached = monotonic(), False
        self._report(f"{reason}; the guard brings it to the safe state", begun)
        if self._device.is_alive():
            self._device.kill()
            self._device.join(
                _LONGEST_DYING
            )  # a call inside the kernel may hold it for longer; that must not hold us
        self._device = None
        self._reach(reason, begun)

    def _rescue_after_another(self, reason: str) -> None:
        """Take the place of a guard that died, and of its device."""
        beat, begun, self._reached = self._board.beat.read(), monotonic(), False
        if beat is not None and not self._has_ended():
            with suppress(OSError):
                os.kill(beat.process, getattr(signal, "SIGKILL", signal.SIGTERM))
        self._reach(reason, begun)

    def _reach(self, reason: str, begun: float) -> None:
        """Try for the safe state, a bounded number of times."""
        self._tell(GONE)
        for attempt in range(1, ATTEMPTS + 1):
            try:
                with bounded(LONGEST_ATTEMPT):
                    self._attempt(reason, begun)
            except BackendError as error:
                if not self._reached:
                    text = f"{reason}; THE SAFE STATE WAS NOT REACHED, attempt {attempt} of {ATTEMPTS}: {error}"
                    self._report(text, monotonic())
                    sleep(_PAUSE)
            if self._reached:
                return

    def _attempt(self, reason: str, begun: float) -> None:
        backend = call("opening", open_backend, self._settings.backend, self._settings.options)
        call("safe()", backend.safe)
        self._reached, now = True, monotonic()
        text = f"{reason}; the guard opened the backend and brought it to the safe state in {now - begun:.3f} s"
        self._report(text, now)
        call("close()", backend.close)

    def _end(self) -> None:
        """Let the device end; if it does not, or leaves the rig as it was, take its place."""
        self._tell(GONE, ending=True)
        if self._device is None:
            return
        fault, until = "", monotonic() + self._settings.watchdog + self._settings.period + 1.0
        while self._device.is_alive() and monotonic() < until and not fault:
            self._device.join(self._tick)
            fault = self._fault_at_the_end()
        if fault or self._device.is_alive():
            self._take_over(fault or "the device does not end")
        elif not self._has_ended() and self._was_open():
            self._take_over("the device has ended")

    def _fault_at_the_end(self) -> str:
        beat = self._board.beat.read()
        if beat is None or not beat.opened or self._has_ended():
            return ""
        return fault_of(
            beat, self._command(), monotonic(), self._settings.watchdog, self._settings.period
        )

    def _was_open(self) -> bool:
        beat = self._board.beat.read()
        return beat is not None and beat.opened

    def _has_ended(self) -> bool:
        """Whether the device has left the rig in its safe state, if not yet its process."""
        beat = self._board.beat.read()
        return beat is not None and read_text(beat.call) == device.ENDED and beat.safe

    def _report(self, text: str, now: float) -> None:
        self._board.rescue.write(Trip(now, self._reached, True, write_text(text)))

    def _tell(self, state: int, *, ending: bool = False) -> None:
        self._board.watch.write(Watch(state, self._acknowledged, ending))
