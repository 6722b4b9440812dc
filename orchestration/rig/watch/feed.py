"""Feed of the live page: recent samples and events of a rig, gathered from its telemetry.

A :class:`Listener` receives the telemetry of the rig's server, and asks for its status a few times
a second. A :class:`Feed` keeps it for pages that are opened, and says whether contact was lost.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import islice
from time import monotonic, time
from typing import Any, NamedTuple

import zmq

from fmus.kit import quoting
from fmus.rig_proxy import IDLE, LATCHED, LOCKSTEP, REAL_TIME, RUNNING, SAFE, protocol
from orchestration.rig.endpoint import Endpoint
from orchestration.rig.watch.transit import TransitBound

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
_UNANSWERED = 2.0  # s after which a request is given up, with its connection; as `ask` has it
_LOOK = 0.1  # s between two looks at whether contact was lost
_STATES = (IDLE, RUNNING, *LATCHED)
_AT_ONCE = 200  # messages of one socket before the other has its turn
_LONGEST_END = 5.0  # s that the listening thread has to end


class Update(NamedTuple):
    """Items that a page does not have yet.

    Attributes
    ----------
    serial : int
        Number of the newest item.
    first : bool
        True if `items` are all that a page needs that has none: it was just opened, or those that
        it misses are not all kept any more.
    items : list of dict
    """

    serial: int
    first: bool
    items: list[dict[str, Any]]


class Feed:
    """Samples, events and state of a rig for pages; any thread may call its methods."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._items: deque[dict[str, Any]] = deque(maxlen=_ITEMS)
        self._serial = 0
        self._rig: dict[str, Any] = {}
        self._samples: deque[dict[str, Any]] = deque(maxlen=_SAMPLES)
        self._events: deque[dict[str, Any]] = deque(maxlen=_EVENTS)
        self._contact = {"server": False, "samples": False}
        self._condition: dict[str, Any] = {}
        self._transit = TransitBound()
        self._clock = -math.inf
        self._heard = -math.inf
        self._sampled = -math.inf
        self._refused: dict[str, float] = {}
        self._parameters: dict[str, Any] = {}

    def take_parameters(self, parameters: Mapping[str, Any]) -> None:
        """Store the tunable parameters of the run beside the rig, none where there is no run."""
        known = {}
        for name, about in _bounded_items(parameters):
            numbers = {key: _number(about[key]) for key in ("value", "target", "min", "max")}
            known[_text(name)] = numbers | {key: _text(about[key]) for key in ("unit", "doc")}
        with self._lock:
            if known != self._parameters:
                self._parameters = known
                self._add({"kind": "parameters", "parameters": known})

    def take_status(self, message: Mapping[str, Any], sent: float | None = None) -> None:
        """Store a status of the server: the rig's description and its state.

        Parameters
        ----------
        message : Mapping
        sent : float, optional
            Time at which it was requested, in s of :func:`time.monotonic`; it bounds transit times.
        """
        now = monotonic()
        rig = {
            "mode": _text(message["mode"]),
            "period": message["period"],
            "watchdog": message["watchdog"],
            "inputs": _texts(message["inputs"]),
            "outputs": _texts(message["outputs"]),
            "limits": {
                _text(name): _numbers(limit) for name, limit in _bounded_items(message["limits"])
            },
        }
        with self._lock:
            self._heard = now
            if sent is not None:
                self._transit.take_round_trip(sent, message["clock"], now)
            if rig != self._rig:
                self._rig = rig
                self._add({"kind": "rig", **rig})
            self._update_condition(message)
            self._update_contact()

    def take_telemetry(self, message: Mapping[str, Any]) -> None:
        """Store a sample that the server published, and add its refusals as events."""
        now = monotonic()
        refused = [_text(line) for line in message["refused"][:_MOST]]
        sample = {
            "kind": "sample",
            "at": now,
            "inputs": _numbers(message["inputs"]),
            "read_back": _numbers(message["read_back"]),
            "outputs": _numbers(message["outputs"]),
            "ages": _numbers(message["ages"]),
            "command_age": _number(message["command_age"]),
        }
        with self._lock:
            self._heard = now
            self._sampled = now
            sample["transit"] = self._transit_time(message["clock"], now)
            self._samples.append(sample)
            self._add(sample)
            self._update_condition(message)
            for line in refused:
                if now - self._refused.get(line, -math.inf) > _AGAIN:
                    self._event("refused", f"refused: {line}")
                    known = [entry for entry in self._refused.items() if entry[0] != line]
                    self._refused = dict([(line, now), *known[: _MOST - 1]])
            self._update_contact()

    def check_contact(self) -> None:
        """Add an event if contact was lost; to be called a few times a second."""
        with self._lock:
            self._update_contact()

    def event(self, kind: str, text: str) -> None:
        """Add an event for the pages."""
        with self._lock:
            self._event(kind, text)

    def condition(self) -> tuple[int, dict[str, Any]]:
        """Return the number of the newest item, and the newest state of the rig; empty without."""
        with self._lock:
            return self._serial, self._condition

    def since(self, serial: int) -> Update:
        """Return the items that a page needs after an item of a given number.

        Parameters
        ----------
        serial : int
            Number of the newest item that the page has; -1 if it was just opened.

        Returns
        -------
        Update
        """
        with self._lock:
            missed = self._serial - serial
            if not 0 <= missed <= len(self._items):
                return Update(self._serial, True, self._everything())
            newest = list(islice(reversed(self._items), missed))
            return Update(self._serial, False, newest[::-1])

    def _everything(self) -> list[dict[str, Any]]:
        """Return the items for a page that was just opened: the present state, and a minute."""
        first = monotonic() - MINUTE
        items = [{"kind": "rig", **self._rig}] if self._rig else []
        items += [{"kind": "contact", **self._contact}, *self._events]
        items += [self._condition] if self._condition else []
        items.append({"kind": "parameters", "parameters": self._parameters})
        items += [sample for sample in self._samples if sample["at"] >= first]
        return items

    def _add(self, item: dict[str, Any]) -> None:
        self._serial += 1
        self._items.append(item)

    def _event(self, kind: str, text: str) -> None:
        event = {"kind": "event", "what": kind, "when": time(), "text": _text(text)}
        self._events.append(event)
        self._add(event)

    def _transit_time(self, clock: float, received: float) -> float | None:
        """Return the longest possible transit time of a sample in s; None if it is unknown."""
        if self._rig.get("mode") == LOCKSTEP:
            return 0.0  # where the rig's time stands still meanwhile
        return self._transit.transit_time(clock, received)

    def _update_condition(self, message: Mapping[str, Any]) -> None:
        """Store the rig's state unless a newer message overtook this one; add events of changes."""
        if self._clock - _OVERTAKEN < message["clock"] < self._clock:
            return
        self._clock = message["clock"]
        condition = {
            "kind": "state",
            **{name: _text(message[name]) for name in ("state", "reason", "client", "latch")},
            "reached": _number(message["reached"]),
            "alarm": _text(message["alarm"]),
            "verified": message.get("verified") is not False,  # a server need not say it
            "operator": _text(message.get("operator", "")),  # nor this
        }
        before = self._condition
        if condition == before:
            return
        self._condition = condition
        self._add(condition)
        if condition["alarm"] and condition["alarm"] != before.get("alarm"):
            self._event("alarm", f"ALARM: {condition['alarm']}")
        if _summarise(condition) != _summarise(before):
            kind = condition["state"] if condition["state"] in _STATES else "unknown"
            self._event(kind, _summarise(condition))

    def _update_contact(self) -> None:
        """Check whether the server is heard and samples arrive; add an event for a change."""
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
    observe : callable
        Called with each message of telemetry.
    """

    def __init__(
        self,
        remote: Endpoint,
        feed: Feed,
        observe: Callable[[Mapping[str, Any]], None] = lambda message: None,
    ):
        self._remote = remote
        self._feed = feed
        self._observe = observe
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rig telemetry", daemon=True)

    def __enter__(self) -> Listener:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ends.set()
        self._thread.join(_LONGEST_END)

    def _run(self) -> None:
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        telemetry = context.socket(zmq.SUB)
        self._remote.connect(telemetry, self._remote.telemetry)
        telemetry.subscribe(b"")
        requests = _StatusRequests(context, self._remote)
        while not self._ends.is_set():
            requests.send_due()
            readable, _, _ = zmq.select([telemetry, requests.socket], [], [], _LOOK)
            for socket in readable:
                for message in _received(socket):
                    self._take(message, requests)
            self._feed.check_contact()
        context.destroy(linger=0)

    def _take(self, message: dict[str, Any], requests: _StatusRequests) -> None:
        """Hand a message of the server to the feed."""
        if message["type"] == "telemetry":
            self._feed.take_telemetry(message)
            self._observe(message)
        elif message["type"] == "status":
            self._feed.take_status(message, requests.take_answer())


class _StatusRequests:
    """Requests for the status of a rig, one at a time, so that an answer belongs to the last one.

    Parameters
    ----------
    context : zmq.Context
    remote : Endpoint

    Attributes
    ----------
    socket : zmq.Socket
        Receives the answers; replaced after a request that was not answered.
    """

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], remote: Endpoint):
        self._context = context
        self._remote = remote
        self._next = monotonic()
        self._open()

    def _open(self) -> None:
        self.socket = self._context.socket(zmq.DEALER)
        self.socket.immediate = True  # no queue of requests for a server that is not there
        self._remote.connect(self.socket, self._remote.operators)
        self._sent: float | None = None

    def send_due(self) -> None:
        """Send the next request, if it is time."""
        now = monotonic()
        if self._sent is not None and now - self._sent > _UNANSWERED:
            self.socket.close(linger=0)
            self._open()
        if self._sent is None and now >= self._next:
            self._next = now + _LOOK
            with suppress(zmq.Again):  # not connected yet
                self.socket.send(protocol.encode("status"), zmq.DONTWAIT)
                self._sent = now
                self._next = now + _ASKING

    def take_answer(self) -> float | None:
        """Return the time in s at which the request was sent that has now been answered."""
        sent = self._sent
        self._sent = None
        return sent


def _received(socket: zmq.Socket[bytes]) -> Iterator[dict[str, Any]]:
    """Yield the messages that have arrived, a bounded number."""
    for _ in range(_AT_ONCE):
        try:
            frame = socket.recv(zmq.DONTWAIT)
        except zmq.Again:
            return
        with suppress(protocol.ProtocolError):
            yield protocol.decode(frame, protocol.REPLIES)


def _summarise(condition: Mapping[str, Any]) -> str:
    """Summarise a state for the list of events."""
    if not condition:
        return ""
    state = condition["state"]
    if state == SAFE and condition["reached"] is not None:
        doubt = "" if condition["verified"] else "; commanded safe, not verified"
        state += f" (reached after {1000 * condition['reached']:.0f} ms{doubt})"
    client = condition["client"]
    parts = (state, condition["reason"], client and f"client {client}")
    return " · ".join(part for part in parts if part)


def _text(value: Any) -> str:
    """Return a text of bounded length in which nothing is invisible or turns its direction."""
    return quoting.visible(str(value)[:_LONGEST])[:_LONGEST]


def _bounded_items(mapping: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    return list(mapping.items())[:_MOST]


def _texts(mapping: Mapping[Any, Any]) -> dict[str, str]:
    return {_text(name): _text(value) for name, value in _bounded_items(mapping)}


def _number(value: Any) -> float | None:
    """Return a finite number, which JSON can hold; None for anything else."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and abs(value) < 1e300 else None


def _numbers(mapping: Mapping[Any, Any]) -> dict[str, float | None]:
    return {_text(name): _number(value) for name, value in _bounded_items(mapping)}
