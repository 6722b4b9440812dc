"""Front process of the server: it answers clients, publishes telemetry and heeds signals."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from time import monotonic
from typing import Any, NamedTuple

import zmq

from fmus.rig_proxy import REQUESTS, ProtocolError, decode
from orchestration.rig.server.lockstep import LockstepRig
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.real_time import RealTimeRig
from orchestration.rig.server.request_handler import RequestHandler
from orchestration.rig.server.rig import Rig
from orchestration.rig.server.scheduling import Collector
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.sockets import Sockets, opened

_LONGEST_WAIT = 10  # ms for a message, before whatever else there is to do
_AT_ONCE = 200  # messages that are taken before whatever else there is to do
_TELEMETRY = 1 / 30  # s between two samples that are published, at least
_SILENCE = 0.2  # s between two messages of telemetry, at most
_LOOK = 0.1  # s between two looks at who was turned away, at least


class ReceivedMessage(NamedTuple):
    """A message of a client, and ZeroMQ's name of the connection that it came by."""

    peer: bytes
    message: dict[str, Any]


class ReceivedSignals:
    """Names of the signals of the operating system that ask to end or to stop; empty without."""

    ending = ""
    stopping = ""


def serve(settings: ServerSettings) -> int:
    """Serve a rig until a signal ends it.

    Parameters
    ----------
    settings : ServerSettings

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
        with received_signals() as signals, opened(settings, log.tell) as sockets:
            rig: Rig = LockstepRig(settings) if settings.lockstep else RealTimeRig(settings)
            trouble = "the server failed"
            try:
                log.tell(_ready(settings, sockets, rig))
                for note in rig.signals.notes:
                    log.tell(note)
                Front(sockets, RequestHandler(rig, settings.period, log), log, signals).run()
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
    """The loop around the two sockets of the server.

    Parameters
    ----------
    sockets : Sockets
    handler : RequestHandler
    log : EventLog
    signals : ReceivedSignals
    """

    def __init__(
        self, sockets: Sockets, handler: RequestHandler, log: EventLog, signals: ReceivedSignals
    ) -> None:
        self._sockets = sockets
        self._handler = handler
        self._log = log
        self._signals = signals
        self._looked = 0.0
        self._published = 0.0
        self._number = -1
        sockets.requests.rcvtimeo = _LONGEST_WAIT

    def run(self) -> None:
        """Serve until a signal ends it."""
        collector = Collector()
        while not self._signals.ending:
            self._take_messages()
            if self._signals.ending:
                break  # before the rig is supervised: the signal may have ended the guard as well
            self._handler.beat()
            now = monotonic()
            if self._signals.stopping:
                self._handler.stop(self._signals.stopping)
                self._signals.stopping = ""
            self._handler.supervise()
            self._publish(now)
            if now - self._looked > _LOOK:
                self._looked = now
                self._count_turned_away()
            collector.collect(now)

    def _take_messages(self) -> None:
        """Answer all messages that have arrived.

        An exchange is held back until the last of them is read, for a newer one makes it useless.
        """
        held: ReceivedMessage | None = None
        for received in self._received():
            if received.message["type"] != "exchange":
                self._answer(*received)
            elif held is None:
                held = received
            else:
                held = self._newer_exchange(held, received)
        if held is not None:
            self._answer(*held)

    def _received(self) -> Iterator[ReceivedMessage]:
        """Yield the messages that have arrived, a bounded number; wait a moment for the first."""
        flags = 0
        for _ in range(_AT_ONCE):
            try:
                frames = self._sockets.requests.recv_multipart(flags)
            except zmq.Again:
                return
            flags = zmq.NOBLOCK
            message = self._decoded(frames)
            if message is not None:
                yield ReceivedMessage(frames[0], message)

    def _newer_exchange(self, held: ReceivedMessage, arrived: ReceivedMessage) -> ReceivedMessage:
        """Return the newer of two exchanges; the other is dropped, or answered if it still counts.

        Messages may overtake each other, so what arrived later may be the older one.
        """
        overtaken = arrived.message["sequence"] <= held.message["sequence"]
        if overtaken and self._handler.supersedes(held.message, arrived.message):
            return held
        if not self._handler.supersedes(arrived.message, held.message):
            self._answer(*held)
        return arrived

    def _decoded(self, frames: list[bytes]) -> dict[str, Any] | None:
        try:
            if len(frames) != 2:
                raise ProtocolError(f"a message of {len(frames) - 1} frames; it must be one")
            message = decode(frames[1], REQUESTS)
            self._handler.check(message)
        except ProtocolError as error:
            self._handler.counts["malformed"] += 1
            self._log.tell(f"dropped {error}", "malformed")
            return None
        return message

    def _answer(self, peer: bytes, message: dict[str, Any]) -> None:
        reply = self._handler.answer(peer, message)
        if reply is not None:
            try:
                self._sockets.requests.send_multipart([peer, reply], zmq.NOBLOCK)
            except zmq.ZMQError as error:
                self._log.tell(f"could not answer: {error}", "could not answer")

    def _publish(self, now: float) -> None:
        if now - self._published < _TELEMETRY:
            return
        number = self._handler.sample_number()
        if number != self._number or now - self._published > _SILENCE:
            self._published = now
            self._number = number
            self._sockets.telemetry.send(self._handler.telemetry(), zmq.NOBLOCK)

    def _count_turned_away(self) -> None:
        number = self._sockets.turned_away()
        if number:
            self._handler.counts["turned away"] += number
            self._log.tell(
                "a peer was turned away: it has no key, a wrong one, or speaks no ZeroMQ",
                "turned away",
            )


@contextmanager
def received_signals() -> Iterator[ReceivedSignals]:
    r"""Take note of signals while the context lasts.

    Ctrl-C, SIGQUIT, SIGTERM and a closed terminal end the server; SIGUSR1 stops the rig. Ctrl-Z
    pauses the server: device and guard hear nothing of it then, and bring the rig to its safe
    state.

    Yields
    ------
    ReceivedSignals
    """
    signals = ReceivedSignals()

    def end(number: int, frame: object) -> None:
        signals.ending = signal.Signals(number).name

    def stop(number: int, frame: object) -> None:
        signals.stopping = signal.Signals(number).name

    handlers = dict.fromkeys(("SIGINT", "SIGTERM", "SIGBREAK", "SIGHUP", "SIGQUIT"), end)
    handlers["SIGUSR1"] = stop
    there = {}  # on this platform
    for name, handler in handlers.items():
        if hasattr(signal, name):
            there[getattr(signal, name)] = handler
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # nohup
        del there[signal.SIGHUP]
    before = {number: signal.signal(number, handler) for number, handler in there.items()}
    try:
        yield signals
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)


def _ready(settings: ServerSettings, sockets: Sockets, rig: Rig) -> str:
    """Return a line about what is served, where, and what is allowed."""
    signals = rig.signals
    pace = "lockstep, no watchdog"
    if rig.watchdog:
        pace = (
            f"real time at {settings.rate:g} Hz, watchdog {rig.watchdog:g} s, safe within"
            f" {rig.bound:.3g} s"
        )

    def listed(units: dict[str, str]) -> str:
        items = [f"{name} [{unit}]{_limits(rig, name)}" for name, unit in units.items()]
        return ", ".join(items) or "nothing"

    return (
        f"ready: {sockets.endpoint} (telemetry {sockets.telemetry_endpoint}), {settings.backend},"
        f" {pace}; commands {listed(signals.inputs)}; measures {listed(signals.outputs)}"
    )


def _limits(rig: Rig, name: str) -> str:
    limit = rig.signals.limits.get(name)
    if limit is None:
        return ""
    text = ""
    if isfinite(limit.min) or isfinite(limit.max):
        text += f" {limit.min:g} to {limit.max:g}"
    if isfinite(limit.rate):
        text += f" at most {limit.rate:g}/s"
    return text
