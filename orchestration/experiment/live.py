"""Runs in real time: a journal of the recorded values, and reports of progress."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Signals
from fmus.rig_proxy import LOST, REFUSED
from orchestration.experiment.preparation import Preparation
from orchestration.experiment.tuning import Tuner as Tuner
from orchestration.master import RealTime
from orchestration.records import Journal

# outputs of a proxy about its link; the others are the `_age` of each value
_LINK_STATE = "link_state"
_LINK = (_LINK_STATE, "round_trip_time", "missed_deadlines")
# by link_state, why the loop over a rig is open, while the models go on without it
_OPEN = {
    REFUSED: "the rig refuses a command",
    LOST: "the link to the rig is lost",
}


@dataclass(frozen=True)
class Moment:
    """State of a run in real time at a communication point.

    Attributes
    ----------
    time, end : float
        Communication point, and the last one, s.
    lag : float
        Delay of the point before, s.
    missed : int
        Deadlines missed so far.
    link : Mapping of str to float
        Outputs of proxies about their links, in their units.
    trouble : str
        Error that ended the journal; empty if there was none.
    """

    time: float
    end: float
    lag: float
    missed: int
    link: Mapping[str, float]
    trouble: str


@dataclass(frozen=True)
class RigEnd:
    """Address of a rig and key file for it, from the parameters of a proxy.

    Attributes
    ----------
    endpoint, credentials : str
        Address like ``tcp://HOST:PORT``, and key file, empty if the rig has no keys.
    """

    endpoint: str
    credentials: str


@dataclass(frozen=True)
class Live:
    """Options of a run in real time.

    Attributes
    ----------
    pace : RealTime
    admit : callable
        Called before the start with the pace, the ends of all rigs and the step in s; returns the
        pace of the run, or raises `UserError` if this machine cannot keep it.
    journal : Path or None
        New file that keeps the recorded values until the result is written.
    look : callable
        Called at every point with a `Moment`.
    tuner : Tuner
        Moves parameters between steps.
    """

    pace: RealTime = field(default_factory=RealTime)
    admit: Callable[[RealTime, Sequence[RigEnd], float], RealTime] = lambda pace, rigs, step: pace
    journal: Path | None = None
    look: Callable[[Moment], None] = lambda moment: None
    tuner: Tuner = field(default_factory=Tuner)


def link_outputs(outputs: Collection[str]) -> list[str]:
    """List the outputs about links to rigs: those of `_LINK`, and the age of every value."""
    variables = {name: name.rpartition(".")[2] for name in outputs}
    return [name for name, var in variables.items() if var.endswith("_age") or var in _LINK]


def rig_ends(prepared: Preparation) -> list[RigEnd]:
    """List the rigs to which the proxies of an experiment connect, by their parameters."""
    subject = prepared.subject
    prefixes = [name.removesuffix(_LINK_STATE) for name in subject.outputs if _is_link_state(name)]

    def text_of(name: str) -> str:
        return str(prepared.settings.get(name, subject.parameters[name].text))

    return [
        RigEnd(text_of(f"{prefix}endpoint"), text_of(f"{prefix}credentials"))
        for prefix in prefixes
        if {f"{prefix}endpoint", f"{prefix}credentials"} <= subject.parameters.keys()
    ]


def admitted(live: Live, prepared: Preparation) -> Live:
    """Return options with the admitted pace; UserError if this machine cannot keep it."""
    step = float(prepared.time[1] - prepared.time[0])
    return replace(live, pace=live.admit(live.pace, rig_ends(prepared), step))


def first_open_loop(time: Sequence[float], signals: Signals) -> tuple[int, str] | None:
    """Find the first point at which a loop over a rig is open; from there on models run alone.

    Parameters
    ----------
    time : sequence of float
        Of n points, in s.
    signals : Mapping of str to ndarray, shape (n,)
        Outputs, among them the ``link_state`` of every proxy.

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
    return first, _describe_open_loop(name, time[first], int(signals[name][first]))


def _is_link_state(name: str) -> bool:
    return name.rpartition(".")[2] == _LINK_STATE


def _describe_open_loop(name: str, time: float, state: int) -> str:
    return f"{name} at {time:.10g} s: {_OPEN[state]}"


class Follower:
    """Observer of a prepared run: it writes the journal, and reports every point.

    Parameters
    ----------
    live : Live
    prepared : Preparation

    Raises
    ------
    UserError
        If the journal cannot be created.
    """

    def __init__(self, live: Live, prepared: Preparation):
        self._look = live.look
        self._tuner = live.tuner
        self._time = prepared.time.tolist()
        self._inputs = [array.data for array in prepared.inputs.values()]
        indices = {name: k for k, name in enumerate(prepared.wanted)}
        self._recorded = [indices[name] for name in prepared.record]
        self._link = {name: indices[name] for name in link_outputs(prepared.record)}
        units = {name: prepared.signals[name].unit for name in (*prepared.inputs, *prepared.record)}
        self._journal = Journal(live.journal, units) if live.journal is not None else None
        self.pace = replace(live.pace, watch=self._watch)

    def _watch(self, k: int, values: Sequence[float], lag: float, missed: int) -> None:
        """Write point `k` with the values of all wanted outputs into the journal, and report it.

        Raises
        ------
        UserError
            If the loop over a rig is open, so that the run ends and the rig goes to zero.
        """
        self._tuner.advance(k)
        trouble = ""
        if self._journal is not None:
            inputs = [column[k] for column in self._inputs]
            outputs = [values[index] for index in self._recorded]
            self._journal.add(self._time[k], inputs + outputs)
            trouble = self._journal.error
        link = {name: values[index] for name, index in self._link.items()}
        self._look(Moment(self._time[k], self._time[-1], lag, missed, link, trouble))
        for name, value in link.items():
            if _is_link_state(name) and value in _OPEN:
                raise UserError(_describe_open_loop(name, self._time[k], int(value)))

    def close(self) -> None:
        """Close the journal, so that all its rows are on the disk."""
        if self._journal is not None:
            self._journal.close()
