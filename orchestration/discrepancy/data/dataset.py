"""The dataset of a diagnosis: inputs and measured outputs of one model over time.

A dataset is made of one record or of several, which are joined to one with gaps between them.
Estimation data and validation data are datasets too.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.fmu import Model
from orchestration.records import Record
from orchestration.records.quality import Channels
from orchestration.records.runs import MeasuredRun, join_records, sampled_alike
from orchestration.records.sampling import gaps

# Samples between two runs at which nothing was measured: more than any filter remembers, and than
# the lags at which a residual is compared with signals, so that neither reaches across.
GAP = 32
PIECE = 32  # samples; a shorter piece between two gaps shows little but where it starts


@dataclass(frozen=True)
class Dataset:
    """Inputs and measured outputs over time, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs, measured : Mapping of str to ndarray, shape (n,)
        NaN in an output is a gap.
    linear : bool or collection of str, optional
        Inputs that are smooth (`smooth_inputs`), all or those named; others are held until the next
        sample. None leaves it to the diagnosis.
    several : tuple of MeasuredRun
        The runs where it is made of several records, one after the other with a gap between them;
        empty for one record.
    """

    time: Array
    inputs: Mapping[str, Array]
    measured: Mapping[str, Array]
    linear: bool | Collection[str] | None = None
    several: tuple[MeasuredRun, ...] = ()

    @classmethod
    def joined(
        cls, datasets: Mapping[str, Dataset], record_of: Mapping[str, str] | None = None
    ) -> Dataset:
        """Join datasets to one; an output that one of them lacks has a gap there.

        Parameters
        ----------
        datasets : Mapping of str to Dataset
            By label, in their order.
        record_of : Mapping of str to str, optional
            By label, the record of which a dataset is a piece.
        """
        parts = list(datasets.values())
        step = float(np.median(np.concatenate([np.diff(part.time) for part in parts])))
        runs = _consecutive_runs(datasets, step, record_of or {})
        count = runs[-1].last
        shifted = [part.time + run.ahead for part, run in zip(parts, runs, strict=True)]
        time = join_records(count, runs, shifted)
        for run in runs[1:]:
            time[run.first - GAP : run.first] = time[run.first] - step * np.arange(GAP, 0, -1)
        inputs = {
            name: join_records(count, runs, [part.inputs[name] for part in parts])
            for name in parts[0].inputs
        }
        outputs = dict.fromkeys(name for part in parts for name in part.measured)
        measured = {name: np.full(count, np.nan) for name in outputs}
        for run, part in zip(runs, parts, strict=True):
            for name, values in part.measured.items():
                measured[name][run.samples] = values
        return cls(time, inputs, measured, parts[0].linear, tuple(runs))

    def pieces(self, label: str = "") -> dict[str, Dataset]:
        """Cut the record at gaps in its time, during which nobody knows what the inputs did.

        Where samples come in short bursts, so that this would leave out most of them, the record
        stays as it is.

        Parameters
        ----------
        label : str
            Name of the record; pieces are numbered after it.

        Returns
        -------
        dict of str to Dataset
            By label; the whole record alone if it has no gaps.
        """
        ends = [0, *(gaps(self.time) + 1).tolist(), len(self.time)]
        spans = [(first, last) for first, last in pairwise(ends) if last - first >= PIECE]
        if len(ends) == 2 or 2 * sum(last - first for first, last in spans) < len(self.time):
            return {label: self}
        return {
            f"{label}.{number}" if label else str(number): self.part(first, last)
            for number, (first, last) in enumerate(spans, 1)
        }

    @property
    def runs(self) -> tuple[MeasuredRun, ...]:
        """The runs that it is made of; a record by itself is a run without a name."""
        return self.several or (MeasuredRun("", 0, len(self.time)),)

    @property
    def within(self) -> Mask:
        """Mask (n,) of the samples that belong to a run."""
        result = np.zeros(len(self.time), dtype=bool)
        for run in self.runs:
            result[run.samples] = True
        return result

    @property
    def even(self) -> bool:
        """True if samples are equally spaced, and as far from each other in all runs."""
        return sampled_alike(self.time, self.runs)

    @property
    def channels(self) -> Channels:
        """The channels in which faults are looked for."""
        named = self.linear or ()
        smooth = frozenset(self.inputs if isinstance(named, bool) else named)
        return Channels(self.time, self.inputs, self.measured, smooth)

    def with_channels(self, channels: Channels) -> Dataset:
        """Return the dataset of one run with other samples."""
        return replace(self, time=channels.time, inputs=channels.inputs, measured=channels.outputs)

    def only(self, outputs: Collection[str]) -> Dataset:
        """Return the dataset with some of its outputs."""
        return replace(self, measured={o: y for o, y in self.measured.items() if o in outputs})

    def by_run(self) -> dict[str, Dataset]:
        """Return every run as a dataset of its own, by its own clock."""
        parts = {}
        for run in self.runs:
            parts[run.label] = Dataset(
                self.time[run.samples] - run.ahead,
                _select(self.inputs, run.samples),
                _select(self.measured, run.samples),
                self.linear,
            )
        return parts

    def runs_of(self, labels: Sequence[str]) -> Dataset:
        """Join some of the runs anew."""
        parts = self.by_run()
        record_of = {run.label: run.record for run in self.runs}
        return Dataset.joined({label: parts[label] for label in labels}, record_of)

    def part(self, first: int, last: int) -> Dataset:
        """Return the samples from one to before another."""
        return self.where(slice(first, last))

    def beginning(self, share: float) -> Dataset:
        """Return so much of the beginning of every run."""
        chosen = np.zeros(len(self.time), dtype=bool)
        for run in self.runs:
            chosen[run.first : run.first + round(share * (run.last - run.first))] = True
        return self.where(chosen)

    def where(self, cut: slice | Mask | Indices) -> Dataset:
        """Return some of the samples, in their order; runs that lose all samples are dropped."""
        kept = np.arange(len(self.time))[cut]
        several = []
        for run in self.several:
            first, last = np.searchsorted(kept, [run.first, run.last]).tolist()
            if last > first:
                several.append(replace(run, first=first, last=last))
        return replace(
            self,
            time=self.time[cut],
            inputs=_select(self.inputs, cut),
            measured=_select(self.measured, cut),
            several=tuple(several),
        )


def _consecutive_runs(
    datasets: Mapping[str, Dataset], step: float, record_of: Mapping[str, str]
) -> list[MeasuredRun]:
    """Place datasets one after the other, with `GAP` samples of a step between them."""
    runs: list[MeasuredRun] = []
    end = 0.0  # of the run before, by the joined clock
    for label, dataset in datasets.items():
        first = 0
        shift = 0.0
        if runs:
            first = runs[-1].last + GAP
            shift = float(end + (GAP + 1) * step - dataset.time[0])
        record = record_of.get(label, "")
        runs.append(MeasuredRun(label, first, first + len(dataset.time), shift, record))
        end = dataset.time[-1] + shift
    return runs


def _select(signals: Mapping[str, Array], cut: slice | Mask | Indices) -> dict[str, Array]:
    return {name: values[cut] for name, values in signals.items()}


def dataset_of(
    record: Record, model: Model, given: Mapping[str, float], interpolate: bool | None = None
) -> Dataset:
    """Take the inputs and real outputs of a model from a record.

    Parameters
    ----------
    record : Record
    model : Model
    given : Mapping of str to float
        Values of inputs, SI, which go before what was recorded. An input that is neither given nor
        recorded stays at its start value.
    interpolate : bool, optional
        True if inputs go smoothly between samples, False if they are held; None leaves it to the
        diagnosis.
    """
    given_inputs = {name: value for name, value in given.items() if name in model.inputs}
    constant = {
        name: signal.start for name, signal in model.inputs.items() if signal.type == "real"
    } | given_inputs
    inputs = {name: np.full(record.time.size, value) for name, value in constant.items()}
    inputs |= {
        name: values
        for name, values in record.signals.items()
        if name in model.inputs and name not in given_inputs
    }
    real = {name for name, signal in model.outputs.items() if signal.type == "real"}
    measured = {name: values for name, values in record.signals.items() if name in real}
    return Dataset(record.time, inputs, measured, interpolate)


def joined_dataset(
    records: Mapping[str, Record],
    model: Model,
    given: Mapping[str, float],
    interpolate: bool | None = None,
) -> Dataset:
    """Make one dataset of records, which are cut at gaps in time and joined.

    A single record without a gap and without a label is taken as it is.

    Parameters
    ----------
    records : Mapping of str to Record
        By label.
    model, given, interpolate
        See :func:`dataset_of`.
    """
    pieces = dict[str, Dataset]()
    record_of = dict[str, str]()
    for label, record in records.items():
        cut = dataset_of(record, model, given, interpolate).pieces(label)
        pieces |= cut
        if len(cut) > 1:
            record_of |= dict.fromkeys(cut, label or "the record")
    if [*pieces] == [""]:
        return pieces[""]
    return Dataset.joined(pieces, record_of)


def gap_notes(records: Sequence[Record]) -> list[Note]:
    """Return a note for every record that has gaps in its time."""
    notes = []
    for record in records:
        pieces = Dataset(record.time, {}, {}).pieces().values()
        if len(pieces) > 1:
            facts = {
                "record": record.source.name,
                "longest": float(np.diff(record.time).max()),
                "pieces": len(pieces),
                "lost": record.time.size - sum(piece.time.size for piece in pieces),
            }
            notes.append(Note(NoteCode.GAPS, record.label, facts))
    return notes
