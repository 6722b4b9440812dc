"""The comparison of two candidates of a diagnosis, by the features that decide."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit import UserError
from orchestration.diagnosis.comparison import FEATURES, WEIGHTS, Comparison, Judged, compare
from orchestration.diagnosis.courses import Courses
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.fitting import fit, nominal_point, weights_of
from orchestration.diagnosis.report import wording
from orchestration.diagnosis.report.curves import own_courses
from orchestration.diagnosis.search import Ranked
from orchestration.diagnosis.signals import scale_of_signal
from orchestration.diagnosis.terms import Shape, Term
from orchestration.reporting import Displayable, one_line, option, plain_table

if TYPE_CHECKING:
    from rich.console import RenderableType

NOTHING = "nothing"  # name of the model without terms
_SHAPES = (Shape.LINEAR, Shape.ODD_SQUARE, Shape.CUBE, Shape.DRY, Shape.DEAD_ZONE)
_ALIKE = 0.95  # correlation from which on two models do nearly the same
_WIDTHS = {Shape.DRY: 0.2, Shape.DEAD_ZONE: 0.5}  # where a search starts, in scales of the signal


@dataclass(frozen=True)
class Explanation(Displayable):
    """Two candidates of a diagnosis, compared on the same samples.

    Attributes
    ----------
    names : tuple of str
        ``LAW(SIGNAL)`` of each, or ``nothing``.
    models : tuple of Judged
        The best fit with each that is without the other.
    comparison : Comparison
        Of the first over the second.
    scores, errors : tuple of float
        Score, nats, and error on samples by which nothing was chosen, of each.
    likeness : float
        Correlation of what both do to the outputs on unseen samples.
    samples : float
        Independent samples among the unseen ones.
    texts : tuple of str
        The terms of each, for people.
    """

    names: tuple[str, str]
    models: tuple[Judged, Judged]
    comparison: Comparison
    scores: tuple[float, float]
    errors: tuple[float | None, float | None]
    likeness: float
    samples: float
    texts: tuple[str, str]

    def __repr__(self) -> str:
        return one_line(
            f"Explanation {self.names[0]} against {self.names[1]}: {self.lead:+.1f} nat"
        )

    @property
    def lead(self) -> float:
        """Score of the first less that of the second, nats."""
        return self.scores[0] - self.scores[1]

    @property
    def even_error(self) -> float | None:
        """Error on unseen samples with which the candidate that is behind would have caught up."""
        error = self.errors[1 if self.lead >= 0.0 else 0]
        if error is None:
            return None
        return error * float(np.exp(-abs(self.lead) / (WEIGHTS.left_out * self.samples)))

    @property
    def sentence(self) -> str:
        """The outcome, and what a record would have to hold to change it."""
        ahead, behind = (0, 1) if self.lead >= 0.0 else (1, 0)
        models = ["the model as it is" if name == NOTHING else name for name in self.names]
        better, worse = models[ahead], models[behind]
        outcome = f"{better} is ahead of {worse} by {abs(self.lead):.1f} nat."
        if self.likeness > _ALIKE:
            return (
                f"{outcome} Both do nearly the same to the outputs here (correlation"
                f" {self.likeness:.3f}): a record tells them apart in which their signals do not"
                " move together."
            )
        needed, other = self.even_error, self.errors[ahead]
        if needed is None or other is None:
            return outcome
        if needed < other:
            return f"{outcome} Only a record would change it on which {worse} has the lower error."
        return (
            f"{outcome} It would change on a record on which {worse} has an error of"
            f" {wording.error_text(needed)} instead of {wording.error_text(self.errors[behind])},"
            f" with the error of {better} as it is."
        )

    def overview(self) -> Iterator[RenderableType]:
        """Yield the outcome and a table of the features, the first candidate over the second."""
        one, other = self.names
        yield self.sentence
        columns = ("feature", f"{one} over {other}")
        table = plain_table("comparison", *columns, right=columns[1:])
        for name, title in FEATURES.items():
            table.add_row(title, f"{getattr(self.comparison, name):.4g}")
        table.add_row("lead in score [nat]", f"{self.lead:.4g}")
        yield table
        figures = ("score [nat]", "error on unseen samples")
        table = plain_table("candidates", "candidate", "terms", *figures, right=figures)
        for name, text, score, error in zip(
            self.names, self.texts, self.scores, self.errors, strict=True
        ):
            table.add_row(name, text, f"{score:.1f}", wording.error_text(error))
        yield table


def explain(diagnosis: Diagnosis, first: str, second: str) -> Explanation:
    """Compare two candidates of a diagnosis.

    A candidate that the search did not fit alone is fitted now, in plain shapes.

    Parameters
    ----------
    diagnosis : Diagnosis
    first, second : str
        ``LAW(SIGNAL)``, or ``nothing`` for the model without terms.

    Raises
    ------
    UserError
        If there is no such law or signal, both are the same, or a candidate runs away.
    """
    if first == second:
        raise UserError(f"{option('explain', [first, second])}: both candidates are the same")
    found = diagnosis.found
    for name, rival in ((first, second), (second, first)):
        if name != NOTHING and not any(_is_of(judged, name, rival) for judged in found.fits):
            found = found.with_fits(_fitted_now(diagnosis, name, rival))
    ranked = found.compared()
    one, one_score = _best(diagnosis, ranked, first, second)
    other, other_score = _best(diagnosis, ranked, second, first)
    common = found.common
    return Explanation(
        (first, second),
        (one, other),
        compare(one, other, common),
        (one_score, other_score),
        (diagnosis.error(one), diagnosis.error(other)),
        _likeness(diagnosis, one, other),
        float(max(common.left_out.sum(), 1.0)),
        (_text(diagnosis, one), _text(diagnosis, other)),
    )


def _is_of(judged: Judged, name: str, other: str) -> bool:
    """Return whether a fit has one candidate and not the other."""
    names = {wording.name(part) for part in judged.parts}
    return name in names and other not in names


def _best(
    diagnosis: Diagnosis, ranked: list[Ranked], name: str, other: str
) -> tuple[Judged, float]:
    """Return the best fit of a candidate, with its score.

    Raises
    ------
    UserError
        If it has none that can be compared.
    """
    if name == NOTHING:
        return diagnosis.found.base, 0.0
    best = next((one for one in ranked if _is_of(one.judged, name, other)), None)
    if best is None:
        raise UserError(f"{option('explain', [name])}: no fit of it can be compared")
    return best.judged, best.score


def _fitted_now(diagnosis: Diagnosis, name: str, rival: str) -> list[Judged]:
    """Fit a candidate that no set had without its rival, in plain shapes.

    On the files as the final model reads them, unless that reading is the rival.

    Raises
    ------
    UserError
        If there is no such law or signal, or the model runs away with it.
    """
    subject = diagnosis.found.subject if rival == str(diagnosis.reading) else diagnosis.subject
    model = subject.problem.model
    law, bracket, signal = name.partition("(")
    signal = signal.removesuffix(")")
    if not bracket or law not in model.laws or signal not in model.signals:
        fitted = dict.fromkeys(wording.name(p) for one in diagnosis.found.fits for p in one.parts)
        if name in fitted:
            raise UserError(
                f"{option('explain', [name, rival])}: {name} was fitted together with {rival} only"
            )
        raise UserError(
            f"{option('explain', [name])}: a candidate is LAW(SIGNAL) or {NOTHING}; fitted were"
            f" {', '.join(fitted) or 'none'}"
        )
    along = own_courses(subject.base)
    weights = weights_of(subject.base.errors)
    judged = []
    for term in _plain_terms(along, law, signal):
        start = replace(nominal_point(subject.problem, [term]), q=subject.base.point.q)
        found = fit(subject.problem, [term], [start], weights)
        one = None if found is None else subject.judge(found)
        if one is not None:
            judged.append(one)
    if not judged:
        raise UserError(f"{option('explain', [name])}: the model runs away with this term")
    return judged


def _plain_terms(along: Courses, law: str, signal: str) -> Iterator[Term]:
    """Yield a term in plain shapes, sized by courses of the model without it."""
    size = float(np.sqrt(np.mean(along.values[law] ** 2))) or 1.0
    scale, middle = scale_of_signal(along.values[signal])
    for shape in _SHAPES:
        term = Term(law, signal, shape, size=size, scale=scale or 1.0, middle=middle)
        yield replace(term, width=_WIDTHS.get(shape, 1.0))


def _likeness(diagnosis: Diagnosis, one: Judged, other: Judged) -> float:
    """Return the correlation of what two models change on unseen samples."""
    base = diagnosis.found.base.measuring
    ours, theirs = (base - judged.measuring for judged in (one, other))
    present = np.isfinite(ours) & np.isfinite(theirs)
    ours, theirs = ours[present], theirs[present]
    size = np.sqrt(np.sum(ours**2) * np.sum(theirs**2))
    return float(np.sum(ours * theirs) / size) if size > 0.0 else 0.0


def _text(diagnosis: Diagnosis, judged: Judged) -> str:
    return "; ".join(wording.part_text(diagnosis, part) for part in judged.parts) or "no term"
