"""The process that has the device: a loop at fixed times, which goes safe by itself.

It takes the newest command from the board, writes it, reads, and puts the sample on the board. When the newest command
is too old, a measured value is beyond its limit or the backend raises, it brings the rig to its safe state and says so.
A backend that raised is not used any more: the process ends, and another one opens it when an operator acknowledges.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Sequence
from math import isfinite
from multiprocessing import parent_process
from multiprocessing.connection import wait
from time import monotonic, sleep
from typing import Any

from orchestration.rig.backends.registry import open_backend
from orchestration.rig.safety import MeasurementMonitor, expired
from orchestration.rig.server.board import (
    END,
    RUN,
    Beat,
    Board,
    Command,
    Sample,
    Trip,
    pack,
    unpack,
    write_text,
)
from orchestration.rig.server.calls import BackendError, Signals, bounded, call, leave, reading
from orchestration.rig.server.scheduling import Collector, Deadlines, prefer
from orchestration.rig.server.settings import Settings

_LOOK = 0.01  # s: while the device waits for its deadline it looks this often whether it is to go safe or to end
SLEEP, ENDED = "sleep", "ended"  # what a beat says beside the call of the backend that it is in
_LONGEST_END = (
    5.0  # s that the last calls of the backend may take if nobody is left to kill this process
)
_ALONE = Command(END)  # what holds when nothing can be read, which does not happen


def main(settings: Settings, memory: Any) -> None:
    """Run the process.

    Parameters
    ----------
    settings : Settings
    memory : ctypes array
        Of the board.
    """
    signal.signal(
        signal.SIGINT, signal.SIG_IGN
    )  # of a terminal, to all at once; the front tells us when to end
    device = Device(settings, Board(memory))
    if hasattr(signal, "SIGTERM"):
        signal.signal(signal.SIGTERM, device.end)
    device.run(prefer(settings.priority, settings.cpu))
    leave(0)


def look(watchdog: float) -> float:
    """How long the device may sleep at once: the guard holds one that is silent for too long to hang.

    Parameters
    ----------
    watchdog : float
        In s.

    Returns
    -------
    float
        In s.
    """
    return min(_LOOK, watchdog / 4)


class Device:
    """A backend, driven in real time from a board.

    Parameters
    ----------
    settings : Settings
    board : Board
    """

    def __init__(self, settings: Settings, board: Board) -> None:
        self._settings, self._board = settings, board
        self._told_to_end = False
        self._opened = self._safe = False
        self._tripped: int | None = None  # acknowledgements so far when the rig went safe by itself
        self._applied: tuple[float, ...] = ()
        self._number = 0
        self._looked = 0.0
        self._look = look(settings.watchdog)

    def end(self, *_: object) -> None:
        """Let the loop end in the safe state."""
        self._told_to_end = True

    def run(self, notes: Sequence[str] = ()) -> None:
        """Open the backend, serve it until told to end, and leave the rig in its safe state.

        Parameters
        ----------
        notes : sequence of str
            What else whoever started the server should know.
        """
        try:
            self._open(notes)
            self._loop()
            with bounded(_LONGEST_END):
                self._rest()
                self._call("close()", self._backend.close)
        except BackendError as error:
            self._fail(str(error))
        self._beat(ENDED, monotonic())

    def _open(self, notes: Sequence[str]) -> None:
        settings = self._settings
        self._backend = self._call("opening", open_backend, settings.backend, settings.options)
        self._signals = Signals.of(self._backend)
        self._signals.notes.extend(notes)
        self._rest()
        self._monitor = MeasurementMonitor(
            self._signals.outputs, self._signals.limits, settings.watchdog
        )
        self._values = [0.0] * len(self._signals.outputs)
        self._taken = [0.0] * len(self._signals.outputs)
        self._applied = (0.0,) * len(self._signals.inputs)
        self._deadlines = Deadlines(settings.period, monotonic())
        self._board.description.write(self._signals.record())
        self._tick(self._command())
        self._opened = True

    def _loop(self) -> None:
        collector = Collector()
        while (command := self._wait()).order != END:
            self._tick(command)
            collector.collect(monotonic())

    def _wait(self) -> Command:
        """Sleep until the next deadline or until the command expires; shorter if the rig is to rest or to end."""
        self._deadlines.advance(monotonic())
        while True:
            command = self._command()
            now = monotonic()
            until = self._deadlines.next
            running = command.order == RUN and self._tripped != command.acknowledged
            if running:
                until = min(until, command.accepted + self._settings.watchdog)
            if command.order == END or now >= until or not (running or self._safe):
                return command
            self._beat(SLEEP, now)
            sleep(min(until - now, self._look))

    def _command(self) -> Command:
        now = monotonic()
        if (
            now - self._looked > _LOOK
        ):  # a look takes some 20 microseconds, a thousand periods a second have not that
            self._looked = now
            parent, watch = parent_process(), self._board.watch.read()
            if (parent is not None and wait([parent.sentinel], 0)) or (
                watch is not None and watch.ending
            ):
                self._told_to_end = True
        return _ALONE if self._told_to_end else self._board.command.read() or _ALONE

    def _tick(self, command: Command) -> None:
        """Command, measure, publish."""
        if self._tripped != command.acknowledged:
            self._tripped = None
        if command.order != RUN or self._tripped is not None:
            self._rest()
        elif expired(command.accepted, monotonic(), self._settings.watchdog):
            self._trip(command.acknowledged, f"no fresh command for {self._settings.watchdog:g} s")
        else:
            self._write(unpack(command.values, len(self._applied)))
        now = monotonic()
        self._beat("read()", now)
        measured = reading(self._backend, self._signals)
        reason = self._monitor.check(measured, now)
        if reason and self._tripped is None:
            self._trip(command.acknowledged, reason)
        self._publish(measured, now)

    def _write(self, values: tuple[float, ...]) -> None:
        self._safe = False
        self._call(
            "write()", self._backend.write, dict(zip(self._signals.inputs, values, strict=True))
        )
        self._applied = values

    def _rest(self) -> None:
        """Bring the rig to its safe state, unless it is there."""
        if not self._safe:
            self._call("safe()", self._backend.safe)
            self._safe = True
            self._applied = (0.0,) * len(self._applied)

    def _trip(self, acknowledged: int, reason: str) -> None:
        self._tripped = acknowledged
        try:
            self._rest()
        except BackendError as error:
            raise BackendError(f"{reason}; {error}") from error
        self._report(reason, reached=True, ended=False)

    def _fail(self, reason: str) -> None:
        """Go safe with a backend that raised, if it still can; else it is the guard's turn."""
        self._safe = False
        if hasattr(self, "_backend"):
            try:
                self._rest()
                self._call("close()", self._backend.close)
            except BackendError as error:
                reason = f"{reason}; {error}"
        self._report(reason, reached=self._safe, ended=True)

    def _report(self, reason: str, *, reached: bool, ended: bool) -> None:
        self._board.trip.write(Trip(monotonic(), reached, ended, write_text(reason)))

    def _publish(self, measured: dict[str, float], now: float) -> None:
        for k, value in enumerate(measured.values()):
            if isfinite(value):
                self._values[k], self._taken[k] = value, now
        self._number += 1
        packed = map(pack, (self._applied, self._values, self._taken))
        self._board.sample.write(Sample(self._number, now, self._deadlines.missed, *packed))

    def _call(self, name: str, function: Callable[..., Any], *arguments: Any) -> Any:
        self._beat(name, monotonic())
        return call(name, function, *arguments)

    def _beat(self, where: str, now: float) -> None:
        self._board.beat.write(Beat(now, os.getpid(), self._opened, self._safe, where.encode()))
