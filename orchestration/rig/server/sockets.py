"""The three sockets of a server: their addresses, the admission of peers, and limits per peer."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import zmq
from zmq.utils.monitor import parse_monitor_message

from fmus.kit import UserError
from fmus.rig_proxy import MAX_FRAME, OPERATOR, TELEMETRY
from orchestration.rig.access import (
    EVERYBODY,
    HANDSHAKE,
    Admission,
    access_control,
    guard_access,
    user_admission,
)
from orchestration.rig.endpoint import HIGHEST_PORT
from orchestration.rig.keys import KeyFile, ServerKeys
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.telemetry import TelemetrySocket

_LONGEST_QUEUE = 100  # messages in each direction, of each peer
# bytes; a larger message ends its connection, a smaller one is counted and reported
_LARGEST = 16 * MAX_FRAME
# bytes; an operator's message is short, and many large ones would take the time of a stop
_LARGEST_OF_OPERATORS = 4096
# bytes; a subscriber says nothing but its handshake, which with keys is some 400, and no topic
_LARGEST_OF_SUBSCRIBERS = 1024
_TRIES = 20  # for three free ports in a row
_HANDSHAKES = zmq.EVENT_ACCEPTED | zmq.EVENT_HANDSHAKE_SUCCEEDED


class Handshakes:
    """Count of the peers that connect to a socket and that do not get beyond the handshake.

    Parameters
    ----------
    socket : zmq.Socket
    """

    def __init__(self, socket: zmq.Socket[bytes]) -> None:
        self._monitor = socket.get_monitor_socket(_HANDSHAKES)
        self._accepted = 0
        self._succeeded = 0
        self._settled = 0  # of those accepted, whose handshake is over at the next check
        self._checked = monotonic()
        self._reported = 0

    def failed(self) -> int:
        """Return the number of failures since the last call, as far as they are certain."""
        while self._monitor.poll(0):
            event = parse_monitor_message(self._monitor.recv_multipart())["event"]
            self._accepted += event == zmq.EVENT_ACCEPTED
            self._succeeded += event == zmq.EVENT_HANDSHAKE_SUCCEEDED
        now = monotonic()
        # those that were accepted before the last check have succeeded or failed only by then
        if now - self._checked <= 2 * HANDSHAKE / 1000:
            return 0
        failed = max(0, self._settled - self._succeeded - self._reported)
        self._reported += failed
        self._settled = self._accepted
        self._checked = now
        return failed


@dataclass
class Sockets:
    """The open sockets of a server.

    Attributes
    ----------
    requests : zmq.Socket
        ROUTER, for clients.
    telemetry : TelemetrySocket
    operators : zmq.Socket
        ROUTER, in a context of its own, so that a stop waits for no other message.
    host : str
    port : int
        Port of `requests`.
    admission : Admission
        Keys of clients, as they are at present.
    """

    requests: zmq.Socket[bytes]
    telemetry: TelemetrySocket
    operators: zmq.Socket[bytes]
    host: str
    port: int
    admission: Admission = EVERYBODY
    _handshakes: list[Handshakes] = field(init=False)

    def __post_init__(self) -> None:
        self._handshakes = [Handshakes(each) for each in (self.requests, self.operators)]

    def endpoint(self, offset: int = 0) -> str:
        """Return the address of the socket at the first port plus `offset`."""
        return f"tcp://{self.host}:{self.port + offset}"

    def turned_away(self) -> int:
        """Return the number of peers that were turned away since the last call.

        They had no key or a wrong one, or did not speak ZMTP 3.
        """
        return sum(each.failed() for each in self._handshakes)


@contextmanager
def opened(
    settings: ServerSettings, warn: Callable[[str], None] = lambda text: None
) -> Iterator[Sockets]:
    """Bind the sockets, and close them at the end with all messages in them.

    Parameters
    ----------
    settings : ServerSettings
    warn : callable
        Called with a line if others can read the key file, and when it was read again.

    Yields
    ------
    Sockets

    Raises
    ------
    UserError
        If an address cannot be bound to, or the key file is invalid.
    """
    file = None if settings.keys is None else KeyFile(settings.keys, warn)
    admission = EVERYBODY if file is None else Admission(file.keys.clients)

    def refresh() -> None:
        if file is not None:
            admission.holders = file.clients()

    _allow_most_descriptors()
    with ExitStack() as stack:
        contexts: Sequence[zmq.Context[zmq.Socket[bytes]]] = (zmq.Context(), zmq.Context())
        for context in contexts:
            stack.callback(context.destroy, linger=0)
        stack.enter_context(access_control(contexts, admission, refresh))
        sockets = _bind_all(contexts, settings, None if file is None else file.keys)
        sockets.admission = admission
        if file is None and not settings.no_keys:
            sockets.admission = stack.enter_context(user_admission(sockets.endpoint()))
        yield sockets


def _allow_most_descriptors() -> None:
    """Let this process have as many connections as the system allows it."""
    if sys.platform == "win32":
        return
    import resource

    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def _bind_all(
    contexts: Sequence[zmq.Context[zmq.Socket[bytes]]],
    settings: ServerSettings,
    keys: ServerKeys | None,
) -> Sockets:
    """Bind requests to the port and the others to the next; any that are free if the port is 0."""
    first, second = contexts
    for _ in range(_TRIES):
        requests = _socket(first, zmq.ROUTER, keys, _LARGEST)
        operators = _socket(second, zmq.ROUTER, keys, _LARGEST_OF_OPERATORS)
        port = settings.port
        try:
            requests.bind(f"tcp://{settings.host}:{port or '*'}")
            port = int(requests.getsockopt_string(zmq.LAST_ENDPOINT).rpartition(":")[2])
            operators.bind(f"tcp://{settings.host}:{port + OPERATOR}")
            telemetry = TelemetrySocket(
                lambda: _socket(first, zmq.XPUB, keys, _LARGEST_OF_SUBSCRIBERS),
                f"tcp://{settings.host}:{port + TELEMETRY}",
            )
            return Sockets(requests, telemetry, operators, settings.host, port)
        except (zmq.ZMQError, OverflowError) as error:
            for socket in (requests, operators):
                socket.close(linger=0)
            if settings.port:
                raise UserError(_describe_refusal(error, settings)) from error
            if port <= HIGHEST_PORT and getattr(error, "errno", 0) != zmq.EADDRINUSE:
                raise UserError(f"cannot bind to {settings.host}: {error}") from error
    raise UserError(f"no three free ports in a row on {settings.host}; choose one with --port")


def _describe_refusal(error: Exception, settings: ServerSettings) -> str:
    """Describe why the sockets cannot be bound to the chosen ports."""
    place = f"one of ports {settings.port} to {settings.port + OPERATOR} of {settings.host}"
    if getattr(error, "errno", 0) == zmq.EADDRINUSE:
        return f"{place} is in use, by another server perhaps; choose others with --port"
    return f"cannot bind to {place}: {error}"


def _socket(
    context: zmq.Context[zmq.Socket[bytes]], kind: int, keys: ServerKeys | None, largest: int
) -> Any:
    """Return a guarded socket, which takes messages of at most `largest` bytes."""
    socket = context.socket(kind)
    guard_access(socket)
    socket.linger = 0
    socket.sndhwm = _LONGEST_QUEUE
    socket.rcvhwm = _LONGEST_QUEUE
    socket.maxmsgsize = largest
    socket.ipv6 = True
    if keys is not None:
        socket.curve_server = True
        socket.curve_publickey = keys.public_key.encode()
        socket.curve_secretkey = keys.secret_key.encode()
    return socket
