"""Endpoint of a rig's server: its three addresses, and the keys that a client connects with."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.kit import UserError
from fmus.rig_proxy import (
    MAX_FRAME,
    OPERATOR,
    TELEMETRY,
    ClientKeys,
    local_key,
    protocol,
    read_client_keys,
)

_ADDRESS = re.compile(r"tcp://(?P<host>\[[0-9A-Fa-f:.%\w]+\]|[\w.*-]+):(?P<port>\d{1,5})")
_LONGEST_QUEUE = 16  # messages that a socket may hold for a peer that does not take them
# ms; a peer that is silent for three of them is taken for dead, and connected to anew
_HEARTBEAT = 500
HIGHEST_PORT = 65535 - OPERATOR  # of requests


@dataclass(frozen=True)
class Endpoint:
    """The addresses of a rig's server, and the keys to connect with.

    Attributes
    ----------
    requests, telemetry, operators : str
        ZeroMQ addresses of the server's ROUTER for clients, of its PUB one port higher, and of its
        ROUTER for operators two ports higher.
    keys : ClientKeys or None
    """

    requests: str
    telemetry: str
    operators: str
    keys: ClientKeys | None = None

    @property
    def local_key(self) -> str:
        """Key that a server of this user on this machine has left; empty without one."""
        return "" if self.keys else local_key.read(self.requests)

    def connect(self, socket: Any, address: str, *, has_name: bool = True) -> None:
        """Connect a ZeroMQ socket, with a name, with keys if there are any, and bounded queues.

        Parameters
        ----------
        socket : zmq.Socket
        address : str
            One of those above.
        has_name : bool
            False for a peer that a server has to turn away.
        """
        bound_queues(socket)
        if has_name:
            socket.routing_id = protocol.new_name()
        socket.ipv6 = True
        socket.reconnect_ivl = 100  # ms
        socket.reconnect_ivl_max = 500  # ms
        socket.heartbeat_ivl = _HEARTBEAT
        socket.heartbeat_timeout = 3 * _HEARTBEAT
        if self.keys is not None:
            self.keys.secure(socket)
        socket.connect(address)


def bound_queues(socket: Any) -> None:
    """Bound queues and message size of a ZeroMQ socket, and let it close without waiting."""
    socket.linger = 0
    socket.sndhwm = _LONGEST_QUEUE
    socket.rcvhwm = _LONGEST_QUEUE
    socket.maxmsgsize = MAX_FRAME


def parse_address(text: str, flag: str = "--endpoint") -> tuple[str, int]:
    """Split an address into host and port.

    Parameters
    ----------
    text : str
        Like ``tcp://127.0.0.1:5570``.
    flag : str
        Name of the option, for messages.

    Returns
    -------
    tuple of str and int
        The host, which for a server may be ``*``, every address it has; and the port.

    Raises
    ------
    UserError
        If it is no such address.
    """
    match = _ADDRESS.fullmatch(text)
    if match is None:
        raise UserError(f"{flag} {text!r}: write tcp://HOST:PORT")
    return match["host"], int(match["port"])


def read_endpoint(
    text: str, credentials: Path | None = None, warn: Callable[[str], None] = lambda line: None
) -> Endpoint:
    """Read the endpoint of a rig's server as a client is given it.

    Parameters
    ----------
    text : str
        Like ``tcp://127.0.0.1:5570``.
    credentials : Path, optional
        Key file of a client.
    warn : callable
        Called with a line if others can read the key file.

    Returns
    -------
    Endpoint

    Raises
    ------
    UserError
        If the text is no endpoint, or the key file is none.
    """
    host, port = parse_address(text)
    if "*" in host or not 1 <= port <= HIGHEST_PORT:
        raise UserError(
            f"--endpoint {text!r}: write tcp://HOST:PORT, with one host and a port from 1 to"
            f" {HIGHEST_PORT}"
        )
    keys = None if credentials is None else read_client_keys(credentials, warn)
    requests, telemetry, operators = (
        local_key.numeric(f"tcp://{host}:{port + more}") for more in (0, TELEMETRY, OPERATOR)
    )
    return Endpoint(requests, telemetry, operators, keys)
