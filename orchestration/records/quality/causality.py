"""Outputs that respond before the step of an input.

A response decays until the next step of its input, so that it is quietest just before it. A filter
that runs forwards and backwards spreads a step to both sides, and a clock that is ahead moves it.
"""

from __future__ import annotations

import numpy as np

from fmus.kit.arrays import Array, Indices
from orchestration.records.quality.fault import Channels, Fault

_STEP = 0.2  # of the range of an input, from which on a change within a sample is a step of it
_WIDEST = 25  # samples before a step that are looked at,
_NARROWEST = 5  # and the least of them
_BEFORE = 4  # of such windows that must be without a step, for one of them to be a quiet one
_FEWEST = 4  # steps to judge by
# Power of second differences over that in a quiet window, from which on something moves: of noise
# half of the steps have more than once, and hardly any four times.
_MOVES = 4.0


def ahead_of_inputs(channels: Channels) -> list[Fault]:
    """Return a fault of every output that changes before inputs step.

    Parameters
    ----------
    channels : Channels

    Returns
    -------
    list of Fault
        None where inputs do not step, or one step comes right after the other.
    """
    steps = _steps(channels)
    spaces = np.diff(steps, prepend=0)
    width = int(min(_WIDEST, np.median(spaces) // _BEFORE)) if len(steps) else 0
    alone = steps[spaces >= _BEFORE * width]
    if width < _NARROWEST or len(alone) < _FEWEST:
        return []
    return [
        Fault("moves_ahead", output)
        for output, y in channels.outputs.items()
        if np.isfinite(y).all() and np.median(_rise(y, alone, width)) > _MOVES
    ]


def _steps(channels: Channels) -> Indices:
    """Return the samples at which any input steps."""
    stepped = np.zeros(len(channels.time), dtype=bool)
    for u in channels.inputs.values():
        change = np.abs(np.diff(u, prepend=u[:1]))
        stepped |= change > _STEP * max(float(np.ptp(u)), np.finfo(float).tiny)
    return np.flatnonzero(stepped)


def _rise(y: Array, steps: Indices, width: int) -> Array:
    """Return by step the power of second differences before it, over the power of a quiet time.

    The power is that of the `width` samples before the step; the quiet time is as long, and begins
    ``3 * width`` samples before the step.
    """
    bends = np.zeros_like(y)
    bends[2:] = np.diff(y, 2) ** 2
    sums = np.concatenate([[0.0], np.cumsum(bends)])
    before = sums[steps] - sums[steps - width]
    long_before = sums[steps - 2 * width] - sums[steps - 3 * width]
    # of a signal without noise nothing is left but rounding
    rounding = np.finfo(float).eps * float(bends.max()) + np.finfo(float).tiny
    return before / np.maximum(long_before, rounding)
