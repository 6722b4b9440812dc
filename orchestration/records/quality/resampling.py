"""Records that were interpolated linearly between measured samples, to a higher rate.

Interpolated samples count as evidence repeatedly, and turn the steps of an input into ramps, which
look like a delay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.quality.fault import Channels, Fault

_FINEST = 50  # samples on a line
_KNOTS = 20  # that it takes to know
_OFF = 1e-6  # of the squared second differences, which may lie beside knots: a file is rounded
_EVEN = 0.1  # scatter of their size over its mean, below which a signal is a triangle by itself


def as_measured(channels: Channels) -> tuple[Channels, list[Fault]]:
    """Return the measured samples of a record whose outputs are interpolated linearly between them.

    Parameters
    ----------
    channels : Channels

    Returns
    -------
    Channels
        All samples where an output has gaps, or is no line between them.
    list of Fault
        On samples that were left out.
    """
    if not _is_complete(channels):
        return channels, []
    for times in range(_FINEST, 1, -1):
        firsts = {_first_knot(y, times) for y in channels.outputs.values()}
        if len(firsts) == 1 and None not in firsts:
            kept = _every(channels, slice(firsts.pop(), None, times))
            return kept, [Fault("resampled", "", {"times": times, "samples": len(kept.time)})]
    return channels, []


def _is_complete(channels: Channels) -> bool:
    outputs = channels.outputs.values()
    return bool(outputs) and all(np.isfinite(y).all() for y in outputs)


def _first_knot(y: Array, times: int) -> int | None:
    """Return the index of the first knot of a signal with a knot every `times` samples, or None."""
    bends = np.abs(np.diff(y, 2))
    if len(bends) < _KNOTS * times:
        return None
    scale = max(float(bends.max()), np.finfo(float).tiny)
    power = np.bincount(np.arange(len(bends)) % times, (bends / scale) ** 2)
    place = int(np.argmax(power))
    at_knots = bends[place::times]
    beside = power.sum() - power[place]
    if beside > _OFF * power[place] or np.std(at_knots) <= _EVEN * np.mean(at_knots):
        return None
    if np.median(at_knots) <= np.sqrt(_OFF) * scale:  # straight but for a few bends
        return None
    return (place + 1) % times


def _every(channels: Channels, kept: slice) -> Channels:
    return replace(
        channels,
        time=channels.time[kept],
        inputs={name: values[kept] for name, values in channels.inputs.items()},
        outputs={name: values[kept] for name, values in channels.outputs.items()},
    )
