"""Request handler of the server: sessions, commands and the latch of the safe state.

It gets and returns messages, and knows no socket.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from math import isfinite
from time import monotonic
from typing import Any

from fmus.rig_proxy import IDLE, LOCKSTEP, RUNNING, SAFE, ProtocolError, encode
from orchestration.rig.safety import CommandFilter, stale
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.rig import Rig
from orchestration.rig.server.session import Session, misfit, new_session

_LONGEST_STEP = 60.0  # s, in lockstep: the emulated rig takes it in one go
_LONGEST_REASON = 1000  # characters: names in it may be a stranger's
_LONGEST_NAME = 40  # characters of a client's name in the log


class RequestHandler:
    """Handler of all messages to a rig, which serves one client at a time.

    Parameters
    ----------
    rig : Rig
    period : float
        Of its samples, in s.
    log : EventLog

    Attributes
    ----------
    counts : dict of str to int
        How many messages were dropped or refused, and deadlines missed.
    """

    def __init__(self, rig: Rig, period: float, log: EventLog) -> None:
        self._rig = rig
        self._period = period
        self._log = log
        self._filter = CommandFilter(rig.signals.inputs, rig.signals.limits)
        self._session: Session | None = None
        self._reason = ""  # why the rig is safe; empty while the latch is open
        self._since = ""
        self._opening = False  # the latch is to be opened as soon as the rig can be used
        self._refused: list[str] = []
        self.counts = dict.fromkeys(
            ("malformed", "late", "repeated", "stale", "refused", "turned away", "missed"), 0
        )
        self._answers: dict[str, Callable[[bytes, Mapping[str, Any]], bytes | None]] = {
            "connect": self._connect,
            "exchange": self._exchange,
            "disconnect": self._disconnect,
            "stop": self._stop,
            "acknowledge": self._acknowledge,
            "status": lambda peer, message: self._status(),
        }

    # -- messages
    # ----------------------------------------------------------------------------------------------

    def check(self, message: Mapping[str, Any]) -> None:
        """Check a message against the session.

        Parameters
        ----------
        message : Mapping
            As :func:`fmus.rig_proxy.protocol.decode` gives it.

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

    def answer(self, peer: bytes, message: Mapping[str, Any]) -> bytes | None:
        """Carry out a message.

        Parameters
        ----------
        peer : bytes
            ZeroMQ's name of the connection it came by.
        message : Mapping
            One that was checked.

        Returns
        -------
        bytes or None
            The reply, if there is one.
        """
        return self._answers[message["type"]](peer, message)

    def supersedes(self, message: Mapping[str, Any], before: Mapping[str, Any]) -> bool:
        """Return True if a waiting exchange makes an earlier one useless, which is counted as late.

        Only the newest is carried out, so that lag does not grow.
        """
        if self._rig.mode == LOCKSTEP or message["session"] != before["session"]:
            return False
        self.counts["late"] += 1
        return True

    def _connect(self, peer: bytes, message: Mapping[str, Any]) -> bytes:
        now = monotonic()
        session = self._session
        name = message["client"][:_LONGEST_NAME]
        reason = misfit(message, self._rig.signals)
        if self._reason:
            reason = f"the rig is in its safe state since {self._since}: {self._reason}"
        elif (
            session is not None
            and session.peer != peer
            and not self._gives_way(session, message["client"], now)
        ):
            reason = f"the rig serves {session.client[:_LONGEST_NAME]}; one client at a time"
        if reason:
            self._log.tell(f"client {name} refused: {reason}", "client refused")
            return encode("refused", reason=reason[:_LONGEST_REASON])
        if session is None or session.peer != peer or session.sequence > 0:
            self._end_session("replaced")
            session = new_session(message, self._rig.signals, peer, now)
            self._session = session
            self._log.tell(f"client connected: {name}")
        return encode(
            "accepted",
            session=session.key,
            clock=self._rig.clock(),
            **self._constants(),
            **self._sample(session),
        )

    def _gives_way(self, session: Session, client: str, now: float) -> bool:
        """Return True if a client may take over a session.

        Its own client may, if the answer to it was lost; in lockstep anybody may, if its client has
        been silent.
        """
        unheard = session.client == client and session.sequence == 0
        return unheard or (self._rig.mode == LOCKSTEP and session.is_silent(now))

    def _exchange(self, peer: bytes, message: Mapping[str, Any]) -> bytes | None:
        session = self._session
        if session is None or message["session"] != session.key:
            return encode(
                "refused",
                reason="this session is over, or of a server before this one; connect again",
            )
        if session.repeats(message, self.counts):
            return None
        session.sequence = message["sequence"]
        session.peer = peer
        session.heard = monotonic()
        refused = self._command(session, message)
        if not self._reason:
            self._rig.advance(message["step"])
            self._supervise()
        return encode(
            "sample",
            session=session.key,
            sequence=session.sequence,
            sent=message["sent"],
            clock=self._rig.clock(),
            state=SAFE if self._reason else RUNNING,
            reason=self._reason,
            refused=refused,
            **self._sample(session),
        )

    def _command(self, session: Session, message: Mapping[str, Any]) -> list[str]:
        """Carry out the commands of a new exchange, or return the reasons for refusing them."""
        now = self._rig.clock()
        if self._reason:
            return ["the rig is in its safe state"]
        reason = stale(message["seen"], now, self._rig.watchdog) if self._rig.watchdog else ""
        if reason:
            self.counts["stale"] += 1
            refused = [reason]
        else:
            values = [message["values"][k] for k in session.commanded]
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
        """Return the longest time that the rate of a command is measured over.

        However long the rig rested before, a change counts as one within this time.
        """
        return self._rig.watchdog or float(message["step"])

    def _disconnect(self, peer: bytes, message: Mapping[str, Any]) -> bytes:
        if self._session is not None and message["session"] == self._session.key:
            self._end_session("disconnected")
        return encode("disconnected")

    def _stop(self, peer: bytes, message: Mapping[str, Any]) -> bytes:
        self.stop(message["reason"][:200] or "somebody stopped it")
        return self._status()

    def _acknowledge(self, peer: bytes, message: Mapping[str, Any]) -> bytes:
        if self._reason and not self._opening:
            self._log.tell(f"acknowledged: {self._reason}")
            self._end_session("over")
            self._rig.release()
            self._opening = True
            self._supervise()
        return self._status()

    # -- what happens by itself
    # --------------------------------------------------------------------------------------

    def stop(self, reason: str) -> None:
        """Take the rig to its safe state in an emergency, latched.

        Parameters
        ----------
        reason : str
        """
        self._latch(f"stopped: {reason}")

    def beat(self) -> None:
        """Show the processes of the rig that the front is alive."""
        self._rig.beat()

    def supervise(self) -> None:
        """Notice what the rig has done by itself, and end a session that never began."""
        self._supervise()
        session = self._session
        if (
            session is not None
            and self._rig.mode != LOCKSTEP
            and not self._reason
            and session.never_began(monotonic())
        ):
            self._end_session("has commanded nothing, its session is over")

    def _supervise(self) -> None:
        for reason in self._rig.troubles():
            self._latch(reason)
        if self._opening:
            waiting = self._rig.opening()
            self._reason = waiting
            if not waiting:
                self._opening = False
                self._log.tell("ready again")

    def _latch(self, reason: str) -> None:
        self._opening = False
        if not self._reason:
            self._since = datetime.now().strftime("%H:%M:%S")
        self._reason = " ".join(reason.split())
        self._filter.reset()
        self._rig.go_safe()
        age = ""
        if self._session is not None and self._session.accepted is not None:
            age = f" (last fresh command {self._rig.clock() - self._session.accepted:.3f} s ago)"
        self._log.tell(f"SAFE STATE: {self._reason}{age}")

    def _end_session(self, how: str) -> None:
        if self._session is not None:
            self._log.tell(f"client {self._session.client[:_LONGEST_NAME]} {how}")
            self._session = None
        self._filter.reset()
        self._rig.go_safe()

    # -- what is answered and published
    # ----------------------------------------------------------------------------------------------

    def _constants(self) -> dict[str, Any]:
        limits = {
            name: {key: bound if isfinite(bound) else None for key, bound in vars(limit).items()}
            for name, limit in self._rig.signals.limits.items()
        }
        return {
            "mode": self._rig.mode,
            "period": self._period,
            "watchdog": self._rig.watchdog,
            "limits": limits,
        }

    def _sample(self, session: Session) -> dict[str, Any]:
        state = self._rig.state()
        ages = state.ages(self._rig.clock())
        return {
            "values": [state.values[k] for k in session.wanted],
            "ages": [ages[k] for k in session.wanted],
        }

    def _who(self) -> dict[str, Any]:
        state = IDLE if self._session is None else RUNNING
        if self._reason:
            state = SAFE
        client = "" if self._session is None else self._session.client
        return {
            "state": state,
            "reason": self._reason,
            "clock": self._rig.clock(),
            "client": client,
        }

    def _status(self) -> bytes:
        self.counts["missed"] = self._rig.state().missed
        signals = self._rig.signals
        named = {"inputs": signals.inputs, "outputs": signals.outputs}
        return encode("status", **self._who(), **named, **self._constants(), counts=self.counts)

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
            **self._who(),
            inputs=dict(zip(signals.inputs, state.applied, strict=True)),
            outputs=dict(zip(signals.outputs, state.values, strict=True)),
            ages=dict(zip(signals.outputs, state.ages(now), strict=True)),
            command_age=None if accepted is None else now - accepted,
            refused=refused,
        )
