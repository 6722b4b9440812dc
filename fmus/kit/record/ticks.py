"""Sample instants of the clocks of a component, computed for a whole record at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
    instants, clocks, steps = [np.zeros(0)], [np.zeros(0, int)], [np.zeros(0, int)]
    slack = ROUNDING * float(np.abs(time).max())
    for clock, (shift, period) in enumerate(rhythms):
        own = slack + SAME_INSTANT * period
        count = (time[[0, -1]] - begin - shift - own) / period
        ticks = begin + shift + period * np.arange(max(0, np.ceil(count[0])), np.ceil(count[1]))
        step = np.searchsorted(time - own, ticks, side="right") - 1
        instants.append(np.where(ticks > time[step] + own, ticks, time[step]))
        clocks.append(np.full(len(ticks), clock))
        steps.append(step)
    at, clock_of, step_of = (np.concatenate(a) for a in (instants, clocks, steps))
    order = np.argsort(at, kind="stable")
    shortest = min((period for _, period in rhythms), default=0.0)
    apart = np.diff(at[order], prepend=-np.inf) > slack + SAME_INSTANT * shortest
    order = order[np.lexsort((clock_of[order], np.cumsum(apart)))]
    first = np.searchsorted(step_of[order], np.arange(len(time)))
    return Ticks(at[order], clock_of[order].astype(np.int32), first.astype(np.int32))
