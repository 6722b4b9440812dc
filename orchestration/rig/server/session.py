"""Session of a client: the permission to command a rig, its signals and its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from secrets import token_hex
from typing import Any

from fmus.kit.errors import suggestion
from orchestration.rig.access import Peer
from orchestration.rig.server.calls import BackendSignals

FIRST_COMMAND = 10.0  # s that a client has for it; until then the rig rests
OFFER = 10.0  # s for which an offer to hand over holds
BLEND = 1.0  # s in which commands after a hand-over go from the applied values to the client's
_LONGEST_NAME = 200  # characters of a client's, for which every status has room
_SILENCE = 2.0  # s, in lockstep, after which another client may replace one that sends nothing


@dataclass
class Session:
    """The session of a client that was accepted.

    Attributes
    ----------
    client : str
        Name of the client.
    instance : str
        Identifier of the one FMU or program that connected: two may have the same name.
    owner : Peer
        Who connected, with the key that was shown then.
    commanded : list of int
        Index of every input of the rig among the client's values.
    wanted : list of int
        Index of every output that the client wants among those of the rig.
    begun : float
        Time when the client was accepted, in s of the server's clock.
    key : str
        Identifier of the session in messages.
    sequence : int
        Number of the newest exchange; 0 before the first.
    accepted : float or None
        Time of the newest fresh command, in s of the rig's clock.
    heard : float
        Time of the client's newest message, in s of the server's clock.
    peer : bytes
        ZeroMQ's name of its present connection.
    """

    client: str
    instance: str
    owner: Peer
    commanded: list[int]
    wanted: list[int]
    begun: float
    key: str = field(default_factory=lambda: token_hex(8))
    sequence: int = 0
    accepted: float | None = None
    heard: float = 0.0
    peer: bytes = b""
    _offered: float = -inf  # when the client offered to hand over, in s of the server's clock
    _applied: Sequence[float] = ()  # commands of the session that was handed over to this one
    _blend_begun: float | None = None  # time of the first command, in s of the rig's clock

    def __post_init__(self) -> None:
        self.heard = self.begun
        self.peer = self.owner.connection

    def offer(self, now: float) -> None:
        """Note that the client would hand over to one that takes over."""
        self._offered = now

    def is_handed_over(self, message: Mapping[str, Any], now: float) -> bool:
        """Return True if a client that connects may take over a rig that is being commanded."""
        is_wanted = message.get("take_over") is True and self.accepted is not None
        return is_wanted and now - self._offered <= OFFER

    def go_on(self, before: Session, applied: Sequence[float]) -> None:
        """Go on from the last commands of another session; its watchdog time runs on."""
        self.accepted = before.accepted
        self._applied = applied

    def blend(self, values: Sequence[float], now: float) -> Sequence[float]:
        """Return commands on the way from those of the session before to the client's own.

        Parameters
        ----------
        values : sequence of float
            Commands of the client, SI.
        now : float
            Time in s of the rig's clock.

        Returns
        -------
        sequence of float
        """
        if self._blend_begun is None:
            self._blend_begun = now
        share = (now - self._blend_begun) / BLEND
        if not self._applied or share >= 1.0:
            return values
        pairs = zip(self._applied, values, strict=True)
        return [before + share * (value - before) for before, value in pairs]

    def repeats(self, message: Mapping[str, Any], counts: dict[str, int]) -> bool:
        """Return True, and count it, if an exchange came before or was overtaken."""
        sequence = message["sequence"]
        if sequence > self.sequence:
            return False
        counts["repeated" if sequence == self.sequence else "late"] += 1
        return True

    def never_began(self, now: float) -> bool:
        """Return True if the client has commanded nothing for too long since it was accepted."""
        return self.sequence == 0 and now - self.begun > FIRST_COMMAND

    def may_be_taken_up(self, message: Mapping[str, Any], peer: bytes) -> bool:
        """Return True if a client that connects may replace the session, which is its own.

        It may have missed the answer, and may connect again on the same connection.
        """
        is_same = self.instance == message["instance"]
        return is_same and (self.sequence == 0 or self.peer == peer)

    def is_silent(self, now: float) -> bool:
        """Return True if the client has sent nothing for a while."""
        return now - self.heard > _SILENCE


def describe_misfit(message: Mapping[str, Any], signals: BackendSignals) -> str:
    """Describe why a client's signals do not fit those of the rig.

    Parameters
    ----------
    message : Mapping
        ``connect``.
    signals : BackendSignals

    Returns
    -------
    str
        The reason for which it cannot be served; empty if it can.
    """
    for kind, offered in (("inputs", signals.inputs), ("outputs", signals.outputs)):
        for name, unit in message[kind].items():
            if name not in offered:
                return f"the rig has no {name} among its {kind}{suggestion(name, offered)}"
            if unit != offered[name]:
                return f"{name} is in {offered[name]!r} on the rig, not in {unit!r}"
    missing = [name for name in signals.inputs if name not in message["inputs"]]
    if missing:
        return f"the client must command every input of the rig; {', '.join(missing)} is missing"
    return ""


def new_session(
    message: Mapping[str, Any], signals: BackendSignals, peer: Peer, now: float
) -> Session:
    """Make a session for a client whose signals fit those of the rig.

    Parameters
    ----------
    message : Mapping
        ``connect``.
    signals : BackendSignals
    peer : Peer
    now : float
        In s of the server's clock.

    Returns
    -------
    Session
    """
    names = list(message["inputs"])
    outputs = list(signals.outputs)
    return Session(
        client=message["client"][:_LONGEST_NAME],
        instance=message["instance"],
        owner=peer,
        commanded=[names.index(name) for name in signals.inputs],
        wanted=[outputs.index(name) for name in message["outputs"]],
        begun=now,
    )
