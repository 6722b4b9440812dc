"""The two sockets of a server: their addresses, their keys, and their bounded queues."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import zmq
from zmq.auth.thread import ThreadAuthenticator
from zmq.utils.monitor import parse_monitor_message

from fmus.kit import UserError
from fmus.rig_proxy import MAX_FRAME
from orchestration.rig.keys import ServerKeys, read_server_keys
from orchestration.rig.server.settings import ServerSettings

_LONGEST_QUEUE = 100  # messages in each direction, of each peer
_HANDSHAKE = 2000  # ms that a peer has to say who it is
# bytes; a larger message ends its connection, a smaller one is counted and reported
_LARGEST = 16 * MAX_FRAME
_TRIES = 20  # for two free ports that are neighbours
_FAILED = (
    zmq.EVENT_HANDSHAKE_FAILED_AUTH
    | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
    | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
)


@dataclass
class Sockets:
    """The open sockets of a server.

    Attributes
    ----------
    requests : zmq.Socket
        ROUTER.
    telemetry : zmq.Socket
        PUB.
    endpoint, telemetry_endpoint : str
    """

    requests: zmq.Socket[bytes]
    telemetry: zmq.Socket[bytes]
    endpoint: str
    telemetry_endpoint: str
    _monitor: zmq.Socket[bytes]

    def turned_away(self) -> int:
        """Return how many peers were turned away since the last call.

        They had no key or a wrong one, or did not speak ZeroMQ.
        """
        number = 0
        while self._monitor.poll(0):
            number += parse_monitor_message(self._monitor.recv_multipart())["event"] & _FAILED != 0
        return number


class _Allowed:
    """Check of the keys that a server lets in, as ZeroMQ calls it."""

    def __init__(self, keys: ServerKeys) -> None:
        self._keys = {key.encode() for key in keys.clients}

    def callback(self, domain: str, key: bytes) -> bool:
        return key in self._keys


@contextmanager
def opened(
    settings: ServerSettings, warn: Callable[[str], None] = lambda text: None
) -> Iterator[Sockets]:
    """Bind both sockets, and close them at the end, whatever is still in them.

    Parameters
    ----------
    settings : ServerSettings
    warn : callable
        Called with a line if others can read the key file.

    Yields
    ------
    Sockets

    Raises
    ------
    UserError
        If an address cannot be bound to, or the key file is none.
    """
    keys = None if settings.keys is None else read_server_keys(settings.keys, warn)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    authenticator = ThreadAuthenticator(context)
    made: list[zmq.Socket[bytes]] = []
    try:
        if keys is not None:
            authenticator.start()
            authenticator.configure_curve_callback("*", _Allowed(keys))
        requests, port = _bound(context, settings, keys, made)
        monitor = requests.get_monitor_socket(_FAILED)
        made.append(monitor)
        host = settings.host
        yield Sockets(
            requests, made[1], f"tcp://{host}:{port}", f"tcp://{host}:{port + 1}", monitor
        )
        requests.disable_monitor()
    finally:
        authenticator.stop()
        for socket in made:
            socket.close(linger=0)
        context.destroy(linger=0)


def _bound(
    context: zmq.Context[zmq.Socket[bytes]],
    settings: ServerSettings,
    keys: ServerKeys | None,
    made: list[zmq.Socket[bytes]],
) -> tuple[zmq.Socket[bytes], int]:
    """Bind requests to the port and telemetry to the next; any two neighbours if the port is 0."""
    for _ in range(_TRIES):
        pair = [_socket(context, kind, keys) for kind in (zmq.ROUTER, zmq.PUB)]
        made[:] = pair
        port = settings.port
        try:
            pair[0].bind(f"tcp://{settings.host}:{port or '*'}")
            port = int(pair[0].getsockopt_string(zmq.LAST_ENDPOINT).rpartition(":")[2])
            pair[1].bind(f"tcp://{settings.host}:{port + 1}")
            return pair[0], port
        except (zmq.ZMQError, OverflowError) as error:
            for socket in pair:
                socket.close(linger=0)
            if settings.port:
                raise UserError(_refusal(error, settings)) from error
            if port < 65535 and getattr(error, "errno", 0) != zmq.EADDRINUSE:
                raise UserError(f"cannot bind to {settings.host}: {error}") from error
    raise UserError(f"found no two free ports in a row on {settings.host}; choose one with --port")


def _refusal(error: Exception, settings: ServerSettings) -> str:
    """Describe why the chosen ports cannot be had."""
    place = f"port {settings.port} or {settings.port + 1} of {settings.host}"
    if getattr(error, "errno", 0) == zmq.EADDRINUSE:
        return f"{place} is in use, by another server perhaps; choose another one with --port"
    return f"cannot bind to {place}: {error}"


def _socket(context: zmq.Context[zmq.Socket[bytes]], kind: int, keys: ServerKeys | None) -> Any:
    socket = context.socket(kind)
    socket.linger = 0
    socket.sndhwm = _LONGEST_QUEUE
    socket.rcvhwm = _LONGEST_QUEUE
    socket.maxmsgsize = _LARGEST
    socket.handshake_ivl = _HANDSHAKE
    socket.ipv6 = True
    if keys is not None:
        socket.curve_server = True
        socket.curve_publickey = keys.public_key.encode()
        socket.curve_secretkey = keys.secret_key.encode()
    return socket
