"""Client of the rig protocol over ZeroMQ: connect, exchange, disconnect, all with bounded waits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from math import ceil, inf
from pathlib import Path
from secrets import token_hex
from time import monotonic
from typing import Any

import zmq

from ..kit import UserError
from . import local_key, protocol
from .credentials import read_client_keys

FAREWELL = 0.2  # s, longest wait of a disconnect for its answer
NEVER = -1e9  # s, our clock: earlier than any start of the computer
_QUEUE = 16  # messages that are queued in either direction
_MOST_REPLIES = 1000  # that are read in one call
_LATCHED = {
    protocol.STOPPING: "is on the way to its safe state",
    protocol.SAFE: "is in its safe state",
    protocol.NOT_REACHED: "HAS NOT REACHED ITS SAFE STATE AND MAY STILL BE ENERGISED",
}


def describe_latch(reply: Mapping[str, Any]) -> str:
    """Return a sentence about the latch of a rig from its reply; empty if it is not latched."""
    phrase = _LATCHED.get(reply.get("state", ""))
    return f"the rig {phrase}: {reply['reason']}" if phrase else ""


class LinkError(UserError):
    """The rig does not answer or refuses; the text says which, and the remedy."""


class Link:
    """A session with a rig's server; it cannot be opened again after its end.

    Parameters
    ----------
    endpoint : str
        Address of the server, such as ``tcp://127.0.0.1:5570``.
    inputs, outputs : Mapping of str to str
        SI units of the signals to command and to read, by name; values have the same order.
    credentials : Path, optional
        The client's keys (``ppy rig keys``); default is no encryption, and the key that a server of
        this user on this machine has left.
    client : str
        Name of this client in the server's log.
    instance : str, optional
        16 hexadecimal digits that are unique; default random ones.
    take_over : bool
        Whether to take the rig over from a client that hands it over.

    Raises
    ------
    UserError
        If the endpoint is not valid, or the file with the keys cannot be used.

    Attributes
    ----------
    accepted : Mapping
        Message with which the server accepted the session: its clock, mode, period, watchdog and
        limits.
    unanswered_since : float
        Our clock when the oldest exchange without an answer was sent; infinite if all have one.
    last_answer : float
        Our clock at the newest answer.
    trip : float
        Time from the exchange to its answer, for the newest answer, s.
    """

    def __init__(
        self,
        endpoint: str,
        inputs: Mapping[str, str],
        outputs: Mapping[str, str],
        credentials: Path | None = None,
        client: str = "ppy",
        instance: str | None = None,
        *,
        take_over: bool = False,
    ):
        self.endpoint = endpoint
        self.inputs = dict(inputs)
        self.outputs = dict(outputs)
        self.client = client
        self.accepted: Mapping[str, Any] = {}
        self.unanswered_since = self.last_answer = NEVER
        self.trip = 0.0
        self._overtaken: Mapping[str, Any] | None = None  # answer to an earlier exchange
        self._instance = instance or token_hex(8)
        self._take_over = take_over
        self._keys = None if credentials is None else read_client_keys(credentials)
        self._sequence = 0  # number of the newest exchange
        self._answered = 0  # number of the newest exchange with an answer
        self._rig_clock = 0.0  # s, of the rig at its newest answer
        self._context = zmq.Context()
        self._socket: Any = None
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    @property
    def session(self) -> str:
        """Name that the server gave the session; empty without one."""
        return str(self.accepted.get("session", ""))

    @property
    def is_open(self) -> bool:
        """True until it is closed."""
        return self._socket is not None

    @property
    def round_trip_time(self) -> float:
        """Time from an exchange to its answer, s; up to now while there is no answer."""
        return max(self.trip, monotonic() - self.unanswered_since)

    def connect(self, time: float, timeout: float) -> Mapping[str, Any]:
        """Begin the session.

        Parameters
        ----------
        time : float
            Simulation time at its start, in s.
        timeout : float
            Longest wait, in s.

        Returns
        -------
        Mapping of str to object
            The message ``accepted``.

        Raises
        ------
        LinkError
            If nobody answers, or the server refuses.
        """
        sent = monotonic()
        self._send(
            "connect",
            client=self.client,
            instance=self._instance,
            inputs=self.inputs,
            outputs=self.outputs,
            time=time,
            take_over=self._take_over,
            key="" if self._keys else local_key.read(self.endpoint),
        )
        for message in self._answers(monotonic() + timeout):
            if message["type"] == "refused":
                raise LinkError(f"the rig at {self.endpoint} refuses: {message['reason']}")
            if message["type"] == "accepted" and self._has_all(message):
                self.accepted = message
                self._rig_clock = message["clock"]
                self.last_answer = monotonic()
                self.unanswered_since = inf
                self.trip = self.last_answer - sent
                return message
        keys = ", without keys" if self._keys is None else ", with these keys"
        raise LinkError(
            f"no answer within {timeout:g} s from {self.endpoint}{keys}; is `ppy rig serve`"
            " running, or do the keys not match?"
        )

    def exchange(
        self, values: Sequence[float], time: float, step: float, timeout: float
    ) -> Mapping[str, Any] | None:
        """Send commands, and take the answer to them.

        Parameters
        ----------
        values : sequence of float
            One per input, SI.
        time, step : float
            Simulation time, and the step that begins there, in s.
        timeout : float
            Longest wait for the answer, in s.

        Returns
        -------
        Mapping of str to object or None
            The message ``sample``; None if it did not come in time. A late one is returned by
            `late`.

        Raises
        ------
        LinkError
            If the server does not know the session any more.
        """
        self._sequence += 1
        self._overtaken = None
        sent = monotonic()
        self.unanswered_since = min(self.unanswered_since, sent)
        self._send(
            "exchange",
            session=self.session,
            sequence=self._sequence,
            sent=sent,
            seen=self._rig_clock,
            time=time,
            step=step,
            values=list(values),
        )
        for message in self._samples(monotonic() + timeout):
            if message["sequence"] == self._sequence:
                return message
            self._overtaken = message
        return None

    def status(self, timeout: float) -> Mapping[str, Any] | None:
        """Request the state of the rig, without a command.

        Parameters
        ----------
        timeout : float
            Longest wait for the answer, in s.

        Returns
        -------
        Mapping of str to object or None
            The message ``status``; None if it did not come in time.
        """
        self._send("status")
        answers = self._answers(monotonic() + timeout)
        return next((message for message in answers if message["type"] == "status"), None)

    def late(self) -> Mapping[str, Any] | None:
        """Return the newest sample that came after its exchange had ended, without waiting.

        Returns
        -------
        Mapping of str to object or None
            The message ``sample``; None if no such one has come.

        Raises
        ------
        LinkError
            If the server does not know the session any more.
        """
        newest, self._overtaken = self._overtaken, None
        for message in self._samples(monotonic()):
            newest = message
        return newest

    def hand_over(self, timeout: float) -> bool:
        """Offer the rig to a client that takes it over within 10 s.

        This client has to go on commanding until its exchange is refused: the watchdog is armed.

        Parameters
        ----------
        timeout : float
            Longest wait for the answer, in s.

        Returns
        -------
        bool
            True if the server has noted the offer.
        """
        self._send("hand_over", session=self.session)
        for message in self._answers(monotonic() + timeout):
            if message["type"] in ("offered", "refused"):
                return bool(message["type"] == "offered")
        return False

    def disconnect(self, longest: float = FAREWELL) -> None:
        """End the session in order: the rig goes to zero.

        Parameters
        ----------
        longest : float
            Longest wait for the answer, in s.
        """
        if self.session and self._socket is not None:
            self._send("disconnect", session=self.session)
            self._mark_ended()
            for message in self._answers(monotonic() + longest):
                if message["type"] in ("disconnected", "refused"):
                    break
        self._mark_ended()

    def close(self) -> None:
        """Close the sockets; messages that are not sent yet are dropped."""
        if self._socket is not None:
            self._socket.close(linger=0)
            self._socket = None
        self._context.destroy(linger=0)

    def _mark_ended(self) -> None:
        """Mark the session as ended: no more answers come, and the age of the newest one grows."""
        self.accepted = {}
        self.unanswered_since = min(self.unanswered_since, self.last_answer)

    def _open(self) -> None:
        """Open the socket under a new name, since a server may keep an old one for a while."""
        self._socket = socket = self._context.socket(zmq.DEALER)
        for option in (zmq.SNDHWM, zmq.RCVHWM):
            socket.setsockopt(option, _QUEUE)
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.IPV6, 1)
        socket.setsockopt(zmq.MAXMSGSIZE, protocol.MAX_FRAME)
        socket.setsockopt(zmq.RECONNECT_IVL, 20)
        socket.routing_id = protocol.new_name()
        if self._keys is not None:
            self._keys.secure(socket)
        try:
            socket.connect(local_key.numeric(self.endpoint))
        except zmq.ZMQError as error:
            raise LinkError(
                f"endpoint {self.endpoint!r}: {error.strerror}; it is like {protocol.ENDPOINT}"
            ) from error

    def _send(self, kind: str, **fields: Any) -> None:
        with suppress(zmq.Again):  # the other side takes nothing: no answer will come either
            self._socket.send(protocol.encode(kind, **fields), zmq.DONTWAIT)

    def _answers(self, until: float) -> Iterator[Mapping[str, Any]]:
        """Yield well-formed replies that have come or come until a time of our clock, s."""
        for _ in range(_MOST_REPLIES):  # a peer that floods us must not block us
            if not self._socket.poll(ceil(max(0.0, until - monotonic()) * 1e3)):
                return
            try:
                yield protocol.decode(self._socket.recv(zmq.DONTWAIT), protocol.REPLIES)
            except (protocol.ProtocolError, zmq.Again):
                continue

    def _samples(self, until: float) -> Iterator[Mapping[str, Any]]:
        """Yield samples of this session that are newer than all previous ones.

        Raises
        ------
        LinkError
            If the server does not know the session any more.
        """
        for message in self._answers(until):
            if message["type"] == "refused" and self.session:
                self._mark_ended()
                raise LinkError(f"the rig at {self.endpoint} refuses: {message['reason']}")
            if (
                message["type"] == "sample"
                and message["session"] == self.session
                and self._has_all(message)
                and self._answered < message["sequence"] <= self._sequence
            ):
                self._note_answer(message)
                yield message

    def _note_answer(self, sample: Mapping[str, Any]) -> None:
        """Note the time and the number of the newest answer."""
        sent = sample["sent"]
        self._answered = sample["sequence"]
        self._rig_clock = max(self._rig_clock, sample["clock"])
        self.last_answer = monotonic()
        self.trip = self.last_answer - sent
        if self._answered == self._sequence:
            self.unanswered_since = inf
        else:  # of the exchanges after this one the oldest was sent later
            self.unanswered_since = max(self.unanswered_since, sent)

    def _has_all(self, message: Mapping[str, Any]) -> bool:
        return len(message["values"]) == len(message["ages"]) == len(self.outputs)
