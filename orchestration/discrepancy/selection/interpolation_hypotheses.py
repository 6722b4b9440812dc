"""Hypotheses about inputs between samples, held or linear, tested again with the best effect.

A model that is wrong may ask for the wrong one: what an effect delays looks like half a sample
more, or less, than there is. So where a model without effects leaves structure, and the record can
tell the hypotheses apart, the best effect is searched under both, and where the other one wins, all
are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fmus.kit import Effect
from orchestration.discrepancy.candidates import FittedCandidate, ScoredModel
from orchestration.discrepancy.residuals import has_structure
from orchestration.discrepancy.selection.intersample import (
    CLEAR,
    InterpolationBasis,
    Intersample,
    by_fit,
    retaken,
    turned,
    without_input_noise,
)
from orchestration.discrepancy.selection.ranking import few, nearest
from orchestration.discrepancy.selection.revision import explaining, fitted_in, revised
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import Selection, select


@dataclass(frozen=True)
class Hypothesis:
    """Inputs taken as held or linear between samples, and the base model fitted accordingly.

    Attributes
    ----------
    search : Search
    scored : ScoredModel
        The model, and where effects would move it.
    chosen : dict of str to Intersample
    fitted : dict of type[Effect] to FittedCandidate
        Promising effects over the model, in white noise.
    """

    search: Search
    scored: ScoredModel
    chosen: dict[str, Intersample]
    fitted: dict[type[Effect], FittedCandidate] = field(default_factory=dict)


def selected(
    search: Search,
    base: FittedCandidate,
    chosen: dict[str, Intersample],
    effects: Sequence[type[Effect]],
) -> tuple[Hypothesis, Selection]:
    """Select effects that explain what is wrong, and take inputs as the best effect asks.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
        The model without effects.
    chosen : dict of str to Intersample
        By its fit.
    effects : sequence of type[Effect]
        The catalogue.
    """
    hypothesis = Hypothesis(search, score(search, base, effects), chosen)
    other = by_effects(hypothesis, effects)
    selection = _select_and_revise(other, effects)
    if selection.steps:
        return _by_extended_model(other, selection)
    if other.search is search:
        return other, selection
    return _by_extended_model(hypothesis, _select_and_revise(hypothesis, effects))


def _by_extended_model(
    hypothesis: Hypothesis, selection: Selection
) -> tuple[Hypothesis, Selection]:
    """Let the model with all effects that were selected decide how inputs are taken.

    What the model without them lacks may outweigh what half a sample does by far, and leave the
    choice to the course of an input.
    """
    search = hypothesis.search
    if not selection.steps or search.budget.spent():
        return hypothesis, selection
    asked, best, chosen = by_fit(search, selection.best, hypothesis.chosen)
    if asked is search:
        return replace(hypothesis, chosen=chosen), selection
    turned_selection = fitted_in(asked, selection, best)
    if turned_selection is None:
        return hypothesis, selection
    return replace(hypothesis, search=asked, chosen=chosen), turned_selection


def _select_and_revise(hypothesis: Hypothesis, effects: Sequence[type[Effect]]) -> Selection:
    search = hypothesis.search
    selection = select(search, effects, hypothesis.scored, hypothesis.fitted)
    return explaining(search, revised(search, selection, effects))


def by_effects(hypothesis: Hypothesis, effects: Sequence[type[Effect]]) -> Hypothesis:
    """Let the best effect overrule how inputs are taken.

    Parameters
    ----------
    hypothesis : Hypothesis
        By the fit of the model without effects.
    effects : sequence of type[Effect]
        The catalogue.

    Returns
    -------
    Hypothesis
        The same, or the one that the record asks for.
    """
    search = hypothesis.search
    base = hypothesis.scored.model
    names = [name for name, choice in hypothesis.chosen.items() if choice.open]
    if not names or search.budget.spent() or not has_structure(base, search.data):
        return hypothesis
    search.progress("looking at inputs both ways")
    promising = few(hypothesis.scored, effects)
    quiet_search, quiet_base, _ = without_input_noise(search, base)
    if quiet_search is search:
        best = _likeliest(hypothesis, names, promising)
        if best.search is search:
            return best
        return replace(best, scored=score(best.search, best.scored.model, effects))
    quiet = Hypothesis(quiet_search, score(quiet_search, quiet_base, promising), hypothesis.chosen)
    chosen = _likeliest(quiet, names, promising).chosen
    search, base, chosen = retaken(search, base, hypothesis.chosen, chosen)
    if search is hypothesis.search:
        return hypothesis
    return Hypothesis(search, score(search, base, effects), chosen)


def _likeliest(
    hypothesis: Hypothesis, names: Sequence[str], promising: Sequence[type[Effect]]
) -> Hypothesis:
    """Take each of some inputs in the way in which the best of the promising effects fits best."""
    least, fitted = nearest(hypothesis.search, hypothesis.scored, promising)
    best = replace(hypothesis, fitted=fitted)
    for name in names:
        other = turned(best.search, best.scored.model, [name])
        if other is None or best.search.budget.spent():
            continue
        scored = score(*other, promising)
        bic, other_fitted = nearest(other[0], scored, promising)
        before = hypothesis.chosen[name]
        margin = (least - bic) / before.inflation
        if margin >= CLEAR:
            choice = Intersample(not before.linear, InterpolationBasis.FIT, margin)
            best = Hypothesis(other[0], scored, best.chosen | {name: choice}, other_fitted)
            least = bic
    return best
