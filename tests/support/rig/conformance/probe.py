"""Probe of a server: peers that speak to it as the protocol wants them to, or as it does not."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from secrets import token_hex
from time import monotonic, sleep
from typing import Any

import zmq

from fmus.kit import UserError
from fmus.rig_proxy import IDLE, LATCHED, LOCKSTEP, ProtocolError, decode, encode, protocol
from orchestration.rig.endpoint import Endpoint, parse_address

PATIENCE = 2.0  # s that an answer may take
QUIET = 0.3  # s in which there must be no answer
_LOOK = 0.02  # s between two looks at a state that has to come
_SPARE = 1.0  # s that a safe state may take beyond the watchdog time

Message = dict[str, Any]


class BrokenError(Exception):
    """A rule does not hold; the text says what was seen."""


class NotTriedError(Exception):
    """A rule cannot be tried with this server; the text says why."""


class ConformancePeer:
    """A peer of a server.

    Parameters
    ----------
    context : zmq.Context
    remote : Endpoint
    address : str
        Of one of the server's sockets.
    has_name : bool
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        remote: Endpoint,
        address: str,
        has_name: bool = True,
    ) -> None:
        self._socket = context.socket(zmq.DEALER)
        self._key = remote.local_key
        remote.connect(self._socket, address, has_name=has_name)

    def send(self, *frames: bytes) -> None:
        """Send frames as they are."""
        with suppress(zmq.Again):
            self._socket.send_multipart(frames, zmq.NOBLOCK)

    def receive(self, patience: float = PATIENCE) -> Message | None:
        """Return the next reply; None if there is none in time.

        Raises
        ------
        BrokenError
            If it is no reply of the protocol.
        """
        if not self._socket.poll(round(1000 * patience)):
            return None
        frames = self._socket.recv_multipart()
        if len(frames) != 1:
            raise BrokenError(f"a reply of {len(frames)} frames")
        try:
            return decode(frames[0], protocol.REPLIES)
        except ProtocolError as error:
            raise BrokenError(f"the server sends {error}") from error

    def ask(self, kind: str, **fields: Any) -> Message:
        """Send a message and return the reply to it.

        Raises
        ------
        BrokenError
            If there is none.
        """
        self.send(encode(kind, **{"key": self._key, **fields}))
        answer = self.receive()
        if answer is None:
            raise BrokenError(f"no answer to {kind} within {PATIENCE:g} s")
        return answer

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class Probe:
    """A server under test, and peers of it.

    Parameters
    ----------
    remote : Endpoint
    beyond_limits : bool
        Whether a command beyond a limit may be sent, which a right server refuses.

    Raises
    ------
    UserError
        If the server does not answer as one of the protocol, or somebody uses it.
    """

    def __init__(self, remote: Endpoint, beyond_limits: bool = False) -> None:
        self.remote = remote
        self.beyond_limits = beyond_limits
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._peers: list[ConformancePeer] = []
        self.operator = self.peer(remote.operators)
        try:
            self.about = self.operator.ask("status")
        except BrokenError as error:
            self.close()
            raise UserError(
                f"{remote.requests}: {error}; is it a server of this protocol, or do the keys not"
                " match?"
            ) from error
        if self.about["state"] != IDLE:
            self.close()
            raise UserError(
                f"{remote.requests} is {self.about['state']}; conformance is tried with a rig that"
                " is idle"
            )

    def peer(self, address: str = "", has_name: bool = True) -> ConformancePeer:
        """Return a new peer, of the clients' socket unless another one is given."""
        made = ConformancePeer(
            self._context, self.remote, address or self.remote.requests, has_name
        )
        self._peers.append(made)
        return made

    def raw(self, address: str, data: bytes) -> bool:
        """Send bytes that are no ZMTP 3, and return whether the server closes the connection."""
        host, port = parse_address(address)
        with socket.create_connection((host.strip("[]"), port), PATIENCE) as connection:
            try:
                connection.sendall(data)
                while connection.recv(4096):
                    continue
            except TimeoutError:
                return False
            except OSError:
                return True
        return True

    def signals(self) -> Message:
        """Return the fields of a ``connect`` that fits."""
        names = {"inputs": self.about["inputs"], "outputs": self.about["outputs"]}
        about = {"client": "conformance", "instance": token_hex(8), "key": self.remote.local_key}
        return {**about, **names, "time": 0.0}

    def session(self) -> ConformanceSession:
        """Begin a session."""
        return ConformanceSession(self, self.peer(), self.signals())

    def status(self) -> Message:
        """Return the status."""
        answer = self.operator.ask("status")
        if answer["type"] != "status":
            raise BrokenError(f"status is answered by {answer['type']}")
        return answer

    def wait(self, holds: Callable[[Mapping[str, Any]], bool], what: str) -> Message:
        """Wait for a state; the bound is the watchdog time and a little.

        Raises
        ------
        BrokenError
            If it does not come.
        """
        until = monotonic() + float(self.about["watchdog"]) + _SPARE
        while not holds(now := self.status()):
            if monotonic() > until:
                raise BrokenError(f"{what}: the state is {now['state']!r} ({now['reason']})")
            sleep(_LOOK)
        return now

    def zero(self) -> list[float]:
        """Return the command that is nearest to zero within the limits, one per input."""
        commands = []
        for name in self.about["inputs"]:
            limit = self.about["limits"].get(name, {})
            low = limit.get("min")
            high = limit.get("max")
            at_least = 0.0 if low is None else max(0.0, low)
            commands.append(at_least if high is None else min(at_least, high))
        return commands

    @property
    def is_lockstep(self) -> bool:
        """True if time is the client's."""
        return bool(self.about["mode"] == LOCKSTEP)

    def settle(self) -> None:
        """End what a rule has left, so that the rig is idle again."""
        for peer in self._peers:
            if peer is not self.operator:
                peer.close()
        self._peers = [self.operator]
        while self.operator.receive(0.0) is not None:
            continue  # late replies of the rule before
        now = self.status()
        if now["state"] not in (IDLE, *LATCHED):
            now = self.operator.ask("stop", reason="conformance: between two rules")
        if now["latch"]:
            now = self.wait(lambda state: state["state"] == "safe", "no safe state")
            self.operator.ask("acknowledge", latch=now["latch"])
            self.wait(lambda state: state["state"] == IDLE, "not idle again")

    def close(self) -> None:
        """Close all connections."""
        self._context.destroy(linger=0)


class ConformanceSession:
    """A session that commands zero.

    Parameters
    ----------
    probe : Probe
    peer : ConformancePeer
    fields : dict
        Of ``connect``.

    Raises
    ------
    BrokenError
        If it is not accepted.
    """

    def __init__(self, probe: Probe, peer: ConformancePeer, fields: Message) -> None:
        self._probe = probe
        self.peer = peer
        self.fields = fields
        answer = peer.ask("connect", **fields)
        if answer["type"] != "accepted":
            raise BrokenError(f"a connect that fits is answered by {answer}")
        self.accepted = answer
        self.seen = answer["clock"]

    def message(self, sequence: int, **changes: Any) -> bytes:
        """Return an exchange with a new command, or one that is changed."""
        fields = {
            "session": self.accepted["session"],
            "sequence": sequence,
            "sent": monotonic(),
            "seen": self.seen,
            "time": 0.0,
            "step": 0.01,
            "values": self._probe.zero(),
        }
        return encode("exchange", **(fields | changes))

    def exchange(self, sequence: int, **changes: Any) -> Message:
        """Exchange, and return the ``sample``.

        Raises
        ------
        BrokenError
            If it is not answered by one.
        """
        self.peer.send(self.message(sequence, **changes))
        answer = self.peer.receive()
        if answer is None or answer["type"] != "sample":
            raise BrokenError(f"exchange {sequence} is answered by {answer}")
        self.seen = answer["clock"]
        return answer
