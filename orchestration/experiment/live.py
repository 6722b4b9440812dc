"""An experiment in real time while it runs: a journal of its record, and news of its progress."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.rig_proxy import LOST, REFUSED
from orchestration.experiment.preparation import Preparation
from orchestration.master import RealTime
from orchestration.records import Journal

_LINK = (
    "link_state",
    "round_trip_time",
    "missed_deadlines",
)  # outputs of a proxy, beside the `_age` of every value
# by link_state: what leaves a loop open over a rig, while its models go on without it
_OPEN = {
    REFUSED: "the rig refuses a command",
    LOST: "the link to the rig is lost",
}


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
class RigEnd:
    """Address of a rig, and the keys for it, as the parameters of a proxy have them.

    Attributes
    ----------
    endpoint, credentials : str
        Address like ``tcp://HOST:PORT``, and key file; empty without.
    """

    endpoint: str
    credentials: str


def _as_asked(pace: RealTime, rigs: Sequence[RigEnd], step: float) -> RealTime:
    """Return a pace as it is."""
    return pace


@dataclass(frozen=True)
class Live:
    """Options of a run in real time.

    Attributes
    ----------
    pace : RealTime
    admit : callable
        Called before anything moves with the pace, the ends of all rigs and the step in s; returns
        the pace that is kept, or raises `UserError` where the machine cannot hold it.
    journal : Path or None
        File that takes what is recorded until the result is written; it must not be there yet.
    look : callable
        Called at every point.
    """

    pace: RealTime = field(default_factory=RealTime)
    admit: Callable[[RealTime, Sequence[RigEnd], float], RealTime] = _as_asked
    journal: Path | None = None
    look: Callable[[Moment], None] = lambda moment: None


def link_outputs(outputs: Collection[str]) -> list[str]:
    """List outputs that describe a link to a rig: the age of every value, and the link's own."""
    last = {name: name.rpartition(".")[2] for name in outputs}
    return [name for name, own in last.items() if own.endswith("_age") or own in _LINK]


def rig_ends(prepared: Preparation) -> list[RigEnd]:
    """List the rigs that the proxies of an experiment ask."""
    on = prepared.on
    prefixes = [name.removesuffix(_LINK[0]) for name in on.outputs if _is_link_state(name)]

    def text(name: str) -> str:
        return str(prepared.settings.get(name, on.parameters[name].text))

    return [
        RigEnd(text(f"{prefix}endpoint"), text(f"{prefix}credentials"))
        for prefix in prefixes
        if {f"{prefix}endpoint", f"{prefix}credentials"} <= on.parameters.keys()
    ]


def admitted(live: Live, prepared: Preparation) -> Live:
    """Return options with the pace that is kept; UserError where the machine cannot hold it."""
    step = float(prepared.time[1] - prepared.time[0])
    return replace(live, pace=live.admit(live.pace, rig_ends(prepared), step))


def first_opening(time: Sequence[float], signals: Mapping[str, Array]) -> tuple[int, str] | None:
    """Find the first point at which the loop over a rig was open.

    From there on its models go on without it.

    Parameters
    ----------
    time : sequence of float
        Of n points, in s.
    signals : Mapping of str to ndarray, shape (n,)
        Outputs; of those, the ``link_state`` of every proxy is looked at.

    Returns
    -------
    tuple of int and str, or None
        Index of the point, and the reason; None if no loop was open.
    """
    openings = []
    for name in filter(_is_link_state, signals):
        is_open = np.isin(signals[name], [*_OPEN])
        if is_open.any():
            openings.append((int(np.argmax(is_open)), name))
    if not openings:
        return None
    first, name = min(openings)
    return first, _reason(name, time[first], int(signals[name][first]))


def _is_link_state(name: str) -> bool:
    return name.rpartition(".")[2] == _LINK[0]


def _reason(name: str, time: float, state: int) -> str:
    return f"{name} at {time:.10g} s: {_OPEN[state]}"


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
        """Put a point into the journal, and report how the run is doing.

        Raises
        ------
        UserError
            If the loop over a rig is open: the run is to end, and the rig to go to zero.
        """
        trouble = ""
        if self._journal is not None:
            row = [column[k] for column in self._inputs] + [
                values[place] for place in self._recorded
            ]
            self._journal.add(self._time[k], row)
            trouble = self._journal.error
        link = {name: values[place] for name, place in self._link.items()}
        self._look(Moment(self._time[k], self._time[-1], lag, missed, link, trouble))
        for name, value in link.items():
            if _is_link_state(name) and value in _OPEN:
                raise UserError(_reason(name, self._time[k], int(value)))

    def close(self) -> None:
        """Bring what is in the journal to the disk."""
        if self._journal is not None:
            self._journal.close()
