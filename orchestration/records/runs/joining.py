"""Several runs as one record with gaps, and names of parameters that differ between runs.

A parameter with one value for all runs has its plain name, ``R1``; its value in a single run has
the label of the run in its name, ``R1@b``. Start values always differ between runs. Fits, noise
models and pictures use the joined record; only a simulation is made run by run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.sampling import evenly_sampled

_MARK = "@"
_ALIKE = 0.1  # largest relative difference of median steps of runs that are sampled alike


@dataclass(frozen=True)
class MeasuredRun:
    """A run as a part of a joined record.

    Attributes
    ----------
    label : str
        Label in the names of its own values; empty for a single run.
    first, last : int
        Index of its first sample in the joined record, and index past its last one.
    ahead : float
        Time of the joined record minus time of the run, in seconds.
    record : str
        Name of the record if the run is a part of it between gaps; else empty.
    """

    label: str
    first: int
    last: int
    ahead: float = 0.0
    record: str = ""

    @property
    def samples(self) -> slice:
        """Slice of the run's samples in the joined record."""
        return slice(self.first, self.last)

    def own(self, name: str) -> str:
        """Return the name of a parameter's value in this run alone."""
        return f"{name}{_MARK}{self.label}" if self.label else name

    def values(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return the values of parameters in this run, by plain name."""
        shared = {name: value for name, value in parameters.items() if _MARK not in name}
        own = {base_name(n): x for n, x in parameters.items() if n == self.own(base_name(n))}
        return shared | own


def base_name(name: str) -> str:
    """Return the name of a parameter without the label of a run."""
    return name.partition(_MARK)[0]


def sampled_alike(time: Array, runs: Sequence[MeasuredRun]) -> bool:
    """Return whether every run is evenly sampled, and all at about the same rate."""
    parts = [time[run.samples] for run in runs if run.last - run.first > 1]
    steps = [float(np.median(np.diff(part))) for part in parts]
    return (
        bool(steps)
        and all(map(evenly_sampled, parts))
        and max(steps) <= (1.0 + _ALIKE) * min(steps)
    )


def join_records(count: int, runs: Sequence[MeasuredRun], parts: Sequence[Array]) -> Array:
    """Return an array of `count` samples with the values of each run at its place.

    A gap gets the first value of the run after it, and the end the last value of the last run, so
    that no value changes at the edge of a run.
    """
    values = np.empty((count, *parts[0].shape[1:]), parts[0].dtype)
    end = 0
    for run, part in zip(runs, parts, strict=True):
        values[end : run.first] = part[0]
        values[run.samples] = part
        end = run.last
    values[end:] = parts[-1][-1]
    return values
