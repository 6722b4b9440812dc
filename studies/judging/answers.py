"""Judging of answers about hidden effects: records that count, and right names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from fmus.kit import Effect
from orchestration.discrepancy import Verdict
from orchestration.identify import normalised_rms
from studies.clean import CleanRecord
from studies.judging.floor import BASE, EVIDENCE, Fitted
from studies.judging.study import Row

if TYPE_CHECKING:
    from orchestration.api import DiagnosisResult

LEAST = 1.3  # noise widths that must be left of a hidden effect


def right_names(effects: Mapping[str, type[Effect]], right: frozenset[str]) -> set[str]:
    """Return labels of right effects: right by themselves, or of a family that is."""
    return {
        name for name, effect in effects.items() if name in right or effect.term.family in right
    }


def related(effects: Mapping[str, type[Effect]], right: set[str]) -> set[str]:
    """Return labels of effects with law and signal of right ones: shape, not another cause."""
    families = {effects[name].term.family for name in right} - {""}
    return right | {name for name, effect in effects.items() if effect.term.family in families}


def excluded(row: Row) -> str:
    """Return why a record does not count; empty if it does."""
    if row["widths"] < LEAST:
        return "too little"
    return "alike" if row.get("alike") else ""


def alike(floor: Mapping[str, Fitted], right: set[str]) -> list[str]:
    """Return effects that are not right but make the record as well as the truth does."""
    return [
        n for n, fit in floor.items() if n not in right and n != BASE and fit.evidence < EVIDENCE
    ]


def held_out(result: DiagnosisResult, drawn: CleanRecord) -> Row:
    """Return groups that were named, and errors on held-out data over those of the truth.

    What corrects the shape of a cause is named only with what it cannot be told from.
    """
    diagnosis = result.details.diagnosis
    first = diagnosis.validation.first
    best = {o: normalised_rms(y[first:], drawn.clean[o][first:]) for o, y in drawn.outputs.items()}
    ratios = [error / best[o] for o, error in diagnosis.after.items() if best[o] > 0.0]
    is_ambiguous = diagnosis.verdict is Verdict.AMBIGUOUS
    steps = [
        step
        for step in diagnosis.selection.steps
        if step.chosen.effect_name in diagnosis.causes or (is_ambiguous and step.alternatives)
    ]
    return {
        "groups": [[s.chosen.effect_name, *(e.effect_name for e in s.alternatives)] for s in steps],
        "ratio": max(ratios, default=float("nan")),
        "sentence": result.sentence,
    }
