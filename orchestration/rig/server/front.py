"""Front process of the server: it answers clients, publishes telemetry and heeds signals."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from math import isfinite
from time import monotonic, sleep
from typing import Any, NamedTuple

import psutil
import zmq

from fmus.kit import UserError, files
from fmus.rig_proxy import OPERATOR, REQUESTS, TELEMETRY, ProtocolError, decode
from orchestration.rig.access import Peer, received
from orchestration.rig.backends import device_names
from orchestration.rig.server.alarm_hook import AlarmHook
from orchestration.rig.server.archiver import archive_lock, archived
from orchestration.rig.server.device_lock import locked
from orchestration.rig.server.latch_file import LatchKeeper, make_latch_keeper
from orchestration.rig.server.lockstep import LockstepRig
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.real_time import RealTimeRig
from orchestration.rig.server.request_handler import RequestHandler
from orchestration.rig.server.rig import Rig
from orchestration.rig.server.scheduling import (
    FRONT,
    Collector,
    keep_libraries_to_one_thread,
    preferred,
)
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.sockets import Sockets, opened

_LONGEST_WAIT = 10  # ms for a message, before other work
_AT_ONCE = 200  # messages of a socket that are taken before other work
# s of rest after a turn that left messages: with its priority the front would keep the processor
# from everybody else, from an operator's stop above all
_REST = 0.002
_LONGEST_TURN = 0.005  # s that they get for it: an operator's stop waits no longer for clients
_TELEMETRY = 1 / 30  # s between two samples that are published, at least
_SILENCE = 0.2  # s between two messages of telemetry, at most
_LOOK = 0.1  # s between two looks at who was turned away, and at the memory, at least
# bytes that a server may come to take; a thousand peers with full queues take a third of it. ZeroMQ
# keeps what has arrived of a message until its last frame has, and a peer may never send that
_MOST_MEMORY = 2**30
_OF_OPERATORS = {kind: REQUESTS[kind] for kind in ("stop", "acknowledge", "shelve", "status")}
_OF_CLIENTS = {
    kind: fields for kind, fields in REQUESTS.items() if kind not in ("acknowledge", "shelve")
}


class ReceivedMessage(NamedTuple):
    """A message of a client, and its sender."""

    peer: Peer
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
    if settings.lockstep:
        return _serve(settings)
    keep_libraries_to_one_thread()
    with preferred(FRONT):  # before any thread is started, which has the same
        return _serve(settings)


def _serve(settings: ServerSettings) -> int:
    log = EventLog(settings.log)
    try:
        with files.kept() as found:
            devices = device_names(settings.backend, settings.options)
            settings = replace(settings, files=found)
        with (
            received_signals() as signals,
            locked([*devices, *archive_lock(settings.archive)]),
            opened(settings, log.tell) as sockets,
        ):
            keeper = make_latch_keeper(devices, settings.state, log.tell)
            rig = _opened_rig(settings, keeper, log)
            hook = _hook(settings, log)
            with archived(settings, rig, log) as archive:
                try:
                    log.tell(_describe_rig(settings, sockets, rig))
                    if settings.no_keys:
                        log.tell("WARNING: --no-keys: everybody on this machine may drive the rig")
                    for note in rig.signals.notes:
                        log.tell(note)
                    handler = RequestHandler(
                        rig, settings.period, log, keeper, hook, sockets.admission
                    )
                    EventLoop(sockets, handler, log, signals, archive).run()
                finally:
                    trouble = _close(rig, log, signals)
                    if not trouble:
                        keeper.end()
                        ending = signals.ending or "the server failed"
                        log.tell(f"ended, in the safe state: {ending}")
    finally:
        log.close()
    return 1 if trouble else 0


def _hook(settings: ServerSettings, log: EventLog) -> Callable[[Mapping[str, Any]], None]:
    """Return what is called with each alarm."""
    if settings.alarm_hook is None:
        return lambda fields: None
    return AlarmHook(settings.alarm_hook, lambda line: log.tell(line, "alarm hook")).announce


def _opened_rig(settings: ServerSettings, keeper: LatchKeeper, log: EventLog) -> Rig:
    """Open the rig, in lockstep or in real time."""
    try:
        return LockstepRig(settings) if settings.lockstep else RealTimeRig(settings, log.tell)
    except UserError:
        keeper.end()  # this server has not touched the rig, so that the next one need not latch it
        raise


def _close(rig: Rig, log: EventLog, signals: ReceivedSignals) -> str:
    """End with the rig in its safe state, or at another signal; return why it is not there."""
    cause = signals.ending
    trouble = rig.close()
    signals.ending = ""
    if trouble:
        log.tell(
            f"THE SAFE STATE WAS NOT REACHED: {trouble}; the server goes on trying, until another"
            " signal ends it"
        )
    while trouble and not signals.ending:
        trouble = rig.close()
    if trouble:
        rig.kill()
        log.tell(f"given up by {signals.ending}: THE SAFE STATE WAS NOT REACHED: {trouble}")
    signals.ending = cause
    return trouble


class EventLoop:
    """The loop around the sockets of the server.

    Parameters
    ----------
    sockets : Sockets
    handler : RequestHandler
    log : EventLog
    signals : ReceivedSignals
    archive : callable
        Called with the state of the rig in every turn.
    """

    def __init__(
        self,
        sockets: Sockets,
        handler: RequestHandler,
        log: EventLog,
        signals: ReceivedSignals,
        archive: Callable[[str], None] = lambda state: None,
    ) -> None:
        self._sockets = sockets
        self._handler = handler
        self._log = log
        self._signals = signals
        self._holders = sockets.admission.holders
        self._archive = archive
        self._looked = 0.0
        self._published = 0.0
        self._number = -1
        self._is_flooded = False
        self._process = psutil.Process()
        self._most_memory = self._process.memory_info().rss + _MOST_MEMORY
        self._poller = zmq.Poller()
        for socket in (sockets.operators, sockets.requests):
            self._poller.register(socket, zmq.POLLIN)

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
            self._archive(self._handler.state())
            self._publish(now)
            if now - self._looked > _LOOK:
                self._looked = now
                self._count_turned_away()
                self._turn_away_subscribers()
                self._watch_memory()
            collector.collect(now)

    def _take_messages(self) -> None:
        """Answer the messages that have arrived, a bounded number; wait a moment for the first.

        Operators come first. An exchange is held back until the last message of clients is read,
        for a newer one makes it useless.
        """
        if self._is_flooded:
            sleep(_REST)
        self._is_flooded = False
        self._poller.poll(_LONGEST_WAIT)
        operators = self._sockets.operators
        for request in self._received(operators, _OF_OPERATORS):
            self._answer(operators, request)
        newest: ReceivedMessage | None = None
        for request in self._received(self._sockets.requests, _OF_CLIENTS):
            if request.message["type"] != "exchange":
                self._answer(self._sockets.requests, request)
            elif newest is None:
                newest = request
            else:
                newest = self._newer_exchange(newest, request)
        if newest is not None:
            self._answer(self._sockets.requests, newest)

    def _received(
        self, socket: zmq.Socket[bytes], known: dict[str, dict[str, Any]]
    ) -> Iterator[ReceivedMessage]:
        """Yield the messages that have arrived at a socket, a bounded number in a bounded time."""
        until = monotonic() + _LONGEST_TURN
        for _ in range(_AT_ONCE):
            try:
                peer, frames = received(socket, self._sockets.admission)
            except zmq.Again:
                return
            message = self._decoded(peer, frames, known)
            if message is not None:
                yield ReceivedMessage(peer, message)
            if monotonic() > until:
                break
        self._is_flooded = True

    def _newer_exchange(self, held: ReceivedMessage, arrived: ReceivedMessage) -> ReceivedMessage:
        """Return the newer of two exchanges; the other is dropped if it may be, else answered.

        Messages may overtake each other, so the one that arrives later may be the older one.
        """
        overtaken = arrived.message["sequence"] <= held.message["sequence"]
        if overtaken and self._handler.drop_earlier(held.message, arrived.message):
            return held
        if not self._handler.drop_earlier(arrived.message, held.message):
            self._answer(self._sockets.requests, held)
        return arrived

    def _decoded(
        self, peer: Peer, frames: list[bytes], known: dict[str, dict[str, Any]]
    ) -> dict[str, Any] | None:
        """Return the message in frames; None, counted and logged, if it cannot be answered."""
        if not peer.has_name:
            self._handler.counts["turned away"] += 1
            self._log.tell(f"dropped a message of a peer without a name at {peer}", "no name")
            return None
        try:
            if len(frames) != 1:
                raise ProtocolError(f"a message of {len(frames)} frames; it must be one")
            message = decode(frames[0], known)
            self._handler.check(message)
        except ProtocolError as error:
            self._handler.counts["malformed"] += 1
            self._log.tell(f"dropped {error}, of {peer}", "malformed")
            return None
        return message

    def _answer(self, socket: zmq.Socket[bytes], request: ReceivedMessage) -> None:
        """Carry out a message, and send its reply if there is one and the peer takes it."""
        reply = self._handler.answer(*request)
        if reply is not None:
            try:
                socket.send_multipart([request.peer.connection, reply], zmq.NOBLOCK)
            except zmq.ZMQError as error:
                self._log.tell(f"no answer to {request.peer}: {error}", "could not answer")

    def _publish(self, now: float) -> None:
        """Publish a new sample if the last was a while ago; after a silence the same one again."""
        if now - self._published < _TELEMETRY:
            return
        number = self._handler.sample_number()
        if number != self._number or now - self._published > _SILENCE:
            self._published = now
            self._number = number
            if not self._sockets.telemetry.publish(self._handler.telemetry()):
                self._log.tell(
                    "telemetry begins anew: somebody asked for many topics, and it has none",
                    "topics",
                )

    def _count_turned_away(self) -> None:
        """Count and log the peers that were turned away since the last call."""
        number = self._sockets.turned_away()
        if number:
            self._handler.counts["turned away"] += number
            self._log.tell(
                "a peer was turned away: it has no key, a wrong one, or does not speak ZMTP 3",
                "turned away",
            )

    def _turn_away_subscribers(self) -> None:
        """Let all subscribers connect anew when the keys that are let in have changed."""
        holders = self._sockets.admission.holders
        if holders is not self._holders:
            self._holders = holders
            self._sockets.telemetry.close()

    def _watch_memory(self) -> None:
        """End the server, latched, before a peer has filled the memory of the machine."""
        try:
            taken = self._process.memory_info().rss
        except OSError:  # no descriptor is left to look with; the rig is served without
            return
        if taken > self._most_memory:
            self._signals.ending = f"a peer filled {_MOST_MEMORY / 2**20:.0f} MiB of memory"
            self._handler.stop(self._signals.ending)


@contextmanager
def received_signals() -> Iterator[ReceivedSignals]:
    r"""Record signals while the context lasts.

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
    available = {}  # on this platform
    for name, handler in handlers.items():
        if hasattr(signal, name):
            available[getattr(signal, name)] = handler
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # nohup
        del available[signal.SIGHUP]
    before = {number: signal.signal(number, handler) for number, handler in available.items()}
    try:
        yield signals
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)


def _describe_rig(settings: ServerSettings, sockets: Sockets, rig: Rig) -> str:
    """Return a line with the rig that is served, its addresses and its limits."""
    signals = rig.signals
    pace = "lockstep, no watchdog"
    if rig.watchdog:
        pace = (
            f"real time at {settings.rate:g} Hz, watchdog {rig.watchdog:g} s, safe within"
            f" {rig.bound:.3g} s"
        )

    def listed(units: dict[str, str]) -> str:
        items = [f"{name} [{unit}]{_describe_limits(rig, name)}" for name, unit in units.items()]
        return ", ".join(items) or "nothing"

    telemetry = sockets.endpoint(TELEMETRY)
    operators = sockets.endpoint(OPERATOR)
    return (
        f"ready: {sockets.endpoint()} (telemetry {telemetry}, operators {operators}),"
        f" {settings.backend}, {pace}; commands {listed(signals.inputs)}; measures"
        f" {listed(signals.outputs)}"
    )


def _describe_limits(rig: Rig, name: str) -> str:
    """Return the limits of a signal in words; empty if it has none."""
    limit = rig.signals.limits.get(name)
    if limit is None:
        return ""
    text = ""
    if isfinite(limit.min) or isfinite(limit.max):
        text += f" {limit.min:g} to {limit.max:g}"
    if isfinite(limit.rate):
        text += f" at most {limit.rate:g}/s"
    return text
