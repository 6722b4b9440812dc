"""Records that were put together from pieces: cut and closed up, shuffled, or of two specimens.

Where one piece ends and another begins the states of the plant jump, and so do the errors of a
model that runs on. A model that starts anew there leaves less.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_dilation, median_filter

from fmus.kit.arrays import Array, Mask
from orchestration.diagnosis.local_values import LocalValues
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.subject import Subject
from orchestration.records.quality import jumps_of, noise_of

_JUMP = 12.0  # times the usual change of the error, which noise with heavy tails hardly reaches
_SUDDEN = 2.5  # times the usual change beside it: the error of a model goes on changing
_BESIDE = 8  # samples on each side that say what is usual there
_APART = 40  # samples of a piece at least
_MOST = 12  # of one record; a plant that hits a stop again and again has more
_NEARER = 0.5  # of the error that is left by a model that starts anew
_WIDTHS = 2.0  # of the noise, up to which an error is noise
_USUAL = 0.75  # quantile of the changes at jumps of an input, which a model may miss


@dataclass(frozen=True)
class Pieced:
    """A record as pieces.

    Attributes
    ----------
    subject : Subject
    records : tuple of Record
    times : tuple of float
        Where each but the first begins, s.
    is_of_others : bool
        Whether the second piece has parameters of its own: it is of another specimen.
    """

    subject: Subject
    records: tuple[Record, ...]
    times: tuple[float, ...]
    is_of_others: bool

    @property
    def note(self) -> tuple[str, str, str]:
        """Code, record and sentence of a remark on it."""
        label = self.records[0].label.rpartition(".")[0]
        times = ", ".join(f"{time:.6g}" for time in self.times)
        jumps = f"the states of the plant jump at t = {times} s, where no input makes them"
        if self.is_of_others:
            text = f"in {label} {jumps}, and the parameters are others from there on: it is two"
            return "other_specimen", label, f"{text} records, of two specimens"
        text = (
            f"in {label} {jumps}: it was cut or joined there, or the plant slipped, and it is taken"
            f" as {len(self.records)} records"
        )
        return "pieced", label, text


def pieced(
    subject: Subject,
    records: Sequence[Record],
    subject_of: Callable[[list[Record], LocalValues], Subject | None],
) -> Pieced | None:
    """Return a record as pieces, if a model that starts anew leaves less than half of the error.

    And nothing but noise.

    Parameters
    ----------
    subject : Subject
        Of the whole record.
    records : sequence of Record
        As they were read; of several none is cut.
    subject_of : callable
        Makes the subject of pieces with local values.
    """
    gaps = _joints(subject)
    if not gaps:
        return None
    (record,) = records
    pieces = _cut(record, gaps)
    halves = [replace(piece, group=k) for k, piece in enumerate(_cut(record, gaps[:1]))]
    each = LocalValues(tuple(piece.label for piece in halves), tuple(subject.problem.names))
    shared, own = subject_of(pieces, LocalValues()), subject_of(halves, each)
    whole, of_pieces, of_halves = map(_error, (subject, shared, own))
    if own is not None and of_halves < _NEARER * min(whole, of_pieces) and _leaves_noise(own):
        return Pieced(own, tuple(halves), (gaps[0][1],), True)
    if shared is not None and of_pieces < _NEARER * whole and _leaves_noise(shared):
        return Pieced(shared, tuple(pieces), tuple(sorted(after for _, after in gaps)), False)
    return None


def _leaves_noise(subject: Subject) -> bool:
    """Return whether a model leaves noise alone: one that lacks a law jumps where the plant does.

    Slack that is taken up looks like a joint.
    """
    errors = np.concatenate(subject.base.errors)
    known = np.isfinite(errors).sum(axis=0) > _APART
    return all(
        float(np.sqrt(np.nanmean(error**2))) < _WIDTHS * noise_of(error)
        for error in errors.T[known]
    )


def _error(subject: Subject | None) -> float:
    """Return the larger of the errors where a model is fitted and where it is not, in spreads."""
    judged = None if subject is None else subject.judge(subject.base)
    if subject is None or judged is None:
        return np.inf
    fitted, unseen = np.concatenate(subject.base.errors), judged.choosing
    return float(np.sqrt(max(np.nanmean(fitted**2), np.nanmean(unseen**2))))


def _joints(subject: Subject) -> list[tuple[float, float]]:
    """Return between which times errors jump as nothing else does there, the largest jump first.

    None where they jump so often that the plant does, or where another record is left out.
    """
    unseen = subject.left_out[0]
    if len(subject.problem.records) > 1 or unseen.of is None or unseen.is_between:
        return []
    after = subject.errors(subject.base, unseen)
    if after is None:
        return []
    record = unseen.record
    errors = np.concatenate([subject.base.errors[0], after])
    sizes = np.max([_jumps(error) for error in errors.T], axis=0, initial=0.0)
    sizes = _beyond_inputs(sizes, record)
    places: list[int] = []
    for k in map(int, np.argsort(-sizes)):
        if sizes[k] < _JUMP:
            break
        ends = [0, *places, len(record.time)]
        if min(abs(k + 1 - end) for end in ends) >= _APART:
            places.append(k + 1)
    if len(places) > _MOST:
        return []
    return [(float(record.time[k - 1]), float(record.time[k])) for k in places]


def _jumps(error: Array) -> Array:
    """Return the changes (n - 1,) of an error (n,) over the usual one, where they are sudden."""
    # of the level around as well: an outlier changes that of no three samples
    level = np.pad(median_filter(error, 3, mode="nearest"), 1, mode="edge")
    changes = np.minimum(np.abs(np.diff(error)), np.abs(level[3:] - level[:-3]))
    known = changes[np.isfinite(changes)]
    usual = float(np.median(known)) if known.size else 0.0
    if not usual > 0.0:
        return np.zeros(len(changes))
    changes = np.nan_to_num(changes)
    beside = median_filter(changes, 2 * _BESIDE + 1, mode="nearest")
    return np.where(changes > _SUDDEN * beside, changes / usual, 0.0)


def _beyond_inputs(sizes: Array, record: Record) -> Array:
    """Return sizes (n - 1,) but for those at jumps of an input that are as usual there.

    A single jump of an input that moves in between is one of a joint.
    """
    steps = _steps(record)
    if not steps.any():
        return sizes
    near = binary_dilation(steps, iterations=1)
    peaks = [sizes[max(k - 1, 0) : k + 2].max() for k in np.flatnonzero(steps)]
    return np.where(near & (sizes <= _SUDDEN * np.quantile(peaks, _USUAL)), 0.0, sizes)


def _steps(record: Record) -> Mask:
    """Return between which samples (n - 1,) an input jumps as it does all along."""
    result = np.zeros(len(record.time) - 1, dtype=bool)
    for values in record.inputs.T:
        jumps = jumps_of(values)
        stands = np.median(np.abs(np.diff(values))) <= 1e-9 * np.ptp(values)
        if stands or jumps.sum() > _MOST:
            result |= jumps
    return result


def _cut(record: Record, gaps: Sequence[tuple[float, float]]) -> list[Record]:
    """Return the pieces of a record between times at which one ends and the next begins."""
    between = sorted(gaps)
    firsts = [0, *(int(np.searchsorted(record.time, after)) for _, after in between)]
    lasts = [int(np.searchsorted(record.time, before, side="right")) for before, _ in between]
    pieces = []
    for number, (first, last) in enumerate(zip(firsts, [*lasts, len(record.time)], strict=True), 1):
        part = record.part(first, last)
        start = float(part.time[0])
        label = f"{record.label}.{number}"
        pieces.append(
            replace(part, time=part.time - start, begin=record.begin - start, label=label)
        )
    return pieces
