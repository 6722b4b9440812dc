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

from orchestration.discrepancy.evidence import Data
from orchestration.records.channels import runs

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_ALARM = 1e-6  # probability, for a whole channel, of so long a run of equal samples in noise
_COLOURED = 1.5  # times as long as if noise forgot from sample to sample
_RUN = 5  # equal samples that are looked at
_CLOSED = 5  # samples between masked ones that are masked too: those that noise spared are no fair sample
_CALM = 30  # samples without movement of the inputs that it takes to know the noise
_COARSE = 0.4  # share of repeated samples above which the noise is too small for the steps of the recorder
_LEVELS = 4  # different values at which a channel with noise may stand still: both ends, and where a sensor hangs
_BESIDE = 3.5  # steps of the recorder that are beside an end
_DEAD = 0.05  # share of a record for which an output without noise must stand still to be dead
_SPIKE = 12.0  # standard deviations by which a single sample must leave its neighbours
_SPIKES = 0.02  # share of the samples above which they are no outliers
_USABLE = 0.1  # share of the samples below which an output is not used
_SAME = 1e-9  # of the range: what unit conversion may split one value into


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
    if n < 2 * _RUN:
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
    found = _standstill(y, grain, moved) if usual is None else _repeats(y, grain, usual)
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
    return np.asarray(change > _SAME * np.abs(values).max(initial=0.0))


def _resolution(y: Array) -> float:
    """Least step between different values."""
    spread = float(np.ptp(y))
    steps = np.diff(np.unique(y))
    steps = steps[steps > _SAME * spread]
    return float(steps.min()) if len(steps) else 0.0


def _on_grid(y: Array, grain: float) -> bool:
    steps = np.diff(np.unique(y)) / grain
    return bool(np.abs(steps - np.round(steps)).max(initial=0.0) < 0.01)


def _usual_repeats(y: Array, grain: float, moved: Mapping[str, Mask]) -> float | None:
    """Probability that noise repeats a sample, seen where no input moves; None if there is no noise to tell by.

    The third differences of noise alternate, those of a smooth signal do not.
    """
    calm, equal = ~_any(moved, len(y)), _equal(y)
    if len({float(y[a]) for a, b in equal if b - a >= 4 * _RUN}) > _LEVELS:
        return None
    for a, b in equal:
        calm[a:b] &= b - a < _RUN  # what is to be found, perhaps
    calm = calm[1:-2] & calm[2:-1] & calm[3:]
    third = np.diff(y, 3)[calm]
    signs = np.sign(third[third != 0.0])
    if len(signs) < _CALM or np.mean(signs[1:] != signs[:-1]) < 0.6 or np.median(np.abs(third)) < 2.0 * grain:
        return None
    usual = float(np.mean(np.diff(y)[2:][calm] == 0.0))
    return max(usual, 1.0 / len(y)) if usual < _COARSE else None


def _equal(y: Array) -> list[tuple[int, int]]:
    """Runs of equal samples: first, and the one after the last."""
    same = np.abs(np.diff(y)) <= _SAME * np.ptp(y)
    return [(a, b + 1) for a, b in runs(same)]


def _dead_throughout(y: Array, grain: float, moved: Mapping[str, Mask]) -> str:
    """Tell if an output says nothing at all while inputs move."""
    inputs = _any(moved, len(y))
    if not inputs.any():
        return ""
    if grain == 0.0:
        return f"constant at {y[0]:.6g} while inputs move: a dead sensor, or nothing drives it; it is not used"
    changes = np.flatnonzero(np.diff(y)) + 1
    near = inputs | np.roll(inputs, 1) | np.roll(inputs, -1)
    if np.ptp(y) < 2.5 * grain and len(changes) and not near.all() and near[changes].mean() < 0.5:
        return f"only toggles between neighbouring steps of {grain:.4g} whatever the inputs do: it is not used"
    return ""


def _repeats(y: Array, grain: float, usual: float) -> Iterator[tuple[str, Mask, str]]:
    """Values that noise could not have repeated."""
    n, equal = len(y), _equal(y)
    low, high, same = float(y.min()), float(y.max()), _SAME * float(np.ptp(y))
    longest = 1.0 + _COLOURED * np.log(_ALARM / n) / np.log(usual)
    frozen = [(a, b) for a, b in equal if b - a >= max(_RUN, longest)]
    tail = next(((a, b) for a, b in frozen if b == n and b - a >= _DEAD * n), None)
    if tail and y[-1] in (low, high) and any(abs(y[a] - y[-1]) <= same for a, _ in frozen[:-1]):
        tail = None  # one more of those at this end
    if tail:
        mask = np.zeros(n, dtype=bool)
        mask[tail[0] :] = True
        yield "dead", mask, f"stands still at {y[-1]:.6g} to the end: a dead sensor"
        frozen.remove(tail)
    for word, level in (("maximum", high), ("minimum", low)):
        aside = np.abs(y - level)
        at = aside <= same
        beside = int(((aside > same) & (aside < _BESIDE * grain)).sum())
        # at the end of what noise reaches there are fewer samples than beside it
        if at.sum() > _RUN + _BESIDE * beside and (not tail or abs(y[-1] - level) > same):
            yield "clipped", _closed(at), f"cut off at its {word} {level:.6g}"
            frozen = [(a, b) for a, b in frozen if not at[a]]
    stuck = np.zeros(n, dtype=bool)
    for a, b in frozen:
        stuck[a:b] = True
    if stuck.any():
        yield "stuck", stuck, f"stands still for up to {max(b - a for a, b in runs(stuck))} samples in a row"


def _standstill(y: Array, grain: float, moved: Mapping[str, Mask]) -> Iterator[tuple[str, Mask, str]]:
    """Cuts and standstills of an output that has no noise to tell them by."""
    n, equal = len(y), _equal(y)
    if not equal:
        return
    inputs = _any(moved, n)
    a, b = max(equal, key=lambda ends: ends[1] - ends[0])
    if b - a >= max(_DEAD * n, 4 * _RUN):
        others = [e - s for s, e in equal if s != a and inputs[s + 1 : e].any()]
        elsewhere = [m for m in moved.values() if m[:a].any() or m[b:].any()]
        if elsewhere and all(m[a + 1 : b].sum() > 1 for m in elsewhere) and b - a > 3 * max(others, default=0):
            mask = np.zeros(n, dtype=bool)
            mask[a:b] = True
            kind, until = ("dead", "to the end") if b == n else ("stuck", f"for {b - a} samples in a row")
            yield kind, mask, f"stands still at {y[a]:.6g} {until} while inputs move"
            equal.remove((a, b))
    low, high = (np.abs(y - level) <= _SAME * np.ptp(y) for level in (y.min(), y.max()))
    ends = low | high
    between = max((e - s for s, e in equal if not ends[s]), default=_RUN)
    varied = len(np.unique(y)) > 10 and ends.mean() < 0.5
    for word, at, sign in (("maximum", high, 1.0), ("minimum", low, -1.0)):
        level = float(y[at][0])
        there = [(s, e) for s, e in equal if e - s >= _RUN and at[s]]
        cut = [s for s, e in there if s >= 2 and sign * (2.0 * y[s - 1] - y[s - 2] - level) > grain
               and not any(m[s - 1 : s + 1].any() and not m[s + 2 : e].any() for m in moved.values())]  # fmt: skip
        long = sum(e - s > 1.5 * between for s, e in there) if varied else 0
        if (len(cut) >= 2 and 2 * len(cut) >= len(there)) or long >= 3:
            yield "clipped", _closed(at), f"cut off at its {word} {level:.6g}, {len(there)} times"


def _outliers(y: Array, grain: float, bad: Mask, moved: Mapping[str, Mask]) -> Mask:
    """Single samples far from both neighbours, which agree, where no input moves."""
    aside = y[1:-1] - 0.5 * (y[:-2] + y[2:])
    deviation = max(float(np.median(np.abs(aside[~bad[1:-1]]))) / float(norm.ppf(0.75)) if (~bad).any() else 0.0, grain)
    alone = (np.abs(aside) > _SPIKE * deviation) & (np.abs(y[2:] - y[:-2]) < 0.25 * np.abs(aside))
    quiet = ~_any(moved, len(y))
    near = quiet[:-2] & quiet[1:-1] & quiet[2:]
    result = np.zeros(len(y), dtype=bool)
    result[1:-1] = alone & near
    return result & ~bad


def _any(moved: Mapping[str, Mask], n: int) -> Mask:
    return np.any(list(moved.values()), axis=0) if moved else np.zeros(n, dtype=bool)


def _closed(mask: Mask) -> Mask:
    """Fill short holes of a mask."""
    result = mask.copy()
    for a, b in runs(~mask):
        if a > 0 and b < len(mask) and b - a <= _CLOSED:
            result[a:b] = True
    return result
