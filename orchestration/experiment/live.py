"""An experiment in real time while it runs: a journal of its record, and news of its progress."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from orchestration.experiment.preparation import Preparation
from orchestration.master import RealTime
from orchestration.records import Journal

_LINK = (
    "link_state",
    "round_trip_time",
    "missed_deadlines",
)  # outputs of a proxy, beside the `_age` of every value


@dataclass(frozen=True)
class Moment:
    """State of a run in real time.

    Attributes
    ----------
    time, end : float
        Communication point, and the last one, s.
    lag : float
        By how much the point before was late, s.
    missed : int
        Deadlines missed so far.
    link : Mapping of str to float
        Outputs of proxies about their links, in their units.
    trouble : str
        Why nothing goes to the journal any more; empty if all is well.
    """

    time: float
    end: float
    lag: float
    missed: int
    link: Mapping[str, float]
    trouble: str


@dataclass(frozen=True)
class Live:
    """Options of a run in real time.

    Attributes
    ----------
    pace : RealTime
    journal : Path or None
        File that takes what is recorded until the result is written; it must not be there yet.
    look : callable
        Called at every point.
    """

    pace: RealTime = field(default_factory=RealTime)
    journal: Path | None = None
    look: Callable[[Moment], None] = lambda moment: None


def link_outputs(outputs: Collection[str]) -> list[str]:
    """List outputs that describe a link to a rig: the age of every value, and the link's own."""
    last = {name: name.rpartition(".")[2] for name in outputs}
    return [name for name, own in last.items() if own.endswith("_age") or own in _LINK]


class Follower:
    """Follows a run that has been prepared.

    Parameters
    ----------
    live : Live
    prepared : Preparation

    Raises
    ------
    UserError
        If the journal cannot be made.
    """

    def __init__(self, live: Live, prepared: Preparation):
        self._look = live.look
        self._time = prepared.time.tolist()
        self._inputs = [array.tolist() for array in prepared.inputs.values()]
        places = {name: place for place, name in enumerate(prepared.wanted)}
        self._recorded = [places[name] for name in prepared.record]
        self._link = {name: places[name] for name in link_outputs(prepared.record)}
        units = {name: prepared.signals[name].unit for name in (*prepared.inputs, *prepared.record)}
        self._journal = Journal(live.journal, units) if live.journal is not None else None
        self.pace = replace(live.pace, watch=self._watch)

    def _watch(self, k: int, values: Sequence[float], lag: float, missed: int) -> None:
        """Put a point into the journal, and tell how the run is doing."""
        trouble = ""
        if self._journal is not None:
            row = [column[k] for column in self._inputs] + [
                values[place] for place in self._recorded
            ]
            self._journal.add(self._time[k], row)
            trouble = self._journal.error
        link = {name: values[place] for name, place in self._link.items()}
        self._look(Moment(self._time[k], self._time[-1], lag, missed, link, trouble))

    def close(self) -> None:
        """Bring what is in the journal to the disk."""
        if self._journal is not None:
            self._journal.close()
