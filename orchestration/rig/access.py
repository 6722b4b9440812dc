"""Admission of peers to the sockets of a rig, and the key of a sender (ZAP, ZeroMQ's RFC 27).

Every socket has a ZAP domain, with keys or without. ZeroMQ then refuses every peer that does not
speak ZMTP 3, such as a browser, whose request it would otherwise take for a message of ZMTP 1.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any, NamedTuple

import zmq
from zmq.utils import z85

from orchestration.rig.keys import ROLES, KeyHolder

_DOMAIN = "rig"
_HANDLER = "inproc://zeromq.zap.01"  # where ZeroMQ asks, in each of its contexts
# ms that a peer has to say who it is; a handshake with keys takes some ten, on a slow network two
# hundred, and a peer that connects and is silent holds a descriptor for as long
HANDSHAKE = 500
# ms between two questions to a peer whether it is there, and how long it may take to answer: a
# connection that nobody is behind any more holds a descriptor for as long
_HEARTBEAT = 1000
_LONGEST_SILENCE = 3000
_BACKLOG = 1000  # connections that wait to be accepted, while many come at once
# s after which a thread lets another one have the interpreter: a handshake has some ten steps, and
# each would wait for Python's five milliseconds where a flood of messages keeps the other one busy
_SWITCH = 0.0005
_LOOK = 100  # ms between two looks at whether the handler is to end
_EVERYTHING = KeyHolder("", ROLES[-1])  # who connects without keys, which only this machine can
_OF_IPV4 = "::ffff:"  # begins an address of IPv4 as a socket for both has it
_MADE_UP = b"\0"  # begins a name that ZeroMQ made, for want of one that the peer said


class Peer(NamedTuple):
    """The sender of a message, as the handshake has established it.

    Attributes
    ----------
    connection : bytes
        Name (routing id) that the peer gave its connection.
    holder : KeyHolder
        Holder of the key that the peer has proved to have.
    address : str
        Address of its machine.
    """

    connection: bytes
    holder: KeyHolder
    address: str

    @property
    def has_name(self) -> bool:
        """True if the peer has named its connection, as every client of the protocol does."""
        return not self.connection.startswith(_MADE_UP)

    def __str__(self) -> str:
        if not self.holder.name:
            return self.address
        return f"{self.holder.name} ({self.holder.role}) at {self.address}"


def received(socket: zmq.Socket[bytes]) -> tuple[Peer, list[bytes]]:
    """Take a message from a ROUTER, without waiting.

    Parameters
    ----------
    socket : zmq.Socket
        Socket that was passed to :func:`guard_access`.

    Returns
    -------
    tuple of Peer and list of bytes
        The sender, and the frames after its name.

    Raises
    ------
    zmq.Again
        If there is none.
    """
    connection, *frames = socket.recv_multipart(zmq.NOBLOCK, copy=False)
    about = frames[-1] if frames else connection
    role, _, name = _property(about, "User-Id").partition(" ")
    address = _property(about, "Peer-Address").removeprefix(_OF_IPV4)
    peer = Peer(connection.bytes, KeyHolder(name, role), address)
    return peer, [frame.bytes for frame in frames]


def _property(frame: zmq.Frame, name: str) -> str:
    """Return a property of the sender of a frame, as ZeroMQ knows it; empty if it has none."""
    try:
        return str(frame.get(name))
    except zmq.ZMQError:
        return ""


def guard_access(socket: Any) -> None:
    """Let a socket accept only peers that the handler of its context admits.

    A connection whose peer does not answer any more is closed. To be called before the socket is
    bound.
    """
    socket.zap_domain = _DOMAIN.encode()
    socket.setsockopt(zmq.ZAP_ENFORCE_DOMAIN, 1)
    socket.handshake_ivl = HANDSHAKE
    socket.heartbeat_ivl = _HEARTBEAT
    socket.heartbeat_timeout = _LONGEST_SILENCE
    socket.backlog = _BACKLOG


@contextmanager
def access_control(
    contexts: Sequence[zmq.Context[zmq.Socket[bytes]]],
    holders: Mapping[str, KeyHolder] | None = None,
) -> Iterator[None]:
    """Answer ZeroMQ's requests for admission of peers, in a thread, while the context lasts.

    Parameters
    ----------
    contexts : sequence of zmq.Context
        Contexts whose sockets are guarded; none of the sockets is bound yet.
    holders : Mapping of str to KeyHolder, optional
        Holders of the keys that are let in, by public key in Z85; without keys, every peer is let
        in.
    """
    known = None if holders is None else {z85.decode(key): one for key, one in holders.items()}
    sockets = [context.socket(zmq.REP) for context in contexts]
    for socket in sockets:
        socket.linger = 0
        socket.bind(_HANDLER)
    ending = Event()
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH)
    thread = Thread(target=_answer, args=(sockets, known, ending), daemon=True, name="access")
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()
        sys.setswitchinterval(before)
        for socket in sockets:
            socket.close()


def _answer(
    sockets: Sequence[zmq.Socket[bytes]], known: Mapping[bytes, KeyHolder] | None, ending: Event
) -> None:
    """Answer ZeroMQ's questions until the end, one of each context in turn.

    A flood at one context thus does not hold up the others.
    """
    poller = zmq.Poller()
    for socket in sockets:
        poller.register(socket, zmq.POLLIN)
    while not ending.is_set():
        for socket, _ in poller.poll(_LOOK):
            version, number, _, _, _, _, *credentials = socket.recv_multipart()
            holder = _EVERYTHING if known is None else known.get(b"".join(credentials))
            status = (b"400", b"no such key", b"")
            if holder is not None:
                status = (b"200", b"OK", f"{holder.role} {holder.name}".encode())
            socket.send_multipart([version, number, *status, b""])
