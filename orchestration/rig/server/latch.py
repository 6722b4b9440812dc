"""Latch of the safe state: any stop or fault closes it, an acknowledgement that names it opens it.

It says no more than is known: that the rig is on its way to the safe state, that it is confirmed to
be there, or that this was not confirmed in time, which is an alarm until somebody acknowledges it.
"""

from __future__ import annotations

from datetime import datetime
from secrets import token_hex
from time import monotonic
from typing import Any

from fmus.rig_proxy import NOT_REACHED, SAFE, STOPPING
from orchestration.rig.server.alarms import MAJOR, SAFE_STATE, Alarms
from orchestration.rig.server.latch_file import LatchKeeper, LatchRecord
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.rig import Rig

_LONGEST_REASON = 1000  # characters: names in it may be a stranger's
# s beyond the bound that a process may take to start, which opens the device anew after an
# acknowledgement; the rig was left in its safe state
_LONGEST_START = 5.0
_UNCONFIRMED = "the safe state is not confirmed yet"
_SENTENCES = {
    STOPPING: "the rig is on its way to its safe state",
    SAFE: "the rig is in its safe state",
    NOT_REACHED: "THE SAFE STATE OF THE RIG WAS NOT REACHED",
}


class Latch:
    """Latch of a rig: while it is closed, the rig is in its safe state or on the way to it.

    A stop or a fault closes it. An acknowledgement that names it opens it, as soon as the safe
    state is confirmed.

    Parameters
    ----------
    rig : Rig
    log : EventLog
    keeper : LatchKeeper
        Stores the latch, so that it stays closed when the server is started again.
    alarms : Alarms
        Get one if the safe state is not reached.

    Attributes
    ----------
    name : str
        Name of this closing, which an acknowledgement has to give; empty while it is open.
    reason : str
        Reason for which it is closed, or the condition that it waits for to open.
    state : str
        ``stopping``, ``safe`` or ``not reached`` while it is closed, ``safe`` while it is open.
    reached : float or None
        Time in s from closing the latch to the safe state; None until that is confirmed.
    """

    def __init__(self, rig: Rig, log: EventLog, keeper: LatchKeeper, alarms: Alarms) -> None:
        self._rig = rig
        self._log = log
        self._keeper = keeper
        self._alarms = alarms
        self._open()
        stored = keeper.held
        if stored is not None:
            if stored.alarm:
                alarms.add(SAFE_STATE, MAJOR, stored.alarm)
            self._close(stored)
            self._log.tell(
                f"LATCHED since {stored.since}, before this start: {stored.reason}; ppy rig"
                " acknowledge releases it"
            )
            self._confirm()

    def _open(self) -> None:
        """Set all attributes to those of an open latch."""
        self.name = ""
        self.reason = ""
        self._alarm = ""  # that the safe state was not reached
        self.state = SAFE
        silent = self._rig.signals.unreported
        names = ", ".join(silent)
        self._unverified = (
            f" (commanded safe, not verified: the device does not report {names})" * bool(silent)
        )
        self.reached: float | None = None
        self._since = ""  # wall time
        self._cause = ""  # for which it was closed
        self._closed = 0.0  # time of the rig's clock when it was closed, s
        self._lacking = 0.0  # monotonic time since when there has been no confirmation, s
        self._is_opening = False

    @property
    def is_closed(self) -> bool:
        """True while the rig must not be commanded."""
        return bool(self.name)

    def close(self, reason: str, detail: str = "", kind: str = "") -> None:
        """Order the safe state and keep the rig there.

        Every call makes another latch, which an acknowledgement of the one before does not open.

        Parameters
        ----------
        reason : str
        detail : str
            Further text for the log.
        kind : str
            Kind of the line in the log (see `EventLog.tell`), used if the latch is closed already.
        """
        if self.is_closed:
            self._confirm()  # what the order below makes out of date
        self._rig.go_safe()
        one_line = " ".join(reason.split())[:_LONGEST_REASON]
        since = datetime.now().isoformat(" ", "seconds")
        kind_of_line = kind if self.is_closed else ""  # the first line is always written
        self._close(LatchRecord(token_hex(8), one_line, self._alarm, since))
        self._keep()
        self._log.tell(f"SAFE STATE: {one_line}{detail}", kind_of_line)
        self._confirm()

    def _close(self, record: LatchRecord) -> None:
        """Set the attributes to those of a closed latch."""
        # else the rig has been on its way since the stop before
        if self.state == SAFE or self._is_opening:
            self.state = STOPPING
            self._lacking = monotonic()
        self.reached = None
        self._closed = self._rig.clock()
        self.name = record.name
        self.reason = self._cause = record.reason
        self._alarm = record.alarm
        self._since = record.since
        self._is_opening = False

    def _keep(self) -> None:
        """Store the present state of the latch."""
        record = LatchRecord(self.name, self._cause, self._alarm, self._since)
        self._keeper.keep(record if self.is_closed else None)

    def acknowledge(self, name: str, who: str) -> str:
        """Open the latch as soon as the rig can be used and its safe state is confirmed.

        Parameters
        ----------
        name : str
            Name of the latch that is acknowledged.
        who : str
            Sender of the acknowledgement, for the log.

        Returns
        -------
        str
            Reason of a refusal; empty without one.
        """
        if name != self.name and self.is_closed:
            refusal = f"the present latch is {self.name} ({self._cause}), not {name[:40]!r}"
            self._log.tell(f"acknowledgement by {who} refused: {refusal}", "not acknowledged")
            return refusal
        if self.is_closed and not self._is_opening:
            self._log.tell(f"latch {name} acknowledged by {who}: {self._cause}")
            self._rig.release()
            self._is_opening = True
            self.supervise()
        return ""

    def supervise(self) -> None:
        """Check whether the safe state is confirmed, and open the latch that was acknowledged."""
        if not self.is_closed:
            return
        self._confirm()
        if not self._is_opening:
            return
        self.reason = self._rig.opening() or ("" if self.state == SAFE else _UNCONFIRMED)
        if not self.reason:
            self._open()
            self._alarms.remove(SAFE_STATE)
            self._keep()
            self._log.tell("ready again")

    def _confirm(self) -> None:
        """Update the state by whether the rig is confirmed to be safe; alarm if that is late."""
        now = monotonic()
        since = self._rig.safe_since()
        if since is not None:
            self._lacking = now  # a confirmation that is lost has as much time to come back
            if self.state != SAFE:
                self.state = SAFE
                if self.reached is None:  # else it was left and is reached again
                    self.reached = max(0.0, since - self._closed)
                self._log.tell(
                    f"safe, reached after {_duration(self.reached)}{self._unverified}",
                    "safe state confirmed",
                )
        elif self.state != NOT_REACHED:
            self.state = STOPPING
            denial = self._rig.denial()
            if denial:
                self._alarm_of_state(f": {denial}")
            elif now - self._lacking > self._rig.bound + _LONGEST_START * self._is_opening:
                self._alarm_of_state(f" within {_duration(self._rig.bound)}")

    def _alarm_of_state(self, why: str) -> None:
        """Note that the safe state was not reached."""
        self.state = NOT_REACHED
        self.reached = None
        self._alarm = f"THE SAFE STATE WAS NOT REACHED{why}"
        self._alarms.add(SAFE_STATE, MAJOR, f"{self._alarm}; see to the rig itself")
        self._keep()

    def sentence(self) -> str:
        """Return a sentence on the state of the rig and its reason."""
        state = f"{_SENTENCES[self.state]}{self._unverified if self.state == SAFE else ''}"
        return f"{state} since {self._since}: {self.reason}"[:_LONGEST_REASON]

    def fields(self) -> dict[str, Any]:
        """Return the fields of the latch in status and telemetry."""
        return {
            "reason": self.reason,
            "latch": self.name,
            "reached": self.reached,
            "verified": not self._rig.signals.unreported,
        }


def _duration(seconds: float) -> str:
    return f"{1000 * seconds:.0f} ms" if seconds < 1 else f"{seconds:.1f} s"
