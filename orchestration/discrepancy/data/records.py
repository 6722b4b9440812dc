"""From records to data: inputs and outputs of a model, of one record or of several that are joined."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.fmu.model import Model
from orchestration.records import Record

_ROUNDED = 1e-6  # of the spread of a signal, to which a file may have rounded it


def dataset(
    record: Record, model: Model, given: Mapping[str, float], interpolate: bool | None = None
) -> Dataset:
    """Inputs and real outputs of a record; inputs that are absent are constant, as given or as they start.

    Parameters
    ----------
    record : Record
    model : Model
    given : Mapping of str to float
        Of inputs, SI.
    interpolate : bool, optional
        Whether inputs go smoothly between samples, or are held; None leaves it to the record.
    """
    own = {n: value for n, value in given.items() if n in model.inputs}
    constant = {
        n: signal.start for n, signal in model.inputs.items() if signal.type == "real"
    } | own
    inputs = {n: np.full(record.time.size, value) for n, value in constant.items()}
    inputs |= {
        n: values for n, values in record.signals.items() if n in model.inputs and n not in own
    }
    real = {n for n, signal in model.outputs.items() if signal.type == "real"}
    measured = {n: values for n, values in record.signals.items() if n in real}
    return Dataset(record.time, inputs, measured, interpolate)


def joined_dataset(
    records: Mapping[str, Record],
    model: Model,
    given: Mapping[str, float],
    interpolate: bool | None = None,
) -> Dataset:
    """Return the same of records without gaps in time, joined; by their labels. One alone needs none.

    Parameters
    ----------
    records : Mapping of str to Record
    model, given, interpolate
        See :func:`dataset`.
    """
    pieces, of = dict[str, Dataset](), dict[str, str]()
    for label, record in records.items():
        divided = dataset(record, model, given, interpolate).pieces(label)
        pieces |= divided
        of |= dict.fromkeys(divided, label or "the record") if len(divided) > 1 else {}
    return pieces[""] if [*pieces] == [""] else Dataset.joined(pieces, of)


def refuse_same(records: Sequence[Record], outputs: Collection[str], option: str = "") -> None:
    """Refuse records that hold the same samples: one says nothing that the other does not.

    Figures may be rounded, in another unit or otherwise ordered, and the clock may be another; noise is never the same.

    Parameters
    ----------
    records : sequence of Record
    outputs : collection of str
        What is measured; records that have none in common are two, however alike their inputs are.
    option : str
        That gave the last one.

    Raises
    ------
    UserError
        Naming the first two that are the same.
    """
    for k, one in enumerate(records):
        for other in records[:k]:
            if _same_samples(one, other, outputs):
                what = f"{option} {one.source}".strip()
                raise UserError(
                    f"{what}: this is the same record as {other.source}; it tells nothing more"
                )


def _same_samples(one: Record, other: Record, outputs: Collection[str]) -> bool:
    common = one.signals.keys() & other.signals.keys()
    if one.time.size != other.time.size or common.isdisjoint(outputs):
        return False
    pairs = [(one.signals[name], other.signals[name]) for name in common]
    pairs.append((one.time - one.time[0], other.time - other.time[0]))
    return all(_alike(a, b) for a, b in pairs)


def _alike(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether two signals are the same but for rounding."""
    there = np.isfinite(a)
    spread = float(np.ptp(a[there])) if there.any() else 0.0
    return bool(np.allclose(a, b, rtol=_ROUNDED, atol=_ROUNDED * spread, equal_nan=True))


def gap_notes(records: Sequence[Record]) -> list[Note]:
    """What is to be said of gaps in the time of records."""
    notes = []
    for record in records:
        parts = Dataset(record.time, {}, {}).pieces().values()
        if len(parts) > 1:
            steps = np.diff(record.time)
            facts = {
                "record": record.source.name,
                "longest": float(steps.max()),
                "pieces": len(parts),
            }
            lost = record.time.size - sum(part.time.size for part in parts)
            notes.append(Note(NoteCode.GAPS, record.label, facts | {"lost": lost}))
    return notes


def labels(records: Sequence[Record]) -> list[str]:
    """What each of several records is called: by the label of its run, by its file, by both, or by its number."""
    files = [record.source.stem for record in records]
    runs = [record.label for record in records]
    both = [f"{file}:{run}" if run else file for file, run in zip(files, runs, strict=True)]
    for names in (runs, files, both):
        if all(names) and len(set(names)) == len(names):
            return names
    return [str(k) for k in range(1, len(records) + 1)]
