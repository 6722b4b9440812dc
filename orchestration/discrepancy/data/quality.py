"""Whether the data can be trusted, before any model is blamed: clipped, stuck and dead outputs, still inputs, outliers.

No simulation is needed. A measurement with noise never repeats a value for long, so that a run of equal samples is made
by what records it: at an end of the range it is clipped, elsewhere the sensor is stuck. Without noise to tell, rest is
no fault; then only a signal that is cut while it moves counts as clipped, and one that stops while inputs move as dead.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from orchestration.discrepancy.data.faults import RUN, SAME, any_moved, equal_runs, repeats, standstill
from orchestration.discrepancy.selection.search import Data

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_CALM = 30  # samples without movement of the inputs that it takes to know the noise
_COARSE = 0.4  # share of repeated samples above which the noise is too small for the steps of the recorder
_LEVELS = 4  # different values at which a channel with noise may stand still: both ends, and where a sensor hangs
_SPIKE = 12.0  # standard deviations by which a single sample must leave its neighbours
_SPIKES = 0.02  # share of the samples above which they are no outliers
_USABLE = 0.1  # share of the samples below which an output is not used


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with the data.

    Attributes
    ----------
    channel : str
        Empty if it is about all of them.
    kind : {"clipped", "stuck", "dead", "outlier", "quantised", "unusable", "still", "nothing"}
    message : str
        One line.
    first, last : int
        Samples between which it was seen, both of them included.
    start, end : float
        Their times, s.
    share : float
        Of the samples of the channel.
    left_out : bool
        Whether these samples are not used.
    """

    channel: str
    kind: str
    message: str
    first: int
    last: int
    start: float
    end: float
    share: float
    left_out: bool


def judge(data: Data, simulated: Mapping[str, Array] | None = None) -> tuple[Data, list[Finding]]:
    """Look for what is wrong with the data.

    Parameters
    ----------
    data : Data
    simulated : Mapping of str to ndarray, shape (n,), optional
        Outputs as a model shows them under the same inputs. What they do themselves, such as resting at a limit or not
        moving at all, is no fault of the data.

    Returns
    -------
    Data
        With NaN where an output cannot be trusted, and without outputs that say nothing.
    list of Finding
        What was found, in the order of the channels, inputs first.
    """
    findings = list(_excitation(data))
    moves = {name: _changes(values) for name, values in data.inputs.items()}
    kept, shown = {}, simulated or {}
    for name, values in data.measured.items():
        bad = np.zeros(len(values), dtype=bool)
        own = {kind for kind, *_ in _faults(shown[name], moves)} if name in shown else set()
        for kind, mask, text in _faults(values, moves):
            if kind in own:
                continue
            findings.append(_finding(data, name, kind, text, mask, values, kind != "quantised"))
            bad |= mask if kind != "quantised" else False
        present = np.isfinite(values)
        share = float((present & ~bad).sum() / max(present.sum(), 1))
        if share >= _USABLE:
            kept[name] = np.where(bad, np.nan, values)
        elif share > 0.0:
            text = f"{100.0 * share:.2g} % of its samples are left: it is not used at all"
            findings.append(_finding(data, name, "unusable", text, present, values, True))
    if not kept:
        everything = np.ones(len(data.time), dtype=bool)
        text = "no output is left that could be trusted: nothing can be judged"
        findings.append(_finding(data, "", "nothing", text, everything, data.time, False))
    return replace(data, measured=kept), findings


def _finding(data: Data, channel: str, kind: str, text: str, mask: Mask, values: Array, left_out: bool) -> Finding:
    where = np.flatnonzero(mask)
    first, last = int(where[0]), int(where[-1])
    start, end = float(data.time[first]), float(data.time[last])
    share = float(mask.sum() / max(np.isfinite(values).sum(), 1))
    return Finding(channel, kind, f"{channel}: {text}" if channel else text, first, last, start, end, share, left_out)


def _excitation(data: Data) -> Iterator[Finding]:
    """Inputs that do not move, and what that means."""
    everything = np.ones(len(data.time), dtype=bool)
    still = {name: values for name, values in data.inputs.items() if not _changes(values).any()}
    for name, values in still.items():
        text = (
            f"constant at {values[0]:.6g} throughout: what only answers to its changes cannot be judged, and effects "
            "that need them cannot be told apart"
        )
        yield _finding(data, name, "still", text, everything, values, False)
    if len(still) == len(data.inputs):
        text = "no input moves: neither a cause nor a parameter can be judged, only how the record settles"
        yield _finding(data, "", "still", text, everything, data.time, False)


def _faults(values: Array, moves: Mapping[str, Mask]) -> Iterator[tuple[str, Mask, str]]:
    """What is wrong with one output: kind, samples, text."""
    where = np.flatnonzero(np.isfinite(values))
    y = values[where]
    n = len(y)
    if n < 2 * RUN:
        return
    moved = {name: mask[where] for name, mask in moves.items()}

    def whole(mask: Mask) -> Mask:
        result = np.zeros(len(values), dtype=bool)
        result[where[mask]] = True
        return result

    grain = _resolution(y)
    dead = _dead_throughout(y, grain, moved)
    if dead:
        yield "dead", whole(np.ones(n, dtype=bool)), dead
        return
    usual = _usual_repeats(y, grain, moved)
    found = standstill(y, grain, moved) if usual is None else repeats(y, grain, usual)
    bad = np.zeros(n, dtype=bool)
    for kind, mask, text in found:
        bad |= mask
        yield kind, whole(mask), f"{text}, {100.0 * mask.mean():.2g} % of the samples"
    coarse = usual is None and 4 * len(np.unique(y)) <= n and _on_grid(y, grain)
    spikes = _outliers(y, grain, bad, moved)
    if (coarse or usual is not None) and 0 < spikes.sum() <= max(1, _SPIKES * n):
        yield "outlier", whole(spikes), f"{spikes.sum()} single samples far from their neighbours"
    if coarse:
        text = f"steps of {grain:.4g}, coarser than its noise: nothing finer can be judged"
        yield "quantised", whole(np.ones(n, dtype=bool)), text


def _changes(values: Array) -> Mask:
    """Where a channel has another value than one sample before."""
    change = np.abs(np.diff(values, prepend=values[:1]))
    return np.asarray(change > SAME * np.abs(values).max(initial=0.0))


def _resolution(y: Array) -> float:
    """Least step between different values."""
    spread = float(np.ptp(y))
    steps = np.diff(np.unique(y))
    steps = steps[steps > SAME * spread]
    return float(steps.min()) if len(steps) else 0.0


def _on_grid(y: Array, grain: float) -> bool:
    steps = np.diff(np.unique(y)) / grain
    return bool(np.abs(steps - np.round(steps)).max(initial=0.0) < 0.01)


def _usual_repeats(y: Array, grain: float, moved: Mapping[str, Mask]) -> float | None:
    """Probability that noise repeats a sample, seen where no input moves; None if there is no noise to tell by.

    The third differences of noise alternate, those of a smooth signal do not.
    """
    calm, equal = ~any_moved(moved, len(y)), equal_runs(y)
    if len({float(y[a]) for a, b in equal if b - a >= 4 * RUN}) > _LEVELS:
        return None
    for a, b in equal:
        calm[a:b] &= b - a < RUN  # what is to be found, perhaps
    calm = calm[1:-2] & calm[2:-1] & calm[3:]
    third = np.diff(y, 3)[calm]
    signs = np.sign(third[third != 0.0])
    if len(signs) < _CALM or np.mean(signs[1:] != signs[:-1]) < 0.6 or np.median(np.abs(third)) < 2.0 * grain:
        return None
    usual = float(np.mean(np.diff(y)[2:][calm] == 0.0))
    return max(usual, 1.0 / len(y)) if usual < _COARSE else None


def _dead_throughout(y: Array, grain: float, moved: Mapping[str, Mask]) -> str:
    """Tell if an output says nothing at all while inputs move."""
    inputs = any_moved(moved, len(y))
    if not inputs.any():
        return ""
    if grain == 0.0:
        return f"constant at {y[0]:.6g} while inputs move: a dead sensor, or nothing drives it; it is not used"
    changes = np.flatnonzero(np.diff(y)) + 1
    near = inputs | np.roll(inputs, 1) | np.roll(inputs, -1)
    if np.ptp(y) < 2.5 * grain and len(changes) and not near.all() and near[changes].mean() < 0.5:
        return f"only toggles between neighbouring steps of {grain:.4g} whatever the inputs do: it is not used"
    return ""


def _outliers(y: Array, grain: float, bad: Mask, moved: Mapping[str, Mask]) -> Mask:
    """Single samples far from both neighbours, which agree, where no input moves."""
    aside = y[1:-1] - 0.5 * (y[:-2] + y[2:])
    deviation = max(float(np.median(np.abs(aside[~bad[1:-1]]))) / float(norm.ppf(0.75)) if (~bad).any() else 0.0, grain)
    alone = (np.abs(aside) > _SPIKE * deviation) & (np.abs(y[2:] - y[:-2]) < 0.25 * np.abs(aside))
    quiet = ~any_moved(moved, len(y))
    near = quiet[:-2] & quiet[1:-1] & quiet[2:]
    result = np.zeros(len(y), dtype=bool)
    result[1:-1] = alone & near
    return result & ~bad
