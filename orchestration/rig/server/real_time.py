"""A rig in real time, as the front sees it: the guard process and its device process."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context
from time import monotonic, sleep
from typing import Any

from fmus.rig_proxy import REAL_TIME
from orchestration.rig.server import guard
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.rig import RigState, cannot_open
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    REST,
    RUN,
    SERVING,
    Command,
    SharedMemory,
    Slot,
    Trip,
    new_memory,
    pack,
    read_text,
    unpack,
)

_LOOK = 0.01  # s
_GUARDS = 3  # that may hang in a safe state before the front gives up starting others
_SPARE = 2.0  # s, beyond what guard and device may take to end


class RealTimeRig:
    """A backend in a process of its own, which another process watches.

    Parameters
    ----------
    settings : ServerSettings

    Raises
    ------
    UserError
        If the backend cannot be opened; nothing goes on then.
    """

    mode = REAL_TIME

    def __init__(self, settings: ServerSettings) -> None:
        self._settings = settings
        self.watchdog = settings.watchdog
        self._memory = new_memory()
        self._shared = SharedMemory(self._memory)
        self._command = Command()
        self._shared.command.write(self._command)
        self._seen: dict[str, float] = {}
        self._rescues = 0
        self._guard = self._start_guard("")
        try:
            self.signals = self._wait_until_open()
        except BaseException:
            self.close()
            raise

    clock = staticmethod(monotonic)

    def _start_guard(self, rescue: str) -> Any:
        process = get_context("spawn").Process(
            target=guard.main, args=(self._settings, self._memory, rescue), name="guard"
        )
        with _ctrl_c_ignored():
            process.start()
        return process

    def _wait_until_open(self) -> BackendSignals:
        until = monotonic() + guard.LONGEST_OPENING + _SPARE
        while monotonic() < until and self._guard.is_alive():
            for trip in (self._shared.trip.read(), self._shared.rescue.read()):
                if trip is not None and trip.ended:
                    raise cannot_open(self._settings, read_text(trip.reason))
            watch = self._shared.watch.read()
            description = self._shared.description.read()
            if watch is not None and watch.device == SERVING and description is not None:
                return BackendSignals.from_record(description)
            sleep(_LOOK)
        raise cannot_open(self._settings, f"it did not open in {guard.LONGEST_OPENING:g} s")

    def apply(self, values: Sequence[float], now: float) -> None:
        """Command every input.

        Parameters
        ----------
        values : sequence of float
        now : float
            When they were accepted, in s.
        """
        self._order(self._command._replace(order=RUN, accepted=now, values=pack(values)))

    def advance(self, step: float) -> None:
        """Do nothing: time passes by itself."""

    def go_safe(self) -> None:
        """Order the device to its safe state."""
        if self._command.order != REST:
            self._order(self._command._replace(order=REST))

    def release(self) -> None:
        """Serve again: the device, if it is still there, or another one."""
        self._rescues = 0
        self._order(self._command._replace(order=REST, acknowledged=self._command.acknowledged + 1))
        if not self._guard.is_alive():
            self._guard = self._start_guard("")

    def _order(self, command: Command) -> None:
        self._command = command
        self._shared.command.write(command)

    def opening(self) -> str:
        """Return the reason for which the rig cannot be used: its device is not open."""
        watch = self._shared.watch.read()
        if (
            watch is not None
            and watch.device == SERVING
            and watch.acknowledged == self._command.acknowledged
        ):
            return ""
        return "the device is being opened"

    def troubles(self) -> list[str]:
        """Return what made the rig go safe by itself, or fail to, since the last call."""
        reasons = self._news("device", self._shared.trip) + self._news("guard", self._shared.rescue)
        if not self._guard.is_alive():
            self._guard.join()
            reasons += self._replace_guard()
        return reasons

    def _news(self, who: str, slot: Slot[Trip]) -> list[str]:
        """Return the reason of a report that was not seen before."""
        trip = slot.read()
        if trip is None or trip.time == self._seen.get(who):
            return []
        self._seen[who] = trip.time
        return [read_text(trip.reason)]

    def _replace_guard(self) -> list[str]:
        """Start another guard that brings the rig to its safe state, a bounded number of times."""
        if self._rescues > _GUARDS:
            return []
        self._rescues += 1
        rescue = self._shared.rescue.read()
        reason = "the guard process has ended"
        if rescue is not None and not rescue.reached:
            reason = "THE SAFE STATE WAS NOT REACHED: the backend hangs"
        if self._rescues > _GUARDS:
            return [f"{reason}; given up after {_GUARDS} processes"]
        self._guard = self._start_guard(reason)
        return [f"{reason}; process {self._rescues} of {_GUARDS} that tries for the safe state"]

    def state(self) -> RigState:
        """Return the newest sample."""
        inputs = len(self.signals.inputs)
        outputs = len(self.signals.outputs)
        sample = self._shared.sample.read()
        if sample is None:
            return RigState(0, (0.0,) * inputs, (None,) * outputs, (0.0,) * outputs, 0)
        taken = unpack(sample.taken, outputs)
        measured = zip(unpack(sample.values, outputs), taken, strict=True)
        values = tuple(value if time else None for value, time in measured)
        return RigState(sample.number, unpack(sample.applied, inputs), values, taken, sample.missed)

    def close(self) -> str:
        """End device and guard with the rig in its safe state."""
        ordered = monotonic()
        self._order(self._command._replace(order=END))
        patience = self.watchdog + self._settings.period + 1.0 + guard.LONGEST_ATTEMPT + _SPARE
        self._guard.join(patience)
        if self._guard.is_alive():
            self._guard.kill()
            self._guard.join(1.0)
        rescue = self._shared.rescue.read()
        if self._guard.exitcode == 0:
            return ""
        if rescue is not None and rescue.reached and rescue.time > ordered:
            return ""  # a guard that reached it may hang in the driver afterwards
        return "the guard does not end" if rescue is None else read_text(rescue.reason)


@contextmanager
def _ctrl_c_ignored() -> Iterator[None]:
    """Ignore Ctrl-C while a process is started.

    In a terminal it reaches all processes, and one that is being started must not end by it.
    """
    try:
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    except ValueError:  # not the main thread
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
