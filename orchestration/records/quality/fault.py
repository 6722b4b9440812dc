"""Faults of a record with their sentences, and the channels that are assessed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from fmus.kit.arrays import Array, Signals
from orchestration.records.sampling import evenly_sampled
from orchestration.reporting import format_percent


class _Description(NamedTuple):
    """The kind of a fault, and its sentence with places for facts."""

    kind: str
    sentence: str


FAULTS = {
    "clipped": _Description("clipped", "cut off at its {end} {level:.6g}, {share} of the samples"),
    "clipped_repeatedly": _Description(
        "clipped", "cut off at its {end} {level:.6g}, {times} times, {share} of the samples"
    ),
    "stuck": _Description(
        "stuck",
        "stands still for up to {samples} samples in a row, {share} of the samples",
    ),
    "stuck_while_driven": _Description(
        "stuck",
        "stands still at {level:.6g} for {samples} samples in a row while inputs move, {share} of"
        " the samples",
    ),
    "dead_constant": _Description(
        "dead",
        "constant at {level:.6g} while inputs move: a dead sensor, or nothing drives it; it is not"
        " used",
    ),
    "dead_toggling": _Description(
        "dead",
        "only toggles between neighbouring steps of {resolution:.4g} whatever the inputs do: it is"
        " not used",
    ),
    "dead_to_the_end": _Description(
        "dead",
        "stands still at {level:.6g} to the end: a dead sensor, {share} of the samples",
    ),
    "dead_while_driven": _Description(
        "dead",
        "stands still at {level:.6g} to the end while inputs move, {share} of the samples",
    ),
    "stands_still": _Description(
        "standing",
        "stands still at {level:.6g} for up to {samples} samples in a row while inputs move,"
        " {share} of the samples: kept, as what a dead zone, dry friction or a stop does",
    ),
    "copied": _Description(
        "copied", "has the very values of {input}: a column was copied, and it is not used"
    ),
    "outliers": _Description("outlier", "{count} single samples far from their neighbours"),
    "quantised": _Description(
        "quantised",
        "steps of {resolution:.4g}, coarser than its noise: nothing finer can be judged",
    ),
    "unusable": _Description("unusable", "{usable} of its samples are left: it is not used at all"),
    "nothing_usable": _Description(
        "nothing", "no output is left that could be trusted: nothing can be judged"
    ),
    "constant_input": _Description(
        "still",
        "constant at {value:.6g} throughout: what only answers to its changes cannot be judged, and"
        " effects that need them cannot be distinguished",
    ),
    "no_excitation": _Description(
        "still",
        "no input moves, and no output by more than its noise: neither a cause nor a parameter can"
        " be judged",
    ),
    "resampled": _Description(
        "resampled",
        "all outputs are straight lines over {times} samples each: the record was resampled, and"
        " only the {samples} samples between them are used",
    ),
    "moves_ahead": _Description(
        "ahead",
        "moves before inputs step, which nothing does that follows them: it was filtered forwards"
        " and backwards, or differentiated about every sample, or its clock is ahead of theirs;"
        " what was measured is needed as it was",
    ),
}
"""Kind and sentence of every fault, by its code."""

_EVIDENCE = ("quantised", "standing", "still")  # kinds that are reported, and used all the same
_SHARES = ("share", "usable")  # facts that are written in percent


@dataclass(frozen=True)
class Fault:
    """A fault of a record.

    Attributes
    ----------
    code : str
        How it was recognised, one of `FAULTS`.
    channel : str
        Empty if it is about all of them.
    facts : Mapping of str to Any
        Figures that its sentence needs; ``share`` of the samples of the channel.
    """

    code: str
    channel: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """The kind of fault, such as ``clipped`` for all ways in which that is recognised."""
        return FAULTS[self.code].kind

    @property
    def is_evidence(self) -> bool:
        """True if the samples remain evidence."""
        return self.kind in _EVIDENCE

    @property
    def discredits(self) -> bool:
        """True if the file contradicts its contents, so that no model should be judged by it."""
        return self.kind in ("copied", "ahead")

    @property
    def sentence(self) -> str:
        """The fault in a sentence, which begins with its channel."""
        facts = {n: format_percent(v) if n in _SHARES else v for n, v in self.facts.items()}
        text = FAULTS[self.code].sentence.format(**facts)
        return f"{self.channel}: {text}" if self.channel else text


@dataclass(frozen=True)
class Channels:
    """Inputs and measured outputs of one run, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs, outputs : Mapping of str to ndarray, shape (n,)
        NaN in an output is a gap.
    smooth : frozenset of str
        Inputs that go smoothly between samples; others are held until the next one.
    """

    time: Array
    inputs: Signals
    outputs: Signals
    smooth: frozenset[str] = frozenset()

    @property
    def is_even(self) -> bool:
        """True if samples are equally spaced."""
        return len(self.time) > 1 and evenly_sampled(self.time)
