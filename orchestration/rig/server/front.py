"""The process that speaks with clients: takes what arrives, answers at once, publishes, heeds signals."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from time import monotonic
from typing import Any

import zmq

from fmus.rig_proxy.protocol import REQUESTS, ProtocolError, decode
from orchestration.rig.server.desk import Desk
from orchestration.rig.server.lockstep import LockstepRig
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.real_time import RealTimeRig
from orchestration.rig.server.rig import Rig
from orchestration.rig.server.scheduling import Collector
from orchestration.rig.server.settings import Settings
from orchestration.rig.server.sockets import Sockets, opened

_LONGEST_WAIT = 10  # ms for a message, before whatever else there is to do
_AT_ONCE = 200  # messages that are taken before whatever else there is to do
_TELEMETRY = 1 / 30  # s between two samples that are published, at least
_SILENCE = 0.2  # s between two messages of telemetry, at most


class Signals:
    """What the operating system asked for."""

    ending = ""
    stopping = ""


def serve(settings: Settings) -> int:
    """Serve a rig until told to end.

    Parameters
    ----------
    settings : Settings

    Returns
    -------
    int
        0 if the rig was left in its safe state.

    Raises
    ------
    UserError
        If the server cannot start.
    """
    log = EventLog(settings.log)
    try:
        with heeded() as signals, opened(settings, log.tell) as sockets:
            rig: Rig = LockstepRig(settings) if settings.lockstep else RealTimeRig(settings)
            trouble = "the server failed"
            try:
                log.tell(_ready(settings, sockets, rig))
                for note in rig.signals.notes:
                    log.tell(note)
                Front(sockets, Desk(rig, settings.period, log), log, signals).run()
            finally:
                trouble = rig.close()
                if trouble:
                    log.tell(f"THE SAFE STATE WAS NOT REACHED: {trouble}")
                else:
                    log.tell(f"ended, in the safe state: {signals.ending or 'the server failed'}")
    finally:
        log.close()
    return 1 if trouble else 0


class Front:
    """The loop around the two sockets.

    Parameters
    ----------
    sockets : Sockets
    desk : Desk
    log : EventLog
    signals : Signals
    """

    def __init__(self, sockets: Sockets, desk: Desk, log: EventLog, signals: Signals) -> None:
        self._sockets, self._desk, self._log, self._signals = sockets, desk, log, signals
        self._looked = self._published = 0.0
        self._number = -1
        sockets.requests.rcvtimeo = _LONGEST_WAIT

    def run(self) -> None:
        """Serve until told to end."""
        collector = Collector()
        while not self._signals.ending:
            self._take_messages()
            if (
                self._signals.ending
            ):  # the same signal may have ended the guard, which is no trouble then
                break
            now = monotonic()
            if self._signals.stopping:
                self._desk.stop(self._signals.stopping)
                self._signals.stopping = ""
            self._desk.supervise()
            self._publish(now)
            if now - self._looked > 0.1:
                self._looked = now
                self._count_turned_away()
            collector.collect(now)

    def _take_messages(self) -> None:
        """Take all that has arrived; of exchanges that wait only the newest is carried out."""
        waiting: tuple[bytes, dict[str, Any]] | None = None
        flags = 0
        for _ in range(_AT_ONCE):
            try:
                frames = self._sockets.requests.recv_multipart(flags)
            except zmq.Again:
                break
            flags = zmq.NOBLOCK
            message = self._decoded(frames)
            if message is None:
                continue
            if message["type"] != "exchange":
                self._answer(frames[0], message)
                continue
            if waiting is not None:
                before = waiting[1]
                if message["sequence"] <= before["sequence"] and self._desk.supersedes(
                    before, message
                ):
                    continue
                if not self._desk.supersedes(message, before):
                    self._answer(*waiting)
            waiting = (frames[0], message)
        if waiting is not None:
            self._answer(*waiting)

    def _decoded(self, frames: list[bytes]) -> dict[str, Any] | None:
        try:
            if len(frames) != 2:
                raise ProtocolError(f"a message of {len(frames) - 1} frames; it must be one")
            message = decode(frames[1], REQUESTS)
            self._desk.check(message)
        except ProtocolError as error:
            self._desk.counts["malformed"] += 1
            self._log.tell(f"dropped {error}", "malformed")
            return None
        return message

    def _answer(self, peer: bytes, message: dict[str, Any]) -> None:
        reply = self._desk.answer(peer, message)
        if reply is not None:
            try:
                self._sockets.requests.send_multipart([peer, reply], zmq.NOBLOCK)
            except zmq.ZMQError as error:
                self._log.tell(f"could not answer: {error}", "could not answer")

    def _publish(self, now: float) -> None:
        if now - self._published < _TELEMETRY:
            return
        number = self._desk.sample_number()
        if number != self._number or now - self._published > _SILENCE:
            self._published, self._number = now, number
            self._sockets.telemetry.send(self._desk.telemetry(), zmq.NOBLOCK)

    def _count_turned_away(self) -> None:
        number = self._sockets.turned_away()
        if number:
            self._desk.counts["turned away"] += number
            self._log.tell(
                "a peer was turned away: it has no key, a wrong one, or speaks no ZeroMQ",
                "turned away",
            )


@contextmanager
def heeded() -> Iterator[Signals]:
    """Take note of Ctrl-C, SIGTERM and SIGUSR1 while the context lasts.

    Yields
    ------
    Signals
    """
    signals = Signals()

    def end(number: int, frame: object) -> None:
        signals.ending = signal.Signals(number).name

    def stop(number: int, frame: object) -> None:
        signals.stopping = signal.Signals(number).name

    wanted = {"SIGINT": end, "SIGTERM": end, "SIGBREAK": end, "SIGHUP": end, "SIGUSR1": stop}
    there = {
        getattr(signal, name): handler for name, handler in wanted.items() if hasattr(signal, name)
    }
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # nohup
        del there[signal.SIGHUP]
    before = {number: signal.signal(number, handler) for number, handler in there.items()}
    try:
        yield signals
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _ready(settings: Settings, sockets: Sockets, rig: Rig) -> str:
    """Say in one line what is served, where, and what is allowed."""
    signals = rig.signals
    pace = "lockstep, no watchdog"
    if rig.watchdog:
        pace = f"real time at {settings.rate:g} Hz, watchdog {rig.watchdog:g} s"

    def listed(units: dict[str, str]) -> str:
        return (
            ", ".join(f"{name} [{unit}]{_limits(rig, name)}" for name, unit in units.items())
            or "nothing"
        )

    return (
        f"ready: {sockets.endpoint} (telemetry {sockets.telemetry_endpoint}), {settings.backend}, {pace}; "
        f"commands {listed(signals.inputs)}; measures {listed(signals.outputs)}"
    )


def _limits(rig: Rig, name: str) -> str:
    limit = rig.signals.limits.get(name)
    if limit is None:
        return ""
    text = f" {limit.min:g} to {limit.max:g}" if isfinite(limit.min) or isfinite(limit.max) else ""
    return text + (f" at most {limit.rate:g}/s" if isfinite(limit.rate) else "")
