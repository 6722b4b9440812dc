"""Bridge from plain connections on this machine to an encrypted connection with a rig's server.

It is for proxies that cannot encrypt: plain ZeroMQ on this machine, CURVE beyond it. As a server
does, it leaves a key for its user's clients: nobody else on this machine drives the rig through it.

Every client here gets a connection of its own to the server, so that the server tells them apart as
if they had connected to it. Nothing is stored: a message that cannot be sent within a second is
dropped, because a command that is late is no command, and the client's own timeouts act.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from time import monotonic

import zmq

from fmus.kit import UserError
from fmus.rig_proxy import (
    MAX_FRAME,
    OPERATOR,
    REQUESTS,
    TELEMETRY,
    ProtocolError,
    decode,
    encode,
)
from orchestration.rig.access import (
    EVERYBODY,
    Admission,
    Peer,
    access_control,
    guard_access,
    received,
    user_admission,
)
from orchestration.rig.endpoint import Endpoint, bound_queues

LOOPBACK = "127.0.0.1"
# connections of a socket at a time; beyond, the one that was silent for the longest time is closed
_MOST_CLIENTS = 32
_WAITING = 8  # frames of a client that are kept while its connection to the server comes about
_LATEST = 1.0  # s; a frame that has waited for longer is dropped
_SOON = 0.005  # s between two attempts to send waiting messages
_TURN = 0.1  # s between two looks at whether anything has to be dropped or reported
_SILENCE = 2.0  # s without telemetry after which the server is said to be silent
_AT_ONCE = 100  # frames taken from one socket before the others have their turn


class _Client:
    """The connection to the server that belongs to one client on this machine."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], remote: Endpoint, address: str):
        self.socket = context.socket(zmq.DEALER)
        # no queue for a server that is not there: an old command must never arrive
        self.socket.immediate = True
        remote.connect(self.socket, address)
        self._waiting: deque[tuple[float, bytes]] = deque(maxlen=_WAITING)

    def send(self, frame: bytes, now: float) -> None:
        """Carry a frame to the server, at once if it is there."""
        self._waiting.append((now, frame))
        self.flush(now)

    def flush(self, now: float) -> None:
        """Send the messages that wait, and drop those that have waited for too long."""
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


class _Lane:
    """A ROUTER on this machine, and the connections of its clients to the server's.

    It has a context of its own, as the server's sockets have.
    """

    def __init__(
        self,
        router: zmq.Socket[bytes],
        remote: Endpoint,
        address: str,
        admission: Admission,
    ):
        self.router = router
        self._admission = admission
        self._remote = remote
        self._address = address
        self._clients: OrderedDict[bytes, _Client] = OrderedDict()

    def sockets(self) -> Iterator[zmq.Socket[bytes]]:
        """Yield the sockets that messages come from."""
        yield self.router
        for client in self._clients.values():
            yield client.socket

    @property
    def waits(self) -> bool:
        """True if there are frames to be carried on."""
        return any(client.waits for client in self._clients.values())

    def carry(self, ready: set[object], now: float) -> None:
        """Carry messages in both directions."""
        if self.router in ready:
            for peer, frame in _read_requests(self.router, self._admission):
                reason = _refusal(self._admission, peer, frame)
                if reason:
                    refused = encode("refused", reason=reason)
                    self.router.send_multipart((peer.connection, refused), zmq.DONTWAIT)
                else:
                    self._client(peer.connection).send(frame, now)
        for name, client in self._clients.items():
            if client.socket in ready:
                for frame in _read_frames(client.socket):
                    self.router.send_multipart((name, frame), zmq.DONTWAIT)
            if client.waits:
                client.flush(now)

    def _client(self, name: bytes) -> _Client:
        """Return the connection of a client, opened if need be; clients are kept by last use."""
        client = self._clients.get(name)
        if client is None:
            if len(self._clients) >= _MOST_CLIENTS:
                _, longest_silent = self._clients.popitem(last=False)
                longest_silent.socket.close()
            client = _Client(self.router.context, self._remote, self._address)
            self._clients[name] = client
        self._clients.move_to_end(name)
        return client


class Bridge:
    """A bridge, bound as soon as it is made; :meth:`run` carries messages until it is interrupted.

    Parameters
    ----------
    remote : Endpoint
        Addresses and keys of the server.
    port : int
        Port of the requests on the loopback address of this machine; telemetry and operators have
        the next ones, as on the server.
    tell : callable
        Called with a line when the server becomes silent or is heard again.
    no_keys : bool
        Whether everybody on this machine may drive the rig, without a key.

    Raises
    ------
    UserError
        If a port is taken.
    """

    def __init__(
        self,
        remote: Endpoint,
        port: int,
        tell: Callable[[str], None] = lambda text: None,
        no_keys: bool = False,
    ):
        self._remote = remote
        self._tell = tell
        self._heard = monotonic()
        self._is_silent: bool | None = None  # as was reported; None: nothing yet
        with ExitStack() as opened:
            first, second = (zmq.Context(), zmq.Context())
            for context in (first, second):
                opened.callback(context.destroy, 0)
            opened.enter_context(access_control((first, second), EVERYBODY))
            requests = opened.enter_context(_listening(first, zmq.ROUTER, port))
            operators = opened.enter_context(_listening(second, zmq.ROUTER, port + OPERATOR))
            self._telemetry = opened.enter_context(_listening(first, zmq.PUB, port + TELEMETRY))
            admission = EVERYBODY
            if not no_keys:
                admission = opened.enter_context(user_admission(f"tcp://{LOOPBACK}:{port}"))
            self._lanes = (
                _Lane(operators, remote, remote.operators, admission),
                _Lane(requests, remote, remote.requests, admission),
            )
            self._source = first.socket(zmq.SUB)
            remote.connect(self._source, remote.telemetry)
            self._source.subscribe(b"")
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close all sockets; messages under way are dropped."""
        self._opened.close()

    def run(self) -> None:
        """Carry messages until an exception such as KeyboardInterrupt, then close everything."""
        try:
            while True:
                self._turn(self._ready())
        finally:
            self.close()

    def _ready(self) -> set[object]:
        """Wait until a socket has a message, or something else is due; return those that have."""
        poller = zmq.Poller()
        poller.register(self._source, zmq.POLLIN)
        for lane in self._lanes:
            for socket in lane.sockets():
                poller.register(socket, zmq.POLLIN)
        wait = _SOON if any(lane.waits for lane in self._lanes) else _TURN
        return {socket for socket, _ in poller.poll(round(1000 * wait))}

    def _turn(self, ready: set[object]) -> None:
        """Carry the messages of the sockets that have some."""
        now = monotonic()
        for lane in self._lanes:
            lane.carry(ready, now)
        if self._source in ready:
            self._heard = now
            for frame in _read_frames(self._source):
                self._telemetry.send(frame, zmq.DONTWAIT)
        self._report_contact(now)

    def _report_contact(self, now: float) -> None:
        """Report when contact with the server begins or ends."""
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


@contextmanager
def _listening(
    context: zmq.Context[zmq.Socket[bytes]], kind: int, port: int
) -> Iterator[zmq.Socket[bytes]]:
    """Yield a socket that is bound to a port of the loopback address; close it afterwards."""
    address = f"tcp://{LOOPBACK}:{port}"
    with context.socket(kind) as socket:
        bound_queues(socket)
        guard_access(socket)
        try:
            socket.bind(address)
        except zmq.ZMQError as error:
            raise UserError(
                f"cannot listen at {address}: {error.strerror}; --port chooses another one"
            ) from error
        yield socket


def _read_requests(router: zmq.Socket[bytes], admission: Admission) -> Iterator[tuple[Peer, bytes]]:
    """Yield messages of clients that have arrived, a bounded number, with their senders."""
    for _ in range(_AT_ONCE):
        try:
            peer, frames = received(router, admission)
        except zmq.Again:
            return
        if peer.has_name and len(frames) == 1 and len(frames[0]) <= MAX_FRAME:
            yield peer, frames[0]


def _refusal(admission: Admission, peer: Peer, frame: bytes) -> str:
    """Return why a message is not carried on; the server drops one that is malformed."""
    try:
        message = decode(frame, REQUESTS)
    except ProtocolError:
        return ""
    return admission.refusal(admission.identify(peer, message), message["type"])


def _read_frames(socket: zmq.Socket[bytes]) -> Iterator[bytes]:
    """Yield messages of the server that have arrived, a bounded number."""
    for _ in range(_AT_ONCE):
        try:
            frames = socket.recv_multipart(zmq.DONTWAIT)
        except zmq.Again:
            return
        if len(frames) == 1 and len(frames[0]) <= MAX_FRAME:
            yield frames[0]
