"""Feed of the live page: recent samples and events of a rig, gathered from its telemetry.

A :class:`Listener` receives what the rig's server publishes, and asks for its status a few times a
second. A :class:`Feed` keeps it for pages that are opened, and says whether contact was lost.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from time import monotonic, time
from typing import Any

import zmq

from fmus.rig_proxy import REAL_TIME, protocol
from orchestration.rig.endpoint import Endpoint

MINUTE = 60.0  # s of samples that are kept for a page that is opened later
# s without a sign of life after which contact is lost, so that a page says so within a second
SILENCE = 0.7
_PERIODS = 3.0  # of the rig, without a sample, where that is longer
_SAMPLES = 2000  # a minute of 30 a second, and some
_ITEMS = 4000  # that a page may be behind, before it misses some
_EVENTS = 100
_AGAIN = 5.0  # s in which the same refusal is shown once
_LONGEST = 500  # characters of a text
_MOST = 64  # signals
_OVERTAKEN = 1.0  # s on the rig's clock; a step back that is larger is another server's clock
_ASKING = 0.3  # s between two requests for the status
_LOOK = 0.1  # s between two looks at whether contact was lost
_AT_ONCE = 200  # messages of one socket before the other has its turn
_LONGEST_END = 5.0  # s that the listening thread has to end


class Feed:
    """Samples, events and state of a rig for pages; any thread may call it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._items: deque[tuple[int, dict[str, Any]]] = deque(maxlen=_ITEMS)
        self._serial = 0
        self._rig: dict[str, Any] = {}
        self._samples: deque[dict[str, Any]] = deque(maxlen=_SAMPLES)
        self._events: deque[dict[str, Any]] = deque(maxlen=_EVENTS)
        self._contact = {"server": False, "samples": False}
        self._state: tuple[str, str, str] | None = None
        self._clock = -math.inf
        self._heard = -math.inf
        self._sampled = -math.inf
        self._refused: dict[str, float] = {}

    def status(self, message: Mapping[str, Any]) -> None:
        """Take a status of the server: what the rig is, and its state."""
        rig = {
            "mode": _text(message["mode"]),
            "period": message["period"],
            "watchdog": message["watchdog"],
            "inputs": _texts(message["inputs"]),
            "outputs": _texts(message["outputs"]),
            "limits": {_text(name): _numbers(limit) for name, limit in _few(message["limits"])},
        }
        with self._changed:
            self._heard = monotonic()
            if rig != self._rig:
                self._rig = rig
                self._add({"kind": "rig", **rig})
            self._observe(message)
            self._judge()

    def telemetry(self, message: Mapping[str, Any]) -> None:
        """Take a sample that the server published."""
        now = monotonic()
        refused = [_text(line) for line in message["refused"][:_MOST]]
        sample = {
            "kind": "sample",
            "at": now,
            "inputs": _numbers(message["inputs"]),
            "outputs": _numbers(message["outputs"]),
            "ages": _numbers(message["ages"]),
            "command_age": _number(message.get("command_age")),
        }
        with self._changed:
            self._heard = now
            self._sampled = now
            self._samples.append(sample)
            self._add(sample)
            self._observe(message)
            for line in refused:
                if now - self._refused.get(line, -math.inf) > _AGAIN:
                    self._event("refused", f"refused: {line}")
                    self._refused = {line: now} | dict(list(self._refused.items())[:_MOST])
            self._judge()

    def look(self) -> None:
        """Check whether contact was lost; to be called a few times a second."""
        with self._changed:
            self._judge()

    def event(self, kind: str, text: str) -> None:
        """Add an event for the pages."""
        with self._changed:
            self._event(kind, text)

    def everything(self) -> tuple[int, list[dict[str, Any]]]:
        """Return the number of the newest item, and what a page that was just opened needs."""
        with self._changed:
            first = monotonic() - MINUTE
            items = [{"kind": "rig", **self._rig}] if self._rig else []
            items += [{"kind": "contact", **self._contact}, *self._events]
            items += [self._state_item(*self._state)] if self._state else []
            items += [sample for sample in self._samples if sample["at"] >= first]
            return self._serial, items

    def since(self, serial: int, timeout: float) -> tuple[int, list[dict[str, Any]]]:
        """Wait for items that are newer than a number.

        Parameters
        ----------
        serial : int
            Of the newest one that the page has.
        timeout : float
            Longest wait, in s.

        Returns
        -------
        tuple of int and list of dict
            Number of the newest item, and the items; none if nothing happened.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._serial > serial, timeout)
            return self._serial, [item for number, item in self._items if number > serial]

    def _add(self, item: dict[str, Any]) -> None:
        self._serial += 1
        self._items.append((self._serial, item))
        self._changed.notify_all()

    def _event(self, kind: str, text: str) -> None:
        event = {"kind": "event", "what": kind, "when": time(), "text": text[:_LONGEST]}
        self._events.append(event)
        self._add(event)

    def _observe(self, message: Mapping[str, Any]) -> None:
        """Take the rig's state, unless the message was overtaken on its way, and note a change."""
        if self._clock - _OVERTAKEN < message["clock"] < self._clock:
            return
        self._clock = message["clock"]
        state = (_text(message["state"]), _text(message["reason"]), _text(message["client"]))
        if state != self._state:
            self._state = state
            self._add(self._state_item(*state))
            name, reason, client = state
            parts = (name, reason, client and f"client {client}")
            self._event(name, " · ".join(part for part in parts if part))

    @staticmethod
    def _state_item(state: str, reason: str, client: str) -> dict[str, Any]:
        return {"kind": "state", "state": state, "reason": reason, "client": client}

    def _judge(self) -> None:
        """Note whether the server is in contact, and whether samples arrive."""
        now = monotonic()
        patience = SILENCE
        if self._rig.get("mode") == REAL_TIME:
            patience = max(SILENCE, _PERIODS * self._rig["period"])
        # in lockstep there are samples when the client wants them
        is_lockstep = self._rig.get("mode", REAL_TIME) != REAL_TIME
        samples = now - self._sampled < patience or is_lockstep
        contact = {"server": now - self._heard < SILENCE, "samples": samples}
        if contact == self._contact:
            return
        was = self._contact
        self._contact = contact
        self._add({"kind": "contact", **contact})
        if contact["server"] != was["server"]:
            text = "contact with the rig's server" if contact["server"] else "contact lost"
            self._event("contact", text)
        elif contact["server"]:
            text = "samples arrive" if samples else "the server answers, but no samples arrive"
            self._event("contact", text)


class Listener:
    """A thread that feeds pages with the messages of a rig's server; a context manager.

    Parameters
    ----------
    remote : Endpoint
    feed : Feed
    """

    def __init__(self, remote: Endpoint, feed: Feed):
        self._remote = remote
        self._feed = feed
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rig telemetry", daemon=True)

    def __enter__(self) -> Listener:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ends.set()
        self._thread.join(_LONGEST_END)

    def _run(self) -> None:
        context = zmq.Context()
        telemetry = context.socket(zmq.SUB)
        requests = context.socket(zmq.DEALER)
        requests.immediate = True  # no queue of requests for a server that is not there
        self._remote.connect(telemetry, self._remote.telemetry)
        self._remote.connect(requests, self._remote.requests)
        telemetry.subscribe(b"")
        poller = zmq.Poller()
        next_request = monotonic()
        for socket in (telemetry, requests):
            poller.register(socket, zmq.POLLIN)
        while not self._ends.is_set():
            now = monotonic()
            if now >= next_request:
                next_request = now + _LOOK
                with suppress(zmq.Again):  # not connected yet
                    requests.send(protocol.encode("status"), zmq.DONTWAIT)
                    next_request = now + _ASKING
            for socket, _ in poller.poll(round(1000 * _LOOK)):
                self._take(socket)
            self._feed.look()
        context.destroy(linger=0)

    def _take(self, socket: zmq.Socket[bytes]) -> None:
        for _ in range(_AT_ONCE):
            try:
                frame = socket.recv(zmq.DONTWAIT)
            except zmq.Again:
                return
            with suppress(protocol.ProtocolError):
                message = protocol.decode(frame, protocol.REPLIES)
                if message["type"] == "telemetry":
                    self._feed.telemetry(message)
                elif message["type"] == "status":
                    self._feed.status(message)


def _text(value: Any) -> str:
    return str(value)[:_LONGEST]


def _few(mapping: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    return list(mapping.items())[:_MOST]


def _texts(mapping: Mapping[Any, Any]) -> dict[str, str]:
    return {_text(name): _text(value) for name, value in _few(mapping)}


def _number(value: Any) -> float | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and abs(value) < 1e300 else None


def _numbers(mapping: Mapping[Any, Any]) -> dict[str, float | None]:
    return {_text(name): _number(value) for name, value in _few(mapping)}
