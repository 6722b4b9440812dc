"""The sets of terms that a diagnosis fitted, with what each gains."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.report import wording
from orchestration.diagnosis.term_names import sentence, shape_text
from orchestration.diagnosis.terms import Term


@dataclass(frozen=True)
class TriedSet:
    """A set of terms and readings of the file, compared with the model without any.

    Attributes
    ----------
    parts : str
        In words, with shapes.
    fitted, left_out, score : float
        Gain in log likelihood on fitted samples and on others, and what decides of both, nats.
    error : float or None
        Root mean square on samples by which nothing was chosen, over the spread of each output.
    """

    parts: str
    fitted: float
    left_out: float
    score: float
    error: float | None


def tried_sets(diagnosis: Diagnosis) -> Iterator[TriedSet]:
    """Yield the sets that were fitted, the best first, and each in its best fit."""
    cls = diagnosis.cls
    known = set()
    for one in diagnosis.found.compared():
        parts = "; ".join(
            f"{sentence(cls, p)}, {shape_text(p)}"
            if isinstance(p, Term)
            else wording.part_text(diagnosis, p)
            for p in one.judged.parts
        )
        if parts not in known:
            known.add(parts)
            gain = one.comparison
            error = diagnosis.error(one.judged)
            yield TriedSet(parts, gain.fitted, gain.left_out, one.score, error)
