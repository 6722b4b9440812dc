"""Records that have more samples than what was measured needs.

What was resampled by straight lines between samples was not measured there: it counts as evidence
many times over, and makes an input that was held go smoothly, which looks like a delay. What was
filtered, forwards and backwards or otherwise, has nothing beyond some frequency, no noise either:
by the sampling theorem a few samples of every period there tell all of it (Åström & Wittenmark,
section 7.2), and the others are no evidence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.records.quality.fault import Channels, Fault

_FINEST = 50  # samples on a line
_KNOTS = 20  # that it takes to know
_OFF = 1e-6  # of the squared second differences, which may lie beside knots: a file is rounded
_EMPTY = 1e-10  # of the power of a column, which may lie beyond what it has: a file is rounded
_A_PERIOD = 8  # samples of the shortest period that are kept, as inputs are lines between them
_FEWEST = 200  # samples that are kept at least
_EVEN = 0.1  # scatter of their size over its mean, below which a signal is a triangle by itself


def as_measured(channels: Channels) -> tuple[Channels, list[Fault]]:
    """Return the samples between which all outputs are lines: those that were measured.

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


def without_oversampling(channels: Channels) -> tuple[Channels, list[Fault]]:
    """Return as many samples as tell all that is in the columns.

    Parameters
    ----------
    channels : Channels

    Returns
    -------
    Channels
        All samples where an output has gaps, or any column something as fast as its samples.
        Inputs that are held have their means over the samples that were left out.
    list of Fault
        On these.
    """
    times = _oversampling(channels) if _is_complete(channels) else 1
    if times == 1:
        return channels, []
    kept = _every(channels, slice(0, None, times))
    held = {n: _means(u, times) for n, u in channels.inputs.items() if n not in channels.smooth}
    fault = Fault("oversampled", "", {"times": times, "samples": len(kept.time)})
    return replace(kept, inputs={**kept.inputs, **held}), [fault]


def _is_complete(channels: Channels) -> bool:
    outputs = channels.outputs.values()
    return bool(outputs) and all(np.isfinite(y).all() for y in outputs)


def _means(held: Array, times: int) -> Array:
    """Return the means of so many samples of an input that is held, which do what they do."""
    firsts = np.arange(0, len(held), times)
    counts = np.diff(np.append(firsts, len(held)))
    return np.asarray(np.add.reduceat(held, firsts) / counts)


def _oversampling(channels: Channels) -> int:
    """Return how many times as many samples a record has as its columns need; 1 if all count."""
    count = len(channels.time)
    moving = [u for u in channels.inputs.values() if np.ptp(u) > 0.0]
    if not channels.is_even or count < 2 * _FEWEST:
        return 1
    highest = max(_highest_frequency(column) for column in (*moving, *channels.outputs.values()))
    return max(1, min(int(1.0 / (_A_PERIOD * highest)), count // _FEWEST))


def _highest_frequency(column: Array) -> float:
    """Return the frequency beyond which a column has nothing, in periods a sample."""
    line = np.linspace(column[0], column[-1], len(column))
    power = np.abs(np.fft.rfft((column - line) * np.hanning(len(column)))) ** 2
    beyond = np.cumsum(power[::-1])[::-1]
    within = np.flatnonzero(beyond > _EMPTY * beyond[0])
    return float((within[-1] + 1) / len(column)) if len(within) else 1.0


def _first_knot(y: Array, times: int) -> int | None:
    """Return the first of the knots of a signal that is lines of so many samples, or None."""
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
