"""Whether the data can be trusted, before any model is blamed: clipped, stuck and dead outputs, still inputs, outliers.

No simulation is needed. A measurement with noise never repeats a value for long, so that a run of equal samples is made
by what records it: at an end of the range it is clipped, elsewhere the sensor is stuck. Without noise to tell, rest is
no fault; then only a signal that is cut while it moves counts as clipped, and one that stops while inputs move as dead.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.faults import (
    RUN,
    Symptom,
    any_moved,
    equal_runs,
    faults_in_noise,
    faults_without_noise,
)
from orchestration.discrepancy.data.resolution import SAME, resolution_of
from orchestration.discrepancy.note import Note, NoteCode

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_CALM = 30  # samples without movement of the inputs that it takes to know the noise
_COARSE = 0.4  # share of repeated samples above which the noise is too small for the steps of the recorder
_LEVELS = 4  # different values at which a channel with noise may stand still: both ends, and where a sensor hangs
_SPIKE = 12.0  # standard deviations by which a single sample must leave its neighbours
_SPIKES = 0.02  # share of the samples above which they are no outliers
_EVIDENCE = ("quantised", "standing")  # told, and used all the same
_USABLE = 0.1  # share of the samples below which an output is not used


@dataclass(frozen=True)
class DataFault:
    """One thing that is wrong with the data.

    Attributes
    ----------
    channel : str
        Empty if it is about all of them.
    kind : {"clipped", "stuck", "dead", "standing", "outlier", "quantised", "unusable", "still", "nothing"}
    code : NoteCode
        How it was recognised.
    facts : Mapping of str to Any
        Figures that its sentence needs.
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
    code: NoteCode
    facts: Mapping[str, Any]
    first: int
    last: int
    start: float
    end: float
    share: float
    left_out: bool

    @property
    def note(self) -> Note:
        """It as a remark of the diagnosis."""
        return Note(self.code, self.channel, {**self.facts, "share": self.share})


def assess(
    data: Dataset, simulated: Mapping[str, Array] | None = None
) -> tuple[Dataset, list[DataFault]]:
    """Look for what is wrong with the data.

    Parameters
    ----------
    data : Dataset
    simulated : Mapping of str to ndarray, shape (n,), optional
        Outputs as a model shows them under the same inputs. What they do themselves, such as resting at a limit or not
        moving at all, is no fault of the data.

    Returns
    -------
    Dataset
        With NaN where an output cannot be trusted, and without outputs that say nothing.
    list of DataFault
        In the order of the channels, inputs first.
    """
    faults = list(_excitation(data))
    moves = {name: _changes(values) for name, values in data.inputs.items()}
    usable, modelled = {}, simulated or {}
    for name, values in data.measured.items():
        bad = np.zeros(len(values), dtype=bool)
        own = (
            {symptom.kind for symptom in _symptoms(modelled[name], moves)}
            if name in modelled
            else set()
        )
        for symptom in _symptoms(values, moves):
            if symptom.kind in own:
                continue
            left_out = symptom.kind not in _EVIDENCE
            faults.append(_fault(data, name, symptom, values, left_out))
            bad |= symptom.mask if left_out else False
        present = np.isfinite(values)
        share = float((present & ~bad).sum() / max(present.sum(), 1))
        if share >= _USABLE:
            usable[name] = np.where(bad, np.nan, values)
        elif share > 0.0:
            symptom = Symptom("unusable", NoteCode.UNUSABLE, present, {"usable": share})
            faults.append(_fault(data, name, symptom, values, True))
    if not usable:
        everything = np.ones(len(data.time), dtype=bool)
        faults.append(
            _fault(
                data, "", Symptom("nothing", NoteCode.NOTHING_USABLE, everything), data.time, False
            )
        )
    return replace(data, measured=usable), faults


def _fault(
    data: Dataset, channel: str, symptom: Symptom, values: Array, left_out: bool
) -> DataFault:
    where = np.flatnonzero(symptom.mask)
    first, last = int(where[0]), int(where[-1])
    start, end = float(data.time[first]), float(data.time[last])
    share = float(symptom.mask.sum() / max(np.isfinite(values).sum(), 1))
    return DataFault(
        channel, symptom.kind, symptom.code, symptom.facts, first, last, start, end, share, left_out
    )


def _excitation(data: Dataset) -> Iterator[DataFault]:
    """Inputs that do not move, and what that means."""
    everything = np.ones(len(data.time), dtype=bool)
    still = {name: values for name, values in data.inputs.items() if not _changes(values).any()}
    for name, values in still.items():
        constant = Symptom(
            "still", NoteCode.CONSTANT_INPUT, everything, {"value": float(values[0])}
        )
        yield _fault(data, name, constant, values, False)
    if len(still) == len(data.inputs):
        yield _fault(
            data, "", Symptom("still", NoteCode.NO_EXCITATION, everything), data.time, False
        )


def _symptoms(values: Array, moves: Mapping[str, Mask]) -> Iterator[Symptom]:
    """What is wrong with one output."""
    where = np.flatnonzero(np.isfinite(values))
    y = values[where]
    n = len(y)
    if n < 2 * RUN:
        return
    moved = {name: mask[where] for name, mask in moves.items()}

    def whole(symptom: Symptom) -> Symptom:
        result = np.zeros(len(values), dtype=bool)
        result[where[symptom.mask]] = True
        return replace(symptom, mask=result)

    resolution = resolution_of(y)
    dead = _dead_throughout(y, resolution, moved)
    if dead:
        yield whole(dead)
        return
    ties = _tie_probability(y, resolution, moved)
    symptoms = (
        faults_without_noise(y, resolution, moved)
        if ties is None
        else faults_in_noise(y, resolution, ties)
    )
    bad = np.zeros(n, dtype=bool)
    for symptom in symptoms:
        bad |= symptom.mask
        yield whole(symptom)
    coarse = ties is None and 4 * len(np.unique(y)) <= n and _on_grid(y, resolution)
    spikes = _outliers(y, resolution, bad, moved)
    if (coarse or ties is not None) and 0 < spikes.sum() <= max(1, _SPIKES * n):
        yield whole(Symptom("outlier", NoteCode.OUTLIERS, spikes, {"count": int(spikes.sum())}))
    if coarse:
        everything = np.ones(n, dtype=bool)
        yield whole(
            Symptom("quantised", NoteCode.QUANTISED, everything, {"resolution": resolution})
        )


def _changes(values: Array) -> Mask:
    """Where a channel has another value than one sample before."""
    change = np.abs(np.diff(values, prepend=values[:1]))
    return np.asarray(change > SAME * np.abs(values).max(initial=0.0))


def _on_grid(y: Array, resolution: float) -> bool:
    steps = np.diff(np.unique(y)) / resolution
    return bool(np.abs(steps - np.round(steps)).max(initial=0.0) < 0.01)


def _tie_probability(y: Array, resolution: float, moved: Mapping[str, Mask]) -> float | None:
    """Probability that noise repeats a sample, seen where no input moves; None if there is no noise to tell by.

    The third differences of noise alternate, those of a smooth signal do not.
    """
    calm, equal = ~any_moved(moved, len(y)), equal_runs(y)
    if len({float(y[a]) for a, b in equal if b - a >= 4 * RUN}) > _LEVELS:
        return None
    for a, b in equal:
        calm[a:b] &= b - a < RUN  # may be the very fault that is looked for
    calm = calm[1:-2] & calm[2:-1] & calm[3:]
    third = np.diff(y, 3)[calm]
    signs = np.sign(third[third != 0.0])
    if (
        len(signs) < _CALM
        or np.mean(signs[1:] != signs[:-1]) < 0.6
        or np.median(np.abs(third)) < 2.0 * resolution
    ):
        return None
    ties = float(np.mean(np.diff(y)[2:][calm] == 0.0))
    return max(ties, 1.0 / len(y)) if ties < _COARSE else None


def _dead_throughout(y: Array, resolution: float, moved: Mapping[str, Mask]) -> Symptom | None:
    """Tell if an output says nothing at all while inputs move."""
    inputs = any_moved(moved, len(y))
    if not inputs.any():
        return None
    everything = np.ones(len(y), dtype=bool)
    if resolution == 0.0:
        return Symptom("dead", NoteCode.DEAD_CONSTANT, everything, {"level": float(y[0])})
    changes = np.flatnonzero(np.diff(y)) + 1
    near = inputs | np.roll(inputs, 1) | np.roll(inputs, -1)
    if (
        np.ptp(y) < 2.5 * resolution
        and len(changes)
        and not near.all()
        and near[changes].mean() < 0.5
    ):
        return Symptom("dead", NoteCode.DEAD_TOGGLING, everything, {"resolution": resolution})
    return None


def _outliers(y: Array, resolution: float, bad: Mask, moved: Mapping[str, Mask]) -> Mask:
    """Single samples far from both neighbours, which agree, where no input moves."""
    aside = y[1:-1] - 0.5 * (y[:-2] + y[2:])
    deviation = max(
        float(np.median(np.abs(aside[~bad[1:-1]]))) / float(norm.ppf(0.75))
        if (~bad).any()
        else 0.0,
        resolution,
    )
    alone = (np.abs(aside) > _SPIKE * deviation) & (np.abs(y[2:] - y[:-2]) < 0.25 * np.abs(aside))
    quiet = ~any_moved(moved, len(y))
    near = quiet[:-2] & quiet[1:-1] & quiet[2:]
    result = np.zeros(len(y), dtype=bool)
    result[1:-1] = alone & near
    return result & ~bad
