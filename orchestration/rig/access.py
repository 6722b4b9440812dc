"""Admission of peers to the sockets of a rig, and the key of a sender (ZAP, ZeroMQ's RFC 27).

Every socket has a ZAP domain, with keys or without. ZeroMQ then refuses every peer that does not
speak ZMTP 3, such as a browser, whose request it would otherwise take for a message of ZMTP 1.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import Any, NamedTuple

import zmq
from zmq.utils import z85

from fmus.rig_proxy import local_key
from orchestration.rig.keys import ROLES, KeyHolder, left_key

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
_REFRESH = 1.0  # s between two looks at who is let in
_NOBODY = KeyHolder("", "")
_ROLES = {
    "connect": "command",
    "acknowledge": "acknowledge",
    "shelve": "acknowledge",
    "tune": "command",
}
"""Role that a key needs for a message; every other one is for everybody who may connect. A session
has a name that its client alone was told, so that its messages need no role.
"""
_OF_IPV4 = "::ffff:"  # begins an address of IPv4 as a socket for both has it
_KEY = "key "  # begins the user of every peer; an empty one a peer could choose for itself
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
    key : str
        The key; empty without one.
    """

    connection: bytes
    holder: KeyHolder
    address: str
    key: str = ""

    @property
    def has_name(self) -> bool:
        """True if the peer has named its connection, as every client of the protocol does."""
        return not self.connection.startswith(_MADE_UP)

    def __str__(self) -> str:
        if not self.holder.name:
            return self.address
        return f"{self.holder.name} ({self.holder.role}) at {self.address}"


class Admission:
    """Keys that are let in, and what their holders may do.

    Parameters
    ----------
    holders : Mapping of str to KeyHolder
        Holders by key. The key is a public one of CURVE in Z85; on sockets without CURVE it is the
        one that a message holds, and the empty one that of everybody without.
    hint : str
        Place of the key for those who have none.

    Attributes
    ----------
    holders : Mapping of str to KeyHolder
        As it is at present; any thread may replace it.
    """

    def __init__(self, holders: Mapping[str, KeyHolder], hint: str = "") -> None:
        self.holders = holders
        self._hint = hint

    def holder(self, key: str) -> KeyHolder:
        """Return the holder of a key, who has no role if the key is not let in."""
        return self.holders.get(key, _NOBODY)

    def identify(self, peer: Peer, message: Mapping[str, Any]) -> Peer:
        """Return the sender of a message, who without CURVE is known by the key in it.

        A key that is not let in is as none: it may be of a server before this one.
        """
        if peer.key:
            return peer._replace(holder=self.holder(peer.key))
        claimed = message.get("key")
        key = claimed if isinstance(claimed, str) and claimed in self.holders else ""
        return peer._replace(key=key, holder=self.holder(key))

    def may_drive(self, peer: Peer) -> bool:
        """Return True if the key of a peer is still one that may command."""
        return self.holder(peer.key).has_role(_ROLES["connect"])

    def refusal(self, peer: Peer, kind: str) -> str:
        """Return why a peer may not send a message of a kind; empty if it may."""
        holder = peer.holder
        if kind == "stop" or holder.has_role(_ROLES.get(kind, ROLES[0])):
            return ""
        if not holder.role:
            return "its key is none of this server, or is none any more"
        if not holder.name:
            return f"{kind} needs the key of this server, {self._hint}"
        return f"the key of {holder.name} is for {holder.role}, not for {kind}"


EVERYBODY = Admission({"": KeyHolder("", ROLES[-1])})
"""Admission without keys."""


@contextmanager
def user_admission(endpoint: str) -> Iterator[Admission]:
    """Leave a key for clients of this user while the context lasts; yield who is let in then.

    Parameters are those of :func:`orchestration.rig.keys.left_key`.
    """
    with left_key(endpoint) as holders:
        yield Admission(holders, f"which its user's clients find in {local_key.path(endpoint)}")


def received(socket: zmq.Socket[bytes], admission: Admission) -> tuple[Peer, list[bytes]]:
    """Take a message from a ROUTER, without waiting.

    Parameters
    ----------
    socket : zmq.Socket
        Socket that was passed to :func:`guard_access`.
    admission : Admission

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
    key = _property(about, "User-Id").removeprefix(_KEY)
    address = _property(about, "Peer-Address").removeprefix(_OF_IPV4)
    peer = Peer(connection.bytes, admission.holder(key), address, key)
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
    admission: Admission,
    refresh: Callable[[], None] = lambda: None,
) -> Iterator[None]:
    """Answer ZeroMQ's requests for admission of peers, in a thread, while the context lasts.

    Parameters
    ----------
    contexts : sequence of zmq.Context
        Contexts whose sockets are guarded; none of the sockets is bound yet.
    admission : Admission
        Says which keys are let in.
    refresh : callable
        Called once a second, to bring the admission up to date; it may wait for a file.
    """
    sockets = [context.socket(zmq.REP) for context in contexts]
    for socket in sockets:
        socket.linger = 0
        socket.bind(_HANDLER)
    ending = Event()
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH)
    questions = (sockets, admission, refresh, ending)
    thread = Thread(target=_answer, args=questions, daemon=True, name="access")
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
    sockets: Sequence[zmq.Socket[bytes]],
    admission: Admission,
    refresh: Callable[[], None],
    ending: Event,
) -> None:
    """Answer ZeroMQ's questions until the end, one of each context in turn.

    A flood at one context thus does not hold up the others.
    """
    poller = zmq.Poller()
    for socket in sockets:
        poller.register(socket, zmq.POLLIN)
    refreshed = monotonic()
    while not ending.is_set():
        for socket, _ in poller.poll(_LOOK):
            version, number, _, _, _, _, *credentials = socket.recv_multipart()
            key = z85.encode(b"".join(credentials))
            status = (b"400", b"no such key", b"")
            if admission.holder(key.decode()).role:
                status = (b"200", b"OK", _KEY.encode() + key)
            socket.send_multipart([version, number, *status, b""])
        if monotonic() - refreshed > _REFRESH:
            refreshed = monotonic()
            refresh()
