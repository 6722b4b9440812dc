"""Backward elimination and swaps: effects named one after another are judged together.

Each must be needed beside the others, and no other do better in its place. Forward selection alone
keeps what an early step took for the sum of two causes (Miller: Subset Selection in Regression, 2nd
ed., 2002, chapter 3).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fmus.kit import Effect
from orchestration.discrepancy.candidates import FittedCandidate, label
from orchestration.discrepancy.residuals import has_structure
from orchestration.discrepancy.selection.ranking import ACCEPT, CONTENDER, Row, ranked
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import (
    Selection,
    Step,
    interchangeable,
    place_of,
    takes_enough,
    whitens_residual,
)


def revised(search: Search, selection: Selection, effects: Sequence[type[Effect]]) -> Selection:
    """Eliminate effects not needed beside the others, and swap those that another does better.

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
    return _at_fewest_places(search, _weightiest_first(search, selection))


def needed(search: Search, selection: Selection) -> Selection:
    """Return a selection without the effects that account for too little beside the others.

    Where a correction of a law stands beside effects of the catalogue, these were named when it was
    not there; see `takes_enough`.

    Returns
    -------
    Selection
        With models that are fitted anew; the same where every effect is needed.
    """
    while len(selection.steps) > 1 and not search.budget.spent():
        best = selection.best
        others = [search.fit_without(best, effect) for effect in best.candidate.effects]
        fitted = [other for other in others if other is not None]
        nearest = min(fitted, key=lambda other: other.fit.bic, default=None)
        if nearest is None or _is_worth(selection, nearest):
            break
        shorter = _chain(search, selection, nearest)
        if shorter is None:
            break
        selection = shorter
    return _weightiest_first(search, selection)


def _is_worth(selection: Selection, without: FittedCandidate) -> bool:
    """Return whether the best model is worth what it has more than one without an effect."""
    best = selection.best
    if best.delta_bic(without, selection.tried) <= ACCEPT:
        return whitens_residual(without, best)
    kept = without.candidate.effects
    (effect,) = (e for e in best.candidate.effects if e not in kept)
    is_shape = any(interchangeable(effect, other) for other in kept)
    return is_shape or takes_enough(base=selection.base, below=without, richer=best)


def without_effect(search: Search, selection: Selection, effect: type[Effect]) -> Selection:
    """Return a selection less one effect, the models with the others fitted anew.

    Where they cannot be fitted, all that was added after it goes with it.
    """
    without = search.fit_without(selection.best, effect)
    chain = None if without is None else _chain(search, selection, without)
    if chain is not None:
        return chain
    first = next(k for k, step in enumerate(selection.steps) if step.chosen.effect is effect)
    dropped = [(step.chosen, step.gain) for step in selection.steps[first:]]
    rejected = [*dropped, *selection.rejected]
    return replace(selection, steps=selection.steps[:first], rejected=rejected)


def explaining(search: Search, selection: Selection) -> Selection:
    """Return the selection, with all its effects rejected where together they explain too little.

    Whatever is wrong with a model, some effect fits it a little. Where structure is left beside
    effects that take away less than a tenth of the error beyond noise, something else is wrong.
    """
    if not selection.steps or search.budget.spent():
        return selection
    if not has_structure(selection.best, search.data):
        return selection
    if takes_enough(base=selection.base, below=selection.base, richer=selection.best):
        return selection
    # in noise with a long memory a likelihood says little of how near a simulation is
    base = search.trusted(selection.base)
    if takes_enough(base=base, below=base, richer=search.trusted(selection.best, base)):
        return selection
    named = [(step.chosen, step.gain) for step in selection.steps]
    unsure = selection.unsure | {fitted.effect_name for fitted, _ in named}
    return replace(selection, steps=[], rejected=[*named, *selection.rejected], unsure=unsure)


def fitted_in(search: Search, selection: Selection, best: FittedCandidate) -> Selection | None:
    """Return a selection in another search, that ends in its best model fitted there.

    None if one of its models cannot be fitted.
    """
    base = search.fit_with((), best)
    chain = None if base is None else _chain(search, selection, best)
    return None if base is None or chain is None else replace(chain, base=base)


def fitted_to_the_end(search: Search, selection: Selection) -> Selection:
    """Return a selection whose models are fitted to their ends, also where time was spent."""
    below = selection.base
    steps = []
    for step in selection.steps:
        chosen = step.chosen if step.chosen.fit.converged else search.refit(step.chosen)
        below = search.containing(chosen, below)
        steps.append(replace(step, chosen=below))
    return replace(selection, steps=steps)


def as_reported_models(search: Search, selection: Selection) -> Selection:
    """Return a selection with every model as it is reported; see `Search.trusted`."""
    base = search.trusted(selection.base)
    below = base
    steps = []
    for step in selection.steps:
        below = search.trusted(step.chosen, below)
        steps.append(replace(step, chosen=below))
    return replace(selection, base=base, steps=steps)


def _revised_once(
    search: Search, selection: Selection, effects: Sequence[type[Effect]]
) -> Selection | None:
    """Return the selection without an effect, or with another in its place; None if it stands."""
    if len(selection.steps) < 2:
        return None
    best = selection.best
    for effect in best.candidate.effects[:-1]:  # the last was looked for beside the others
        if search.budget.spent():
            return None
        without = search.fit_without(best, effect)
        if without is None:
            continue
        if best.delta_bic(without, selection.tried) <= ACCEPT and not whitens_residual(
            without, best
        ):
            return _chain(search, selection, without)
        if all(interchangeable(effect, other) for other in without.candidate.effects):
            continue  # shapes of one cause
        better = _better_in_place(search, selection, effect, without, effects)
        if better is not None:
            return _chain(search, selection, better)
    return None


def _better_in_place(
    search: Search,
    selection: Selection,
    effect: type[Effect],
    without: FittedCandidate,
    effects: Sequence[type[Effect]],
) -> FittedCandidate | None:
    """Fit the model with a better effect in the place of one; return None if there is none.

    Parameters
    ----------
    search : Search
    selection : Selection
    effect : type[Effect]
        In the place of which others are tried; those as good become its alternatives.
    without : FittedCandidate
        The model without it.
    effects : sequence of type[Effect]
        The catalogue.
    """
    known = set(map(label, without.candidate.effects)) | search.not_assessed.keys()
    rivals = _rivals(selection, effect) | {label(effect)}
    others = [e for e in effects if label(e) in rivals - known]
    if not others:
        return None
    tried = ranked(search, without, [score(search, without, others)], others)
    own = next((row for row in tried.rows if row[0].effect is effect), None)
    best = tried.rows[0] if tried.rows else None
    if best and best is not own and tried.is_admissible(best):
        is_better = not (own and tried.indistinguishable(best, own))
        candidate, _ = best
        other = search.fit_with(candidate.candidate.effects, candidate) if is_better else None
        if other is not None and other.delta_bic(without, selection.tried) > ACCEPT:
            return other
    if own:
        close = [r for r in tried.rows if r is not own and tried.indistinguishable(own, r)]
        _set_alternatives(selection, effect, close)
    return None


def _rivals(selection: Selection, effect: type[Effect]) -> set[str]:
    """Return labels of effects that came near one where it was named, or gained beside it."""
    k = next(k for k, step in enumerate(selection.steps) if step.chosen.effect is effect)
    step = selection.steps[k]
    rivals = {name for name, gain in step.gains.items() if gain > CONTENDER * step.gain}
    for later in selection.steps[k + 1 :]:
        rivals |= {name for name, gain in later.gains.items() if gain > ACCEPT}
    return rivals | {fitted.effect_name for fitted, gain in selection.rejected if gain > ACCEPT}


def _at_fewest_places(search: Search, selection: Selection) -> Selection:
    """Return a selection in which what may be the shape of a cause is no other cause.

    Where a cause has not quite its catalogued shape, an effect elsewhere may make up for that. If
    the record cannot tell it from one that acts where the cause does, that one takes its place.
    """
    places = set[Hashable]()
    for step in list(selection.steps):
        if search.budget.spent():
            break
        place = place_of(step.chosen.effect)
        others = [] if place in places else step.alternatives
        shape = next((one for one in others if place_of(one.effect) in places), None)
        places.add(place)
        if shape is not None:
            selection = _exchanged(search, selection, step, shape)
    return selection


def _exchanged(
    search: Search, selection: Selection, step: Step, other: FittedCandidate
) -> Selection:
    """Return a selection with an alternative in the place of an effect, which becomes its own.

    The selection stands where the model cannot be fitted.
    """
    effects = [
        other.effect if effect is step.chosen.effect else effect
        for effect in selection.best.candidate.effects
    ]
    best = search.fit_with(effects, other)
    chain = None if best is None else _chain(search, selection, best)
    if chain is None:
        return selection
    alternatives = [step.chosen, *(one for one in step.alternatives if one is not other)]
    steps = [
        replace(one, alternatives=alternatives, gains=step.gains | one.gains)
        if one.chosen.effect is other.effect
        else one
        for one in chain.steps
    ]
    return replace(chain, steps=steps)


def _weightiest_first(search: Search, selection: Selection) -> Selection:
    """Return the same causes, those first without which the model is worst.

    Effects of one cause stay in the order in which they were named: the first is the nearest to its
    shape of all.
    """
    best = selection.best
    if len(selection.steps) < 2 or search.budget.spent():
        return selection
    without = {e: search.fit_without(best, e) for e in best.candidate.effects}
    if not all(without.values()):
        return selection
    worst: dict[Hashable, float] = {}
    for effect, fitted in without.items():
        place = place_of(effect)
        worst[place] = max(worst.get(place, -np.inf), fitted.fit.bic)  # type: ignore[union-attr]
    ordered = sorted(without, key=lambda effect: -worst[place_of(effect)])
    if tuple(ordered) == best.candidate.effects:
        return selection
    again = search.fit_with(ordered, best)
    return (again and _chain(search, selection, again)) or selection


def _set_alternatives(selection: Selection, effect: type[Effect], close: Sequence[Row]) -> None:
    """Set the alternatives of an effect to those as good, now that the others are there."""
    k = next(k for k, step in enumerate(selection.steps) if step.chosen.effect is effect)
    step = selection.steps[k]
    named = set(map(label, selection.best.candidate.effects))
    others = [
        (e, gain)
        for e, gain in close
        if e.effect_name not in named and not interchangeable(e.effect, effect)
    ]
    gains = step.gains | {e.effect_name: gain for e, gain in others}
    selection.steps[k] = replace(step, alternatives=[e for e, _ in others], gains=gains)


def _chain(search: Search, selection: Selection, best: FittedCandidate) -> Selection | None:
    """Return a selection that ends in a model, every effect fitted over those before it.

    None if one cannot be fitted.
    """
    models = [best]
    # the base, too: in the same distribution of the noise
    for k in range(len(best.candidate.effects) - 1, -1, -1):
        below = search.fit_with(best.candidate.effects[:k], models[0])
        if below is None:
            return None
        models.insert(0, below)
    for k in range(1, len(models)):
        models[k] = search.containing(models[k], models[k - 1])
    steps = [_step(selection, below, model) for below, model in pairwise(models)]
    named = best.candidate.effects
    dropped = [(s.chosen, s.gain) for s in selection.steps if s.chosen.effect not in named]
    return replace(selection, steps=steps, rejected=[*selection.rejected, *dropped])


def _step(selection: Selection, below: FittedCandidate, model: FittedCandidate) -> Step:
    """Return the step from a model to one with one more effect, with its former gains if any."""
    evidence = model.delta_bic(below, selection.tried)
    p_value = model.p_value(below, selection.tried)
    former = next((s for s in selection.steps if s.chosen.effect is model.effect), None)
    if former is None:
        gains = {model.effect_name: evidence}
        return Step(model, evidence, evidence, p_value, [], [], gains=gains)
    if whitens_residual(below, model):
        evidence, p_value = max((evidence, p_value), (former.evidence, former.p_value))
    return replace(former, chosen=model, evidence=evidence, p_value=p_value)
