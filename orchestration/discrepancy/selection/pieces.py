"""Records that were put together from pieces: cut and closed up, shuffled, or of two specimens.

Where one piece ends and another begins, the state of the plant jumps. A fitted model predicts every
sample from those before it, and is far off there as nowhere else. It is tried whether a model that
starts anew at these places is much nearer, with the same parameters in every piece or with others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import ndtri

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import PIECE, Dataset
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection.misfit import (
    MUCH_NEARER,
    free_run_error,
    refitted_error,
)
from orchestration.discrepancy.selection.search import Search
from orchestration.records.sampling import input_steps

# Standard deviations of the innovations, from which on one is a jump: heavy tails of noise reach as
# far now and then, but a model that starts anew there is no nearer for it.
_JUMP = 12.0
# times what is usual where inputs step, from which on a jump is more than the answer to a step
_UNUSUAL = 2.5
_ABOUT = 8  # samples before and after one, which tell how an output changes there,
_SUDDEN = 2.5  # and times as much as that, from which on its change is a jump
_USUAL = 0.75  # quantile of the innovations at steps, which is the usual one
_EARLY, _LATE = 1, PIECE  # samples before and after a step at which its answer is seen, be it late
_LONE = 20  # steps of inputs that else go smoothly, up to which they may be made by joining
_MOST = 12  # jumps of one record; a plant that hits a stop again and again has more
_LEAST = 0.01  # error over the spread, below which nobody would notice that a record was cut


def pieced_together(search: Search, base: FittedCandidate) -> list[Note]:
    """Return a note if a record was put together from pieces, one at most.

    Parameters
    ----------
    search : Search
        Over the record as it is.
    base : FittedCandidate
        The model without effects, fitted to that.
    """
    if search.data.several or search.budget.spent():
        return []
    if free_run_error(base) < _LEAST:
        return []
    sizes = _jumps(base, search.data)
    joints = _joints(sizes)
    if not joints or len(joints) > _MOST:
        return []
    data = _without_outliers(search.data, joints)
    whole = refitted_error(search, data)
    if whole < _LEAST:
        return []
    largest = [max(joints, key=lambda k: sizes[k])]
    shared = min(_error(search, data, pieces) for pieces in (largest, joints))
    own = _error(search, data, largest, search.parameters)
    if own < MUCH_NEARER * min(shared, whole):
        return [_note(NoteCode.OTHER_SPECIMEN, data, largest, whole, own)]
    if shared < MUCH_NEARER * whole:
        return [_note(NoteCode.PIECED, data, joints, whole, shared)]
    return []


def _note(
    code: NoteCode, data: Dataset, joints: Sequence[int], present: float, instead: float
) -> Note:
    instants = tuple(float(data.time[k]) for k in joints)
    return Note(code, "", {"instants": instants, "share": present, "instead": instead})


def _jumps(base: FittedCandidate, data: Dataset) -> Array:
    """Return the largest sudden innovation of all outputs in deviations, by sample (n,).

    Where inputs step it is zero, unless it is far beyond what is usual there.
    """
    sizes = _sudden_innovations(base, data)
    steps = np.flatnonzero(input_steps(data.inputs, len(sizes)))
    if len(steps) <= _LONE and _are_smooth_else(data, steps):
        return sizes
    return _beyond_usual_answers(sizes, data, steps)


def _sudden_innovations(base: FittedCandidate, data: Dataset) -> Array:
    """Return the largest innovation of all outputs in deviations (n,), zero where it is gradual."""
    sizes = np.zeros(len(data.time))
    for output, innovation in base.fit.innovation.items():
        at = np.flatnonzero(base.problem.present[output])
        deviation = float(np.median(np.abs(innovation))) / float(ndtri(0.75))
        if deviation > 0.0:
            # after a gap the sample before is long ago
            counts = _is_sudden(data.measured[output][at]) & (np.diff(at, prepend=-1) == 1)
            sizes[at] = np.maximum(sizes[at], counts * np.abs(innovation) / deviation)
    return sizes


def _beyond_usual_answers(sizes: Array, data: Dataset, steps: Indices) -> Array:
    """Return sizes (n,) without the answers to steps that are as usual for the inputs that step."""
    beyond = sizes.copy()
    answers = [slice(max(k - _EARLY, 0), k + _LATE + 1) for k in steps]
    peaks = np.array([sizes[answer].max() for answer in answers])
    stepping = np.array(
        [input_steps({name: u}, len(sizes))[steps] for name, u in data.inputs.items()]
    )
    for place, answer in enumerate(answers):
        of_same = (stepping == stepping[:, [place]]).all(axis=0)
        of_same[place] = False
        usual = float(np.quantile(peaks[of_same], _USUAL)) if of_same.any() else np.inf
        beyond[answer] = np.where(beyond[answer] > _UNUSUAL * usual, beyond[answer], 0.0)
    return beyond


def _is_sudden(y: Array) -> Mask:
    """Return where an output (n,) changes as it does at none of the samples about, by and large.

    A signal that turns, at the corner of a triangle or at a stop, does not.
    """
    change = np.abs(np.diff(y, prepend=y[:1]))
    usual = median_filter(change, 2 * _ABOUT + 1, mode="nearest")
    return np.asarray(change > _SUDDEN * usual)


def _are_smooth_else(data: Dataset, steps: Indices) -> bool:
    """Return whether inputs that step move as far between their steps.

    One that is held between them, with noise or without, is what was fed.
    """
    for u in data.inputs.values():
        sizes = np.abs(np.diff(u, prepend=u[:1]))[steps]
        if not sizes.any():
            continue
        moved = [np.ptp(part) for part in np.split(u, steps) if len(part) > _ABOUT]
        if not moved or np.median(moved) < np.median(sizes[sizes > 0.0]):
            return False
    return True


def _joints(sizes: Array) -> list[int]:
    """Return the samples at which a piece begins, where none would be too short to tell anything.

    Parameters
    ----------
    sizes : ndarray, shape (n,)
        Of jumps, in standard deviations.
    """
    joints: list[int] = []
    for k in map(int, np.argsort(-sizes)):
        if sizes[k] < _JUMP:
            break
        ends = [0, *joints, len(sizes)]
        if min(abs(k - end) for end in ends) >= PIECE:
            joints.append(k)
    return sorted(joints)


def _without_outliers(data: Dataset, joints: Sequence[int]) -> Dataset:
    """Return data without what was measured just where it jumps.

    Of an outlier nothing is left then, and the plant was somewhere else after a joint.
    """
    at = np.array(joints)[:, np.newaxis] + np.arange(-_EARLY, _EARLY + 1)
    measured = {output: y.copy() for output, y in data.measured.items()}
    for y in measured.values():
        y[at] = np.nan
    return replace(data, measured=measured)


def _error(search: Search, data: Dataset, joints: Sequence[int], each: Sequence[str] = ()) -> float:
    """Return the error of a model that starts anew at joints; infinite if it cannot be fitted."""
    ends = [0, *joints, len(data.time)]
    pieces = {str(number): data.part(*span) for number, span in enumerate(pairwise(ends), 1)}
    return refitted_error(search, Dataset.joined(pieces), each)
