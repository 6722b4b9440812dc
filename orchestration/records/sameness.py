"""Records that hold the same samples, of which one says nothing that the other does not."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.records.record import Record

_ROUNDED = 1e-6  # of the spread of a signal, to which a file may have rounded it


def refuse_same(records: Sequence[Record], outputs: Collection[str], option: str = "") -> None:
    """Refuse records that hold the same samples: one says nothing that the other does not.

    Figures may be rounded, in another unit or otherwise ordered, and the clock may be another;
    noise is never the same.

    Parameters
    ----------
    records : sequence of Record
    outputs : collection of str
        Outputs of the model; records that have none of them in common are two, however similar
        their inputs are.
    option : str
        Command-line option that gave the last record.

    Raises
    ------
    UserError
        Naming the first two that are the same.
    """
    for number, record in enumerate(records):
        for other in records[:number]:
            if _same_samples(record, other, outputs):
                name = f"{option} {record.source}".strip()
                raise UserError(
                    f"{name}: this is the same record as {other.source}; it tells nothing more"
                )


def _same_samples(one: Record, other: Record, outputs: Collection[str]) -> bool:
    """Return True if two records have an output in common and all common signals are the same."""
    common = one.signals.keys() & other.signals.keys()
    if one.time.size != other.time.size or common.isdisjoint(outputs):
        return False
    pairs = [(one.signals[name], other.signals[name]) for name in common]
    pairs.append((one.time - one.time[0], other.time - other.time[0]))
    return all(_equal_but_for_rounding(a, b) for a, b in pairs)


def _equal_but_for_rounding(a: Array, b: Array) -> bool:
    """Return True if two signals are the same but for rounding."""
    finite = np.isfinite(a)
    spread = float(np.ptp(a[finite])) if finite.any() else 0.0
    return bool(np.allclose(a, b, rtol=_ROUNDED, atol=_ROUNDED * spread, equal_nan=True))
