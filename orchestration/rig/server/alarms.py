"""Alarms of a rig: each has a source, a severity and a name, and its history is the log.

As in EPICS, an alarm stays until its cause is over and somebody has acknowledged it; a source can
be shelved for a while (EPICS Alarm Handler; ISA-18.2, 4.2.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from secrets import token_hex
from time import monotonic
from typing import Any

from orchestration.rig.safety import excess
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.log import EventLog
from orchestration.rig.signals import Limit
from orchestration.rig.stuck import least_change

MAJOR, MINOR = "MAJOR", "MINOR"
SAFE_STATE = "safe state"  # the source that cannot be shelved
LONGEST_SHELF = 86400.0  # s
_LONGEST_TEXT = 1000  # characters: names in it may be a stranger's
_NAME = 4  # bytes


@dataclass
class AlarmRecord:
    """An alarm whose cause is not over yet, or that nobody has acknowledged.

    Attributes
    ----------
    source : str
        Signal or state that it is about; it has one alarm at a time.
    name : str
        Name of this alarm, which an acknowledgement has to give.
    severity : {"MAJOR", "MINOR"}
    text : str
    since : str
        Wall time.
    active : bool
        Whether its cause persists.
    acknowledged : bool
    """

    source: str
    name: str
    severity: str
    text: str
    since: str
    active: bool
    acknowledged: bool = False


class Alarms:
    """The alarms of a rig.

    Parameters
    ----------
    log : EventLog
    announce : callable
        Called with the fields of each new alarm.
    """

    def __init__(
        self, log: EventLog, announce: Callable[[Mapping[str, Any]], None] = lambda fields: None
    ) -> None:
        self._log = log
        self._announce = announce
        self._records: dict[str, AlarmRecord] = {}
        self._shelved: dict[str, float] = {}  # until when, by source, s

    def add(self, source: str, severity: str, text: str, *, lasts: bool = False) -> None:
        """Add an alarm in place of an older one of its source, unless it is the same.

        Parameters
        ----------
        source : str
        severity : {"MAJOR", "MINOR"}
        text : str
        lasts : bool
            Whether its cause persists until :meth:`end`.
        """
        shown = " ".join(text.split())[:_LONGEST_TEXT]
        before = self._records.get(source)
        if before is not None and before.active and lasts:
            return
        since = datetime.now().isoformat(" ", "seconds")
        record = AlarmRecord(source, token_hex(_NAME), severity, shown, since, lasts)
        self._records[source] = record
        self._log.tell(f"ALARM {record.name} ({severity}): {shown}", source)
        if not self._is_shelved(source):
            self._announce(asdict(record))

    def end(self, source: str) -> None:
        """Note that the cause of a source's alarm is over."""
        record = self._records.get(source)
        if record is not None and record.active:
            record.active = False
            self._log.tell(f"the cause of alarm {record.name} is over: {record.text}", source)
            self._forget(record)

    def acknowledge(self, name: str, who: str) -> bool:
        """Acknowledge an alarm; return False if there is none of this name.

        Parameters
        ----------
        name : str
        who : str
            Sender of the acknowledgement, for the log.
        """
        for record in self._records.values():
            if record.name == name:
                record.acknowledged = True
                self._log.tell(f"alarm {name} acknowledged by {who}: {record.text}")
                self._forget(record)
                return True
        return False

    def remove(self, source: str) -> None:
        """Remove the alarm of a source, which was acknowledged with the latch."""
        self._records.pop(source, None)

    def _forget(self, record: AlarmRecord) -> None:
        if record.acknowledged and not record.active:
            del self._records[record.source]

    def shelve(self, name: str, seconds: float, who: str) -> str:
        """Show no alarm of a source for a while.

        Parameters
        ----------
        name : str
            Name of its present alarm.
        seconds : float
            0 ends it.
        who : str
            For the log.

        Returns
        -------
        str
            Reason of a refusal; empty without one.
        """
        source = next((one.source for one in self._records.values() if one.name == name), "")
        if not source or source == SAFE_STATE or not 0.0 <= seconds <= LONGEST_SHELF:
            return (
                f"alarm {name[:40]!r} cannot be shelved for {seconds:g} s: allowed are 0 to"
                f" {LONGEST_SHELF:g} s, of an alarm that is there and not of the safe state"
            )
        self._shelved[source] = monotonic() + seconds
        self._log.tell(f"alarms of {source} shelved for {seconds:g} s by {who}")
        return ""

    def _is_shelved(self, source: str) -> bool:
        return monotonic() < self._shelved.get(source, 0.0)

    @property
    def text(self) -> str:
        """Text of all open alarms, the most severe first; empty without one."""
        return "; ".join(record.text for record in self._shown())[:_LONGEST_TEXT]

    def _shown(self) -> Iterator[AlarmRecord]:
        for severity in (MAJOR, MINOR):
            for record in self._records.values():
                is_open = not (record.acknowledged or self._is_shelved(record.source))
                if record.severity == severity and is_open:
                    yield record

    def fields(self) -> list[dict[str, Any]]:
        """Return the fields of all alarms for status and telemetry, the newest last."""
        return [
            {**asdict(record), "shelved": self._is_shelved(record.source)}
            for record in self._records.values()
        ]


def watch_limits(alarms: Alarms, signals: BackendSignals, values: Sequence[float | None]) -> None:
    """Add an alarm for every value beyond its limits of warning, and end those of others.

    Parameters
    ----------
    alarms : Alarms
    signals : BackendSignals
    values : sequence of float or None
        The newest value of each output.
    """
    for (name, unit), value in zip(signals.outputs.items(), values, strict=True):
        hard = signals.limits.get(name, Limit())
        limit = Limit(hard.warn_min, hard.warn_max)
        if value is None or limit == Limit():
            continue
        fault = excess(limit, value, None, 0.0, unit)
        margin = least_change(limit)  # a value that wavers about its limit is one alarm
        if fault:
            text = f"{name} {value:.6g} {unit} {fault}, its limit of warning"
            alarms.add(name, MINOR, text, lasts=True)
        elif limit.min + margin <= value <= limit.max - margin:
            alarms.end(name)
