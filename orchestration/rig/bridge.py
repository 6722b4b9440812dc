"""Bridge from plain connections on this machine to an encrypted connection with a rig's server.

It is for proxies that cannot encrypt: plain ZeroMQ on this machine, CURVE beyond it.

Every client here gets a connection of its own to the server, so that the server tells them apart as
if they had connected to it. Nothing is stored: what cannot be carried on within a second is
dropped, because a command that is late is no command, and the client's own timeouts act.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from time import monotonic

import zmq

from fmus.kit import UserError
from fmus.rig_proxy import MAX_FRAME
from orchestration.rig.endpoint import Endpoint, bound_queues

LOOPBACK = "127.0.0.1"
# connections at a time; beyond, the one that was silent for the longest time is closed
_MOST_CLIENTS = 32
_WAITING = 8  # frames of a client that are kept while its connection to the server comes about
_LATEST = 1.0  # s; a frame that has waited for longer is dropped
_SOON = 0.005  # s between two attempts to carry on what waits
_TURN = 0.1  # s between two looks at whether anything has to be dropped or reported
_SILENCE = 2.0  # s without telemetry after which the server is said to be silent
_AT_ONCE = 100  # frames taken from one socket before the others have their turn


class _Client:
    """The connection to the server that belongs to one client on this machine."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], remote: Endpoint):
        self.socket = context.socket(zmq.DEALER)
        # no queue for a server that is not there: an old command must never arrive
        self.socket.immediate = True
        remote.connect(self.socket, remote.requests)
        self._waiting: deque[tuple[float, bytes]] = deque(maxlen=_WAITING)

    def send(self, frame: bytes, now: float) -> None:
        """Carry a frame to the server, at once if it is there."""
        self._waiting.append((now, frame))
        self.flush(now)

    def flush(self, now: float) -> None:
        """Carry on what waits, and drop what has waited for too long."""
        while self._waiting:
            since, frame = self._waiting[0]
            if now - since <= _LATEST:
                try:
                    self.socket.send(frame, zmq.DONTWAIT)
                except zmq.Again:
                    return
            self._waiting.popleft()

    @property
    def waits(self) -> bool:
        """True if there are frames to be carried on."""
        return bool(self._waiting)


class Bridge:
    """A bridge, bound as soon as it is made; :meth:`run` carries messages until it is interrupted.

    Parameters
    ----------
    remote : Endpoint
        The server, with keys.
    port : int
        Of the requests on this machine; telemetry is one higher. On the loopback address, and
        nowhere else.
    tell : callable
        Called with a line when the server falls silent or is heard again.

    Raises
    ------
    UserError
        If a port is taken.
    """

    def __init__(
        self, remote: Endpoint, port: int, tell: Callable[[str], None] = lambda text: None
    ):
        self._remote = remote
        self._tell = tell
        self._clients: OrderedDict[bytes, _Client] = OrderedDict()
        self._heard = monotonic()
        self._is_silent: bool | None = None  # as was reported; None: nothing yet
        with ExitStack() as opened:
            self._context = zmq.Context()
            opened.callback(self._context.destroy, 0)
            self._requests = self._context.socket(zmq.ROUTER)
            self._telemetry = self._context.socket(zmq.PUB)
            for socket, number in ((self._requests, port), (self._telemetry, port + 1)):
                bound_queues(socket)
                _bind(socket, number)
            self._source = self._context.socket(zmq.SUB)
            remote.connect(self._source, remote.telemetry)
            self._source.subscribe(b"")
            self._poller = zmq.Poller()
            for socket in (self._requests, self._source):
                self._poller.register(socket, zmq.POLLIN)
            opened.pop_all()

    def close(self) -> None:
        """Close all sockets; messages under way are dropped."""
        self._context.destroy(linger=0)

    def run(self) -> None:
        """Carry messages until an exception such as KeyboardInterrupt, then close everything."""
        try:
            while True:
                wait = _SOON if any(client.waits for client in self._clients.values()) else _TURN
                self._turn({socket for socket, _ in self._poller.poll(round(1000 * wait))})
        finally:
            self.close()

    def _turn(self, ready: set[object]) -> None:
        now = monotonic()
        if self._requests in ready:
            for identity, frame in _frames(self._requests, 2):
                self._client(identity).send(frame, now)
        if self._source in ready:
            self._heard = now
            for (frame,) in _frames(self._source, 1):
                self._telemetry.send(frame, zmq.DONTWAIT)
        for identity, client in self._clients.items():
            if client.socket in ready:
                for (frame,) in _frames(client.socket, 1):
                    self._requests.send_multipart((identity, frame), zmq.DONTWAIT)
            if client.waits:
                client.flush(now)
        self._report_contact(now)

    def _client(self, identity: bytes) -> _Client:
        client = self._clients.get(identity)
        if client is None:
            if len(self._clients) >= _MOST_CLIENTS:
                _, silent = self._clients.popitem(last=False)
                self._poller.unregister(silent.socket)
                silent.socket.close()
            client = _Client(self._context, self._remote)
            self._clients[identity] = client
            self._poller.register(client.socket, zmq.POLLIN)
        self._clients.move_to_end(identity)
        return client

    def _report_contact(self, now: float) -> None:
        """Report that the server is heard, or silent, when that is news."""
        if now == self._heard:  # telemetry came in this turn
            is_silent = False
        elif now - self._heard > _SILENCE:
            is_silent = True
        else:
            return
        if is_silent == self._is_silent:
            return
        self._is_silent = is_silent
        if is_silent:
            reasons = "the server does not run, the network is down, or the keys do not match"
            self._tell(f"nothing is heard from {self._remote.requests}: {reasons}")
        else:
            self._tell(f"{self._remote.requests} is heard")


def _bind(socket: zmq.Socket[bytes], port: int) -> None:
    address = f"tcp://{LOOPBACK}:{port}"
    try:
        socket.bind(address)
    except zmq.ZMQError as error:
        raise UserError(
            f"cannot listen at {address}: {error.strerror}; --port chooses another one"
        ) from error


def _frames(socket: zmq.Socket[bytes], parts: int) -> Iterator[list[bytes]]:
    """Yield messages that have arrived, a bounded number, without those the protocol forbids."""
    for _ in range(_AT_ONCE):
        try:
            message = socket.recv_multipart(zmq.DONTWAIT)
        except zmq.Again:
            return
        if len(message) == parts and len(message[-1]) <= MAX_FRAME:
            yield message
