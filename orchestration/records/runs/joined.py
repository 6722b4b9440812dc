"""Several records as one: where each run begins and ends, and which values are a run's own.

A parameter of all runs has its name, ``R1``; the value that it has in one run alone is called after
that run, ``R1@b``. States start in every run anew, so start values are of this second kind wherever
there are several runs. Whoever fits, whitens or draws sees one long record with gaps in it, and
names; only what simulates looks at the runs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.sampling import evenly_sampled

_MARK = "@"
_ALIKE = 0.1  # relative difference of their steps, up to which runs are sampled alike


@dataclass(frozen=True)
class MeasuredRun:
    """One of several runs that are joined to one record.

    Attributes
    ----------
    label : str
        What its own values are called after; empty where it is the only run, which needs no name.
    first, last : int
        Its first sample in the joined record, and the one past its last.
    ahead : float
        Seconds by which the clock of the joined record is ahead of its own.
    record : str
        What the record is called that it is a part of, between gaps; empty where it is a whole one.
    """

    label: str
    first: int
    last: int
    ahead: float = 0.0
    record: str = ""

    @property
    def samples(self) -> slice:
        """Its samples."""
        return slice(self.first, self.last)

    def own(self, name: str) -> str:
        """Name of the value that a parameter has in this run alone."""
        return f"{name}{_MARK}{self.label}" if self.label else name

    def values(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Parameters by their plain names, as they are in this run."""
        plain = {name: value for name, value in parameters.items() if _MARK not in name}
        return plain | {
            base_name(n): x
            for n, x in parameters.items()
            if _MARK in n and n == self.own(base_name(n))
        }


def base_name(name: str) -> str:
    """Name of a parameter without that of a run."""
    return name.partition(_MARK)[0]


def shown_name(name: str) -> str:
    """Name as it is shown: ``ocv (run 3)``."""
    base, _, label = name.partition(_MARK)
    return f"{base} (run {label})" if label else base


def names_in(runs: Sequence[MeasuredRun], names: Iterable[str], own: Iterable[str]) -> list[str]:
    """Names to search over several runs: those that are each run's own once for every run."""
    each = set(own)
    return [
        n for name in names for n in ([run.own(name) for run in runs] if name in each else [name])
    ]


def sampled_alike(time: Array, runs: Sequence[MeasuredRun]) -> bool:
    """Return whether samples are equally spaced in every run, and in all of them alike."""
    parts = [time[run.samples] for run in runs if run.last - run.first > 1]
    steps = [float(np.median(np.diff(part))) for part in parts]
    return (
        bool(steps)
        and all(map(evenly_sampled, parts))
        and max(steps) <= (1.0 + _ALIKE) * min(steps)
    )


def join_records(count: int, runs: Sequence[MeasuredRun], parts: Sequence[Array]) -> Array:
    """Return the values of all runs at their places among so many samples.

    A gap before a run holds the run's first value, and what is behind the last run its last one, so
    that nothing changes at the edge of what was measured.
    """
    values = np.empty((count, *parts[0].shape[1:]), parts[0].dtype)
    end = 0
    for run, part in zip(runs, parts, strict=True):
        values[end : run.first] = part[0]
        values[run.samples] = part
        end = run.last
    values[end:] = parts[-1][-1]
    return values
