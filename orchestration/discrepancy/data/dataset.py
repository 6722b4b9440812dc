"""A measured record, or several as one, as every step of the diagnosis takes it; estimation data are such a dataset."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from orchestration.records.clock import gaps
from orchestration.records.joined import Run, joined, sampled_alike

Array = NDArray[np.float64]
# Samples between two runs at which nothing was measured: more than any filter remembers, and than the lags at which a
# residual is held against signals, so that neither reaches across.
GAP = 32
PIECE = 32  # samples, without which what is between two gaps tells little but where it starts


@dataclass(frozen=True)
class Dataset:
    """Inputs and measured outputs over time, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs, measured : Mapping of str to ndarray, shape (n,)
        NaN in an output is a gap.
    linear : bool or collection of str, optional
        Inputs that are smooth (`smooth_inputs`), all or those named; others are held until the next sample. None leaves
        it to the diagnosis.
    several : tuple of Run
        Where it is made of several records, one after the other with a gap between them; empty for one record.
    """

    time: Array
    inputs: Mapping[str, Array]
    measured: Mapping[str, Array]
    linear: bool | Collection[str] | None = None
    several: tuple[Run, ...] = ()

    @classmethod
    def joined(cls, records: Mapping[str, Dataset], of: Mapping[str, str] | None = None) -> Dataset:
        """Join records to one, by what each is called; an output that one of them lacks has a gap there.

        Parameters
        ----------
        records : Mapping of str to Dataset
        of : Mapping of str to str, optional
            What records are called that some of these are pieces of.
        """
        parts = list(records.values())
        step = float(np.median(np.concatenate([np.diff(part.time) for part in parts])))
        runs: list[Run] = []
        for label, part in records.items():
            first, ahead = 0, 0.0
            if runs:
                before, last = parts[len(runs) - 1], runs[-1]
                first = last.last + GAP
                ahead = before.time[-1] + last.ahead + (GAP + 1) * step - part.time[0]
            runs.append(
                Run(label, first, first + len(part.time), float(ahead), (of or {}).get(label, ""))
            )
        count = runs[-1].last
        time = joined(
            count, runs, [part.time + run.ahead for part, run in zip(parts, runs, strict=True)]
        )
        for run in runs[1:]:
            time[run.first - GAP : run.first] = time[run.first] - step * np.arange(GAP, 0, -1)
        inputs = {
            n: joined(count, runs, [part.inputs[n] for part in parts]) for n in parts[0].inputs
        }
        outputs = dict.fromkeys(name for part in parts for name in part.measured)
        measured = {name: np.full(count, np.nan) for name in outputs}
        for run, part in zip(runs, parts, strict=True):
            for name, values in part.measured.items():
                measured[name][run.samples] = values
        return cls(time, inputs, measured, parts[0].linear, tuple(runs))

    def pieces(self, label: str = "") -> dict[str, Dataset]:
        """What of a record is between gaps in its time, where nobody knows what the inputs did; itself without any.

        Where samples come in short bursts, so that this would leave out most of them, the record stays as it is.

        Parameters
        ----------
        label : str
            What the record is called; pieces are numbered after it.
        """
        ends = [0, *(gaps(self.time) + 1).tolist(), len(self.time)]
        parts = [(a, b) for a, b in pairwise(ends) if b - a >= PIECE]
        if len(ends) == 2 or 2 * sum(b - a for a, b in parts) < len(self.time):
            return {label: self}
        return {
            f"{label}.{k}" if label else str(k): self.part(a, b)
            for k, (a, b) in enumerate(parts, 1)
        }

    @property
    def runs(self) -> tuple[Run, ...]:
        """What it is made of; a record by itself is a run without a name."""
        return self.several or (Run("", 0, len(self.time)),)

    @property
    def within(self) -> NDArray[np.bool_]:
        """Samples (n,) of any of the runs."""
        result = np.zeros(len(self.time), dtype=bool)
        for run in self.runs:
            result[run.samples] = True
        return result

    @property
    def even(self) -> bool:
        """Whether samples are equally spaced, in all runs alike."""
        return sampled_alike(self.time, self.runs)

    def only(self, outputs: Collection[str]) -> Dataset:
        """Some of the outputs."""
        return replace(self, measured={o: y for o, y in self.measured.items() if o in outputs})

    def apart(self) -> dict[str, Dataset]:
        """Every run by itself, by its own clock."""
        parts = {}
        for run in self.runs:
            inputs, measured = self._picked(run.samples)
            parts[run.label] = Dataset(
                self.time[run.samples] - run.ahead, inputs, measured, self.linear
            )
        return parts

    def runs_of(self, labels: Sequence[str]) -> Dataset:
        """Some of the runs, joined anew."""
        parts, of = self.apart(), {run.label: run.record for run in self.runs}
        return Dataset.joined({label: parts[label] for label in labels}, of)

    def part(self, first: int, last: int) -> Dataset:
        """Samples from one to before another."""
        return self.where(slice(first, last))

    def where(self, cut: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Dataset:
        """Some of the samples, in their order; runs of which none is left are gone."""
        inputs, measured = self._picked(cut)
        kept = np.arange(len(self.time))[cut]
        ends = [np.searchsorted(kept, [run.first, run.last]).tolist() for run in self.several]
        several = tuple(
            replace(run, first=a, last=b)
            for run, (a, b) in zip(self.several, ends, strict=True)
            if b > a
        )
        return replace(self, time=self.time[cut], inputs=inputs, measured=measured, several=several)

    def _picked(self, cut: slice | NDArray[np.bool_] | NDArray[np.intp]) -> list[dict[str, Array]]:
        return [{n: v[cut] for n, v in group.items()} for group in (self.inputs, self.measured)]
