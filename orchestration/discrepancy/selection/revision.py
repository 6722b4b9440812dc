"""Effects that were named one after another, judged together: backward elimination, and swaps.

Each must be needed beside the others, and no other do better in its place. Forward selection alone keeps what an early
step took for the sum of two causes (Miller: Subset Selection in Regression, 2nd ed., 2002, chapter 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from fmus.kit import Effect
from orchestration.discrepancy.candidates.candidate import Candidate, label
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.residuals.analysis import has_structure
from orchestration.discrepancy.selection.ranking import ACCEPT, CONTENDER, Row, ranked
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.discrepancy.selection.stepwise import (
    Selection,
    Step,
    interchangeable,
    loses_memory,
    takes_enough,
)


def revised(search: Search, selection: Selection, effects: Sequence[type[Effect]]) -> Selection:
    """Eliminate what is not needed beside the others, and swap what another does better.

    Parameters
    ----------
    search : Search
    selection : Selection
        By forward selection.
    effects : sequence of type[Effect]
        The catalogue.
    """
    for _ in range(len(selection.steps)):
        changed = _revised_once(search, selection, effects)
        if changed is None:
            break
        selection = changed
    return _weightiest_first(search, selection)


def explaining(search: Search, selection: Selection) -> Selection:
    """The selection, or nothing named where hardly any of what the model leaves is explained by it.

    Whatever is wrong with a model, some effect fits it a little. Where structure is left beside one that takes away
    less than a tenth of the error beyond noise, something else is wrong.
    """
    if (
        not selection.steps
        or search.budget.spent()
        or not has_structure(selection.best, search.data)
    ):
        return selection
    if takes_enough(selection.base, selection.base, selection.best):
        return selection
    named = [(step.chosen, step.gain) for step in selection.steps]
    unsure = selection.unsure | {fitted.effect_name for fitted, _ in named}
    return replace(selection, steps=[], rejected=[*named, *selection.rejected], unsure=unsure)


def _revised_once(
    search: Search, selection: Selection, effects: Sequence[type[Effect]]
) -> Selection | None:
    """The selection without an effect, or with another in its place; none if it stands as it is."""
    if len(selection.steps) < 2:
        return None
    best = selection.best
    for effect in best.candidate.effects[:-1]:  # the last was looked for beside the others
        if search.budget.spent():
            return None
        kept = [e for e in best.candidate.effects if e is not effect]
        without = _fitted(search, best, kept)
        if without is None:
            continue
        if best.delta_bic(without, selection.tried) <= ACCEPT and not loses_memory(without, best):
            return _chain(search, selection, without)
        if all(interchangeable(effect, other) for other in kept):
            continue  # shapes of one cause
        known = set(map(label, kept)) | search.not_assessed.keys()
        rivals = _rivals(selection, effect) | {label(effect)}
        others = [e for e in effects if label(e) in rivals - known]
        tried = ranked(search, without, [score(search, without, others)], others)
        best_row = tried.rows[0] if tried.rows else None
        own = next((row for row in tried.rows if row[0].effect is effect), None)
        if (
            best_row
            and best_row is not own
            and tried.may_be(best_row)
            and not (own and tried.are_alike(best_row, own))
        ):
            other = _fitted(search, best_row[0], best_row[0].candidate.effects)
            if other is not None and other.delta_bic(without, selection.tried) > ACCEPT:
                return _chain(search, selection, other)
        if own:
            _tell(
                selection,
                effect,
                [r for r in tried.rows if r is not own and tried.are_alike(own, r)],
            )
    return None


def _rivals(selection: Selection, effect: type[Effect]) -> set[str]:
    """Effects that came near one where it was named, or beside it showed something."""
    k = next(k for k, step in enumerate(selection.steps) if step.chosen.effect is effect)
    near = {
        name
        for name, gain in selection.steps[k].gains.items()
        if gain > CONTENDER * selection.steps[k].gain
    }
    later = {
        name
        for step in selection.steps[k + 1 :]
        for name, gain in step.gains.items()
        if gain > ACCEPT
    }
    return (
        near | later | {fitted.effect_name for fitted, gain in selection.rejected if gain > ACCEPT}
    )


def _weightiest_first(search: Search, selection: Selection) -> Selection:
    """The same effects in the order of how much worse the model is without each."""
    best = selection.best
    if len(selection.steps) < 2 or search.budget.spent():
        return selection
    without = {
        e: _fitted(search, best, [other for other in best.candidate.effects if other is not e])
        for e in best.candidate.effects
    }
    if not all(without.values()):
        return selection
    ordered = sorted(without, key=lambda e: -without[e].fit.bic)  # type: ignore[union-attr]
    if tuple(ordered) == best.candidate.effects:
        return selection
    again = _fitted(search, best, ordered)
    return (again and _chain(search, selection, again)) or selection


def _tell(selection: Selection, effect: type[Effect], close: Sequence[Row]) -> None:
    """Note what would do as well in the place of an effect, now that the others are there."""
    k = next(k for k, step in enumerate(selection.steps) if step.chosen.effect is effect)
    named, step = set(map(label, selection.best.candidate.effects)), selection.steps[k]
    others = [
        (e, gain)
        for e, gain in close
        if e.effect_name not in named and not interchangeable(e.effect, effect)
    ]
    gains = step.gains | {e.effect_name: gain for e, gain in others}
    selection.steps[k] = replace(step, alternatives=[e for e, _ in others], gains=gains)


def _chain(search: Search, selection: Selection, best: FittedCandidate) -> Selection | None:
    """A selection that ends in a model, with every effect over those before it; none if one cannot be fitted."""
    models = [best]
    for k in range(
        len(best.candidate.effects) - 1, -1, -1
    ):  # the base, too: in the same distribution of the noise
        below = _fitted(search, models[0], best.candidate.effects[:k])
        if below is None:
            return None
        models.insert(0, below)
    steps = list[Step]()
    for below, model in pairwise(models):
        evidence, p_value = (
            model.delta_bic(below, selection.tried),
            model.p_value(below, selection.tried),
        )
        known = next((s for s in selection.steps if s.chosen.effect is model.effect), None)
        if known and loses_memory(below, model):
            evidence, p_value = max((evidence, p_value), (known.evidence, known.p_value))
        steps.append(
            replace(known, chosen=model, evidence=evidence, p_value=p_value)
            if known
            else Step(
                model, evidence, evidence, p_value, [], [], gains={model.effect_name: evidence}
            )
        )
    return replace(selection, steps=steps)


def _fitted(
    search: Search, around: FittedCandidate, effects: Sequence[type[Effect]]
) -> FittedCandidate | None:
    """A model with some of another's effects, fitted from where that one stands and in its noise."""
    moving = {
        effect.layout.start_of[state.name] for effect in effects for state in effect.layout.states
    }
    candidate = Candidate(
        (), search.base, tuple(name for name in around.candidate.starts if name in moving)
    )
    for effect in effects:
        candidate = candidate.with_effect(effect)
    try:
        return search.fit_from(candidate, around)
    except FAILURES:
        return None
