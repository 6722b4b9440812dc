"""Samples that repeat: clipped, stuck and dead, told by noise that would not repeat them or by inputs that move."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.data.resolution import SAME
from orchestration.discrepancy.note import NoteCode
from orchestration.records.channels import runs

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_ALARM = 1e-6  # probability, for a whole channel, of so long a run of equal samples in noise
_COLOURED = 1.5  # times as long as if noise forgot from sample to sample
RUN = 5  # equal samples that are looked at
_CLOSED = (
    5  # samples between masked ones that are masked too: those that noise spared are no fair sample
)
_BESIDE = 3.5  # steps of the recorder that are beside an end
_JUMP = 2.0  # times the largest change from sample to sample elsewhere: so a sensor comes back
_SLOW = 0.3  # of the usual change from sample to sample, below which something comes to rest
_DEAD = 0.05  # share of a record for which an output without noise must stand still to be dead


@dataclass(frozen=True)
class Symptom:
    """A fault of one output as its samples show it.

    Attributes
    ----------
    kind : {"clipped", "stuck", "dead", "standing", "outlier", "quantised", "unusable", "still", "nothing"}
    code : NoteCode
    mask : ndarray of bool, shape (n,)
        The samples.
    facts : Mapping of str to Any
        Figures that its sentence needs.
    """

    kind: str
    code: NoteCode
    mask: Mask
    facts: Mapping[str, Any] = field(default_factory=dict)


def faults_in_noise(y: Array, resolution: float, tie_probability: float) -> Iterator[Symptom]:
    """Find values that noise could not have repeated.

    Parameters
    ----------
    y : ndarray, shape (n,)
        An output, any unit, without holes.
    resolution : float
        Least step between different values, in its unit.
    tie_probability : float
        Probability that its noise repeats a sample.

    Yields
    ------
    Symptom
    """
    n, equal = len(y), equal_runs(y)
    low, high, same = float(y.min()), float(y.max()), SAME * float(np.ptp(y))
    longest = 1.0 + _COLOURED * np.log(_ALARM / n) / np.log(tie_probability)
    frozen = [(a, b) for a, b in equal if b - a >= max(RUN, longest)]
    tail = next(((a, b) for a, b in frozen if b == n and b - a >= _DEAD * n), None)
    if tail and any(abs(y[a] - y[-1]) <= same for a, _ in frozen[:-1]):
        tail = None  # one more of those at this level
    if tail:
        mask = np.zeros(n, dtype=bool)
        mask[tail[0] :] = True
        yield Symptom("dead", NoteCode.DEAD_TO_THE_END, mask, {"level": float(y[-1])})
        frozen.remove(tail)
    for end, level in (("maximum", high), ("minimum", low)):
        aside = np.abs(y - level)
        at = aside <= same
        beside = int(((aside > same) & (aside < _BESIDE * resolution)).sum())
        # at the end of what noise reaches there are fewer samples than beside it
        if at.sum() > RUN + _BESIDE * beside and (not tail or abs(y[-1] - level) > same):
            yield Symptom("clipped", NoteCode.CLIPPED, _closed(at), {"end": end, "level": level})
            frozen = [(a, b) for a, b in frozen if not at[a]]
    stuck, still = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    for a, b in frozen:
        # a plant stands where it has stood before; a sensor hangs anywhere
        again = any(abs(y[other] - y[a]) <= same for other, _ in frozen if other != a)
        (still if again else stuck)[a:b] = True
    if stuck.any():
        yield Symptom(
            "stuck", NoteCode.STUCK, stuck, {"samples": max(b - a for a, b in runs(stuck))}
        )
    if still.any():
        a, b = max(runs(still), key=lambda ends: ends[1] - ends[0])
        yield Symptom(
            "standing", NoteCode.STANDS_STILL, still, {"level": float(y[a]), "samples": b - a}
        )


def faults_without_noise(
    y: Array, resolution: float, moved: Mapping[str, Mask]
) -> Iterator[Symptom]:
    """Find cuts and standstills of an output that has no noise to tell them by.

    Parameters
    ----------
    y : ndarray, shape (n,)
        An output, any unit, without holes.
    resolution : float
        Least step between different values, in its unit.
    moved : Mapping of str to ndarray of bool, shape (n,)
        Where each input has changed.

    Yields
    ------
    Symptom
    """
    n, equal = len(y), equal_runs(y)
    if not equal:
        return
    inputs = any_moved(moved, n)
    a, b = max(equal, key=lambda ends: ends[1] - ends[0])
    if b - a >= max(_DEAD * n, 4 * RUN):
        others = [e - s for s, e in equal if s != a and inputs[s + 1 : e].any()]
        elsewhere = [m for m in moved.values() if m[:a].any() or m[b:].any()]
        if (
            elsewhere
            and all(m[a + 1 : b].sum() > 1 for m in elsewhere)
            and b - a > 3 * max(others, default=0)
        ):
            mask = np.zeros(n, dtype=bool)
            mask[a:b] = True
            facts = {"level": float(y[a]), "samples": b - a}
            if (a, b) in resting(y, equal):
                yield Symptom("standing", NoteCode.STANDS_STILL, mask, facts)
            elif b == n:
                yield Symptom("dead", NoteCode.DEAD_WHILE_DRIVEN, mask, facts)
            else:
                yield Symptom("stuck", NoteCode.STUCK_WHILE_DRIVEN, mask, facts)
            equal.remove((a, b))
    low, high = (np.abs(y - level) <= SAME * np.ptp(y) for level in (y.min(), y.max()))
    ends = low | high
    between = max((e - s for s, e in equal if not ends[s]), default=RUN)
    varied = len(np.unique(y)) > 10 and ends.mean() < 0.5
    for end, at, sign in (("maximum", high, 1.0), ("minimum", low, -1.0)):
        level = float(y[at][0])
        there = [(s, e) for s, e in equal if e - s >= RUN and at[s]]
        cut = [
            s
            for s, e in there
            if s >= 2
            and sign * (2.0 * y[s - 1] - y[s - 2] - level) > resolution
            and not any(m[s - 1 : s + 1].any() and not m[s + 2 : e].any() for m in moved.values())
        ]
        long = sum(e - s > 1.5 * between for s, e in there) if varied else 0
        if (len(cut) >= 2 and 2 * len(cut) >= len(there)) or long >= 3:
            cuts = {"end": end, "level": level, "times": len(there)}
            yield Symptom("clipped", NoteCode.CLIPPED_REPEATEDLY, _closed(at), cuts)


def resting(y: Array, equal: Sequence[tuple[int, int]]) -> set[tuple[int, int]]:
    """Runs of equal samples at which a plant may stand: in a dead zone, held by dry friction, at a stop.

    A plant comes to rest where it has been at rest before, at an end of its way, or more and more slowly; and it goes
    on from there. A sensor that hangs or dies stops anywhere, and when it is back, it jumps to where the plant is.

    Parameters
    ----------
    y : ndarray, shape (n,)
        An output, any unit, without holes.
    equal : sequence of tuple of int
        Its runs of equal samples, as :func:`equal_runs` has them.

    Returns
    -------
    set of tuple of int
        Those of them.
    """
    change, same = np.abs(np.diff(y)), SAME * float(np.ptp(y))
    long = [(a, b) for a, b in equal if b - a >= RUN]
    edges = np.zeros(change.size, dtype=bool)
    edges[[k for a, b in long for k in (a - 1, b - 1) if 0 <= k < change.size]] = True
    usual = change[~edges & (change > same)]
    most, typical = (float(usual.max()), float(np.median(usual))) if usual.size else (0.0, 0.0)
    found = set()
    for a, b in long:
        jumps = [float(change[k]) for k in (a - 1, b - 1) if 0 <= k < change.size]
        if usual.size and max(jumps, default=0.0) > _JUMP * most:
            continue
        again = a == 0 or any(abs(y[s] - y[a]) <= same for s, _ in long if s != a)
        end = min(y[a] - y.min(), y.max() - y[a]) <= same
        slowly = a > 0 and float(change[max(a - RUN, 0) : a].mean()) < _SLOW * typical
        if again or end or slowly:
            found.add((a, b))
    return found


def equal_runs(y: Array) -> list[tuple[int, int]]:
    """Runs of equal samples of a signal (n,): first, and the one after the last."""
    same = np.abs(np.diff(y)) <= SAME * np.ptp(y)
    return [(a, b + 1) for a, b in runs(same)]


def any_moved(moved: Mapping[str, Mask], n: int) -> Mask:
    """Samples at which any input moves, of n."""
    return np.any(list(moved.values()), axis=0) if moved else np.zeros(n, dtype=bool)


def _closed(mask: Mask) -> Mask:
    """Fill short holes of a mask."""
    result = mask.copy()
    for a, b in runs(~mask):
        if a > 0 and b < len(mask) and b - a <= _CLOSED:
            result[a:b] = True
    return result
