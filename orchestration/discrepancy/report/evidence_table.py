"""The section of the report that lists every effect that was tried, with its evidence."""

from __future__ import annotations

from dataclasses import dataclass

from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import elements, typography, wording
from orchestration.reporting.page import Page


@dataclass(frozen=True)
class Tried:
    """An effect that was fitted, and what became of it."""

    candidate: FittedCandidate
    gain: float
    p_value: float
    verdict: str
    why: str = ""


def every_tried(diagnosis: Diagnosis) -> list[Tried]:
    """Every effect that was fitted, once: those named, their alternatives, and others by their last trial."""
    steps, tried = diagnosis.selection.steps, diagnosis.selection.tried
    below = [diagnosis.selection.base, *(step.chosen for step in steps)]
    named = [step.chosen.effect_name for step in steps]
    rows = [
        Tried(step.chosen, step.gain, step.p_value, "named", _unseen(diagnosis, step.chosen))
        for step in steps
    ]
    for step, under in zip(steps, below, strict=False):
        for alternative in step.alternatives:
            gain = step.gains[alternative.effect_name]
            why = f"from {step.chosen.effect_name}"
            rows.append(
                Tried(alternative, gain, alternative.p_value(under, tried), "not told apart", why)
            )
    listed = {row.candidate.effect_name for row in rows}
    trials: dict[str, list[tuple[FittedCandidate, float, FittedCandidate]]] = {}
    for rejected, under in zip(
        [*(step.rejected for step in steps), diagnosis.selection.rejected], below, strict=True
    ):
        for candidate, gain in rejected:
            trials.setdefault(candidate.effect_name, []).append((candidate, gain, under))
    others = []
    for name in trials.keys() - listed:
        candidate, gain, under = trials[name][-1]
        unsure = name in diagnosis.selection.unsure
        why = wording.why_not([g for _, g, _ in trials[name]], " and ".join(named), unsure)
        others.append(Tried(candidate, gain, candidate.p_value(under, tried), "rejected", why))
    return rows + sorted(others, key=lambda row: (-row.gain, row.candidate.candidate.name))


def _unseen(diagnosis: Diagnosis, chosen: FittedCandidate) -> str:
    """What the part held out says of a cause, and how surely."""
    if (found := diagnosis.confirmations.get(chosen.effect_name)) is None:
        return ""
    said, score = wording.confirmation(diagnosis, chosen.effect_name), found.score
    return f"{said} (log-likelihood {score.gain:+.3g} ± {score.standard_error:.2g})"


def evidence(made: Page, result: Result) -> None:
    """What speaks for every effect, and why it was named or not."""
    diagnosis = result.diagnosis
    made.heading("Evidence: what was tried")
    rows = every_tried(diagnosis)
    if rows:
        most = max(row.gain for row in rows)
        head = ["effect", "fall of BIC", "p-value", "verdict"]
        made.table(
            head,
            [
                [
                    elements.two(row.candidate.effect_name, typography.does(row.candidate.effect)),
                    elements.bar(row.gain, most),
                    typography.probability(row.p_value),
                    elements.two(elements.chip(row.verdict, row.verdict), row.why),
                ]
                for row in rows
            ],
        )
        made.parts.append(
            elements.aside(
                "BIC weighs how likely a model makes the record against the number of its parameters. Its fall is less the "
                f"price of looking at {diagnosis.selection.tried} effects, and p-values are corrected for that. Every "
                "candidate refits all parameters and the colour of the noise."
            )
        )
    fitted = {row.candidate.effect_name for row in rows}
    others = [label(effect) for effect in result.effects if label(effect) not in fitted]
    if others:
        none = (
            "Looked at; none was promising enough to be fitted"
            if diagnosis.selection.tried
            else "Not tried"
        )
        why = "Less promising, and so not fitted" if rows else none
        made.text(f"{why}: {', '.join(others)}.")
