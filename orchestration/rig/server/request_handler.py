"""Request handler of the server: sessions, commands, and the permission to send a message.

It gets and returns messages, and knows no socket.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any

from fmus.rig_proxy import IDLE, LOCKSTEP, RUNNING, ProtocolError, encode
from orchestration.rig.access import EVERYBODY, Admission, Peer
from orchestration.rig.safety import CommandFilter, stale
from orchestration.rig.server.alarms import MAJOR, Alarms, watch_limits
from orchestration.rig.server.latch import Latch
from orchestration.rig.server.latch_file import LatchKeeper
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.rig import Rig
from orchestration.rig.server.session import FIRST_COMMAND, Session, describe_misfit, new_session

_LONGEST_STEP = 60.0  # s, in lockstep: the emulated rig takes it in one go
_LONGEST_REASON = 1000  # characters: names in it may be a stranger's
_LONGEST_NAME = 40  # characters of a client's name in the log
_OVER = "this session is over, or of a server before this one"


class RequestHandler:
    """Handler of all messages to a rig, which serves one client at a time.

    Parameters
    ----------
    rig : Rig
    period : float
        Time in s between two samples of the rig.
    log : EventLog
    keeper : LatchKeeper
        Stores the latch, so that it stays closed when the server is started again.
    announce : callable
        Called with the fields of each alarm, and of a stop.
    admission : Admission
        Says what the sender of a message may do, at present.

    Attributes
    ----------
    counts : dict of str to int
        Numbers of messages that were dropped or refused, and of deadlines that were missed.
    """

    def __init__(
        self,
        rig: Rig,
        period: float,
        log: EventLog,
        keeper: LatchKeeper,
        announce: Callable[[Mapping[str, Any]], None] = lambda fields: None,
        admission: Admission = EVERYBODY,
    ) -> None:
        self._admission = admission
        self._rig = rig
        self._period = period
        self._log = log
        signals = rig.signals
        self._filter = CommandFilter(signals.inputs, signals.limits, signals.safe_values)
        self._session: Session | None = None
        self._announce = announce
        self._alarms = Alarms(log, announce)
        self._latch = Latch(rig, log, keeper, self._alarms)
        self._rests_since = monotonic()  # when the rig was last ordered to rest without a latch
        self._refused: list[str] = []
        self._acknowledged = ""  # by whom, since the latch was closed last
        self.counts = dict.fromkeys(
            ("malformed", "late", "repeated", "stale", "refused", "turned away", "missed"), 0
        )
        self._answers: dict[str, Callable[[Peer, Mapping[str, Any]], bytes | None]] = {
            "connect": self._connect,
            "exchange": self._exchange,
            "disconnect": self._disconnect,
            "hand_over": self._hand_over,
            "stop": self._stop,
            "acknowledge": self._acknowledge,
            "shelve": self._shelve,
            "status": lambda peer, message: self._status(),
        }

    # -- messages
    # ----------------------------------------------------------------------------------------------

    def check(self, message: Mapping[str, Any]) -> None:
        """Check a message against the session.

        Parameters
        ----------
        message : Mapping
            A decoded message, see :func:`fmus.rig_proxy.protocol.decode`.

        Raises
        ------
        ProtocolError
            If it is an exchange that does not fit.
        """
        session = self._session
        if message["type"] != "exchange" or session is None or message["session"] != session.key:
            return
        if len(message["values"]) != len(session.commanded):
            raise ProtocolError(
                f"an exchange with {len(message['values'])} values; it takes"
                f" {len(session.commanded)}"
            )
        if self._rig.mode == LOCKSTEP and not 0 <= message["step"] <= _LONGEST_STEP:
            raise ProtocolError(
                f"an exchange with step {message['step']:g} s; allowed are 0 to {_LONGEST_STEP:g} s"
            )

    def answer(self, peer: Peer, message: Mapping[str, Any]) -> bytes | None:
        """Carry out a message, if the role of its sender's key permits it.

        Parameters
        ----------
        peer : Peer
            The sender.
        message : Mapping
            A message that `check` has accepted.

        Returns
        -------
        bytes or None
            The reply, if there is one.
        """
        kind = message["type"]
        peer = self._admission.identify(peer, message)
        reason = self._admission.refusal(peer, kind)
        if reason:
            self._log.tell(f"{kind} by {peer} refused: {reason}", "role")
            return encode("refused", reason=reason)
        return self._answers[kind](peer, message)

    def drop_earlier(self, newer: Mapping[str, Any], earlier: Mapping[str, Any]) -> bool:
        """Count an exchange as late if a newer one of its session waits; else return False.

        Only the newest is carried out, so that lag does not grow. In lockstep all are.
        """
        if self._rig.mode == LOCKSTEP or newer["session"] != earlier["session"]:
            return False
        self.counts["late"] += 1
        return True

    def _connect(self, peer: Peer, message: Mapping[str, Any]) -> bytes:
        """Open a session, unless signals do not fit, or the rig is latched or serves another."""
        name = message["client"][:_LONGEST_NAME]
        reason = describe_misfit(message, self._rig.signals) or self._occupied(peer, message)
        if self._latch.is_closed:
            reason = self._latch.sentence()
        if reason:
            self._log.tell(f"client {name}, {peer}, refused: {reason}", "client refused")
            return encode("refused", reason=reason[:_LONGEST_REASON])
        session = self._session
        if session is None or session.peer != peer.connection or session.sequence > 0:
            session = self._begin_session(peer, message)
            self._log.tell(f"client connected: {name}, {peer}", "client connected")
        return encode(
            "accepted",
            session=session.key,
            clock=self._rig.clock(),
            applied=dict(zip(self._rig.signals.inputs, self._filter.applied, strict=True)),
            **self._constants(),
            **self._sample(session),
        )

    def _begin_session(self, peer: Peer, message: Mapping[str, Any]) -> Session:
        """Begin a session, which goes on from the commands of one that was handed over to it."""
        now = monotonic()
        begun = new_session(message, self._rig.signals, peer, now)
        before = self._session
        if before is not None and before.is_handed_over(message, now):
            begun.go_on(before, self._filter.applied)
            self._log.tell(f"the rig was handed over by {before.client[:_LONGEST_NAME]}")
        else:
            self._end_session("replaced")
        self._session = begun
        return begun

    def _occupied(self, peer: Peer, message: Mapping[str, Any]) -> str:
        """Return the reason for which another client excludes a new one; empty if none does.

        In lockstep any client may replace one that has been silent.
        """
        session = self._session
        if session is None or session.may_be_taken_up(message, peer.connection):
            return ""
        if session.is_handed_over(message, monotonic()):
            return ""
        if self._rig.mode == LOCKSTEP and session.is_silent(monotonic()):
            return ""
        other = "another " * (session.client == message["client"])
        return f"the rig serves {other}{session.client[:_LONGEST_NAME]}; one client at a time"

    def _exchange(self, peer: Peer, message: Mapping[str, Any]) -> bytes | None:
        """Take the commands of an exchange, and return a sample; None for a repeated exchange."""
        session = self._session
        if session is None or message["session"] != session.key:
            return encode("refused", reason=_OVER)
        if session.repeats(message, self.counts):
            return None
        refused = self._command(session, message)
        session.sequence = message["sequence"]
        session.peer = peer.connection
        session.heard = monotonic()
        if not self._latch.is_closed:
            self._rig.advance(message["step"])
            self._supervise()
        return encode(
            "sample",
            session=session.key,
            sequence=session.sequence,
            sent=message["sent"],
            clock=self._rig.clock(),
            state=self.state(),
            reason=self._latch.reason,
            refused=refused,
            **self._sample(session),
        )

    def _command(self, session: Session, message: Mapping[str, Any]) -> list[str]:
        """Carry out the commands of a new exchange, or return the reasons for refusing them."""
        now = self._rig.clock()
        if self._latch.is_closed:
            return [self._latch.sentence()]
        # the first one answers `accepted`, before which a client may take its time
        longest = self._rig.watchdog if session.sequence else FIRST_COMMAND
        reason = stale(message["seen"], now, longest) if self._rig.watchdog else ""
        if reason:
            self.counts["stale"] += 1
            refused = [reason]
        else:
            values = session.blend([message["values"][k] for k in session.commanded], now)
            refused = self._filter.take(values, now, self._longest_rate_time(message))
        self._refused = refused
        if refused:
            self.counts["refused"] += 1
            self._log.tell(f"refused: {'; '.join(refused)}", "refused")
        else:
            session.accepted = now
            self._rig.apply(self._filter.applied, now)
        return refused

    def _longest_rate_time(self, message: Mapping[str, Any]) -> float:
        """Return the longest time in s over which the rate of a command is measured.

        However long the rig rested before, a change counts as one within this time.
        """
        return self._rig.watchdog or float(message["step"])

    def _disconnect(self, peer: Peer, message: Mapping[str, Any]) -> bytes:
        if self._session is not None and message["session"] == self._session.key:
            self._end_session("disconnected")
        return encode("disconnected")

    def _hand_over(self, peer: Peer, message: Mapping[str, Any]) -> bytes:
        session = self._session
        if session is None or message["session"] != session.key:
            return encode("refused", reason=_OVER)
        session.offer(monotonic())
        self._log.tell(f"client {session.client[:_LONGEST_NAME]} offers to hand over")
        return encode("offered")

    def _stop(self, peer: Peer, message: Mapping[str, Any]) -> bytes:
        self.stop(message["reason"][:200] or "somebody stopped it", f" (by {peer})")
        return self._status()

    def _acknowledge(self, peer: Peer, message: Mapping[str, Any]) -> bytes:
        if self._alarms.acknowledge(message["latch"], str(peer)):
            self._acknowledged = str(peer)
            return self._status()
        was_closed = self._latch.is_closed
        refusal = self._latch.acknowledge(message["latch"], str(peer))
        if refusal:
            return encode("refused", reason=refusal)
        if was_closed:
            self._acknowledged = str(peer)
        if was_closed and self._session is not None:
            self._end_session("over")
        return self._status()

    def _shelve(self, peer: Peer, message: Mapping[str, Any]) -> bytes:
        refusal = self._alarms.shelve(message["alarm"], message["time"], str(peer))
        return encode("refused", reason=refusal) if refusal else self._status()

    # -- events without a message
    # --------------------------------------------------------------------------------------

    def stop(self, reason: str, detail: str = "") -> None:
        """Take the rig to its safe state in an emergency, latched.

        Parameters
        ----------
        reason : str
        detail : str
            Further text for the log.
        """
        self._close_latch(f"stopped: {reason}", detail, "stopped again")

    def beat(self) -> None:
        """Show a sign of life of the front to the processes of the rig."""
        self._rig.beat()

    def supervise(self) -> None:
        """Handle events that the rig caused, and messages of the client that are overdue."""
        self._supervise()
        session = self._session
        if session is not None and not self._admission.may_drive(session.owner):
            self._end_session(f"is shut out: the key of {session.owner.holder.name} may not drive")
            session = None
        if self._latch.is_closed or self._rig.mode == LOCKSTEP:
            self._rests_since = monotonic()
            return
        if session is not None and session.never_began(monotonic()):
            self._end_session("has commanded nothing, its session is over")
        if session is None or session.accepted is None:
            self._watch_rest()

    def _supervise(self) -> None:
        """Close the latch for troubles of the rig, raise its alarms, and supervise the latch."""
        for reason in self._rig.troubles():
            self._close_latch(reason)
        for alarm in self._rig.alarms():
            self._alarms.add(alarm.source, MAJOR, alarm.text)
        watch_limits(self._alarms, self._rig.signals, self._rig.state().values)
        self._latch.supervise()

    def _watch_rest(self) -> None:
        """Close the latch if the rig is not at rest although no client commands it."""
        now = monotonic()
        if self._rig.safe_since() is not None:
            self._rests_since = now
        elif now - self._rests_since > self._rig.bound:
            self._close_latch("the rig is not in its safe state, though nobody commands it")

    def _close_latch(self, reason: str, detail: str = "", kind: str = "") -> None:
        """Close the latch, with the age of the last command in the log."""
        age = ""
        if self._session is not None and self._session.accepted is not None:
            age = f" (last fresh command {self._rig.clock() - self._session.accepted:.3f} s ago)"
        self._filter.reset()
        if not self._latch.is_closed:
            self._announce({"source": "latch", "severity": MAJOR, "text": reason})
        self._acknowledged = ""
        self._latch.close(reason, detail + age, kind)

    def _end_session(self, ending: str) -> None:
        """End the session, if there is one, and log the reason; the rig goes to rest."""
        if self._session is not None:
            self._log.tell(f"client {self._session.client[:_LONGEST_NAME]} {ending}", ending)
            self._session = None
        self._filter.reset()
        self._rig.go_safe()
        self._rests_since = monotonic()

    # -- answers and telemetry
    # ----------------------------------------------------------------------------------------------

    def _constants(self) -> dict[str, Any]:
        """Return the fields of a message that do not change."""
        limits = {name: limit.finite() for name, limit in self._rig.signals.limits.items()}
        return {
            "mode": self._rig.mode,
            "period": self._period,
            "watchdog": self._rig.watchdog,
            "limits": limits,
        }

    def _sample(self, session: Session) -> dict[str, Any]:
        """Return the values that a client wants, and their ages."""
        state = self._rig.state()
        ages = state.ages(self._rig.clock())
        return {
            "values": [state.values[k] for k in session.wanted],
            "ages": [ages[k] for k in session.wanted],
        }

    def state(self) -> str:
        """Return the state of the rig, as status and telemetry have it."""
        if self._latch.is_closed:
            return self._latch.state
        return IDLE if self._session is None else RUNNING

    def _state_fields(self) -> dict[str, Any]:
        """Return the fields of status and telemetry on the state, the client and the latch."""
        return {
            "state": self.state(),
            "clock": self._rig.clock(),
            "client": "" if self._session is None else self._session.client,
            "operator": "" if self._session is None else self._session.owner.holder.name,
            **self._latch.fields(),
            "alarm": self._alarms.text,
            "alarms": self._alarms.fields(),
            "acknowledged": self._acknowledged,
        }

    def _status(self) -> bytes:
        self.counts["missed"] = self._rig.state().missed
        signals = self._rig.signals
        named = {"inputs": signals.inputs, "outputs": signals.outputs}
        return encode(
            "status",
            **self._state_fields(),
            **named,
            **self._constants(),
            attributes=signals.attributes,
            counts=self.counts,
        )

    def sample_number(self) -> int:
        """Return the number of the newest sample."""
        return self._rig.state().number

    def telemetry(self) -> bytes:
        """Return the telemetry message about the newest sample."""
        state = self._rig.state()
        signals = self._rig.signals
        now = self._rig.clock()
        accepted = None if self._session is None else self._session.accepted
        refused = self._refused
        self._refused = []
        return encode(
            "telemetry",
            **self._state_fields(),
            inputs=dict(zip(signals.inputs, state.applied, strict=True)),
            read_back={
                name: value
                for name, value in zip(signals.inputs, state.read_back, strict=True)
                if value is not None
            },
            outputs=dict(zip(signals.outputs, state.values, strict=True)),
            ages=dict(zip(signals.outputs, state.ages(now), strict=True)),
            command_age=None if accepted is None else now - accepted,
            refused=refused,
        )
