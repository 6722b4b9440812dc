"""Sample instants of the clocks of a component, computed for a whole record at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.integrate import ROUNDING, SAME_INSTANT

Rhythm = tuple[float, float]  # of a clock: shift of its first sample, and period, s


@dataclass(frozen=True, eq=False)
class Ticks:
    """Sample instants of the clocks of a component during a record of n samples, in their order.

    Attributes
    ----------
    time : ndarray, shape (m,)
    clock : ndarray of int, shape (m,)
    first : ndarray of int, shape (n,)
        The first tick of each step between two samples, and the number of all.
    """

    time: Array
    clock: Array
    first: Array


def ticks_of(time: Array, begin: float, rhythms: Sequence[Rhythm]) -> Ticks:
    """Return the sample instants of clocks within a record, as an integrator takes them.

    That at a sample belongs to the step after it. Clocks that tick at the same instant do so in
    their order; instants are the same within rounding.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Of the samples.
    begin : float
        Instant from which the clocks count.
    rhythms : sequence of Rhythm
        Of each clock.
    """
    slack = ROUNDING * float(np.abs(time).max())
    each = [_instants(time, begin + shift, period, slack) for shift, period in rhythms]
    at = np.concatenate([np.zeros(0), *(instants for instants, _ in each)])
    steps = np.concatenate([np.zeros(0, int), *(step for _, step in each)])
    counts = np.array([len(step) for _, step in each], dtype=int)
    clocks = np.repeat(np.arange(len(each)), counts)
    by_time = np.argsort(at, kind="stable")
    shortest = min((period for _, period in rhythms), default=0.0)
    is_later = np.diff(at[by_time], prepend=-np.inf) > slack + SAME_INSTANT * shortest
    # ticks that are one instant within rounding, in the order of the clocks
    order = by_time[np.lexsort((clocks[by_time], np.cumsum(is_later)))]
    first = np.searchsorted(steps[order], np.arange(len(time)))
    return Ticks(at[order], clocks[order].astype(np.int32), first.astype(np.int32))


def _instants(time: Array, start: float, period: float, slack: float) -> tuple[Array, Any]:
    """Return the instants of a clock within a record, s, and the step to which each belongs."""
    same = slack + SAME_INSTANT * period  # largest difference by rounding, s
    first, end = np.ceil((time[[0, -1]] - start - same) / period)
    ticks = start + period * np.arange(max(0, first), end)
    step = np.searchsorted(time - same, ticks, side="right") - 1
    return np.where(ticks > time[step] + same, ticks, time[step]), step
