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
from orchestration.discrepancy.residuals.innovations import power
from orchestration.discrepancy.selection.ranking import ranked
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.discrepancy.selection.stepwise import ACCEPT, ALTERNATIVE, Selection, Step, interchangeable

EXPLAINED = 0.1  # of the error beyond noise, that the effects named take away at least where structure is left


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
    return selection


def explaining(search: Search, selection: Selection) -> Selection:
    """The selection, or nothing named where hardly any of what the model leaves is explained by it.

    Whatever is wrong with a model, some effect fits it a little. Where structure is left beside one that takes away
    less than a tenth of the error beyond noise, something else is wrong.
    """
    if not selection.steps or search.budget.spent() or not has_structure(selection.best, search.data):
        return selection
    before, after = selection.base.fit, selection.best.fit
    noise = {o: power(after.innovation[o]) * n.deviation**2 for o, n in after.noise.items()}
    left = {o: power(before.residual[o]) - noise[o] for o in noise}
    taken = {o: power(before.residual[o]) - power(after.residual[o]) for o in noise}
    if any(taken[o] > EXPLAINED * left[o] > 0.0 for o in noise):
        return selection
    named = [(step.chosen, step.gain) for step in selection.steps]
    unsure = selection.unsure | {fitted.effect_name for fitted, _ in named}
    return replace(selection, steps=[], rejected=[*named, *selection.rejected], unsure=unsure)


def _revised_once(search: Search, selection: Selection, effects: Sequence[type[Effect]]) -> Selection | None:
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
        if best.delta_bic(without, selection.tried) <= ACCEPT:
            return _chain(search, selection, without)
        known = set(map(label, kept)) | search.not_assessed.keys()
        others = [e for e in effects if label(e) not in known]
        tried = ranked(search, without, [score(search, without, others)], others)
        if tried and tried[0][0].effect is not effect and best.fit.bic - tried[0][0].fit.bic > ALTERNATIVE:
            return _chain(search, selection, tried[0][0])
        close = [
            e for e, _ in tried if e.fit.bic - best.fit.bic < ALTERNATIVE and not interchangeable(e.effect, effect)
        ]
        _tell(selection, effect, close)
    return None


def _tell(selection: Selection, effect: type[Effect], close: Sequence[FittedCandidate]) -> None:
    """Note what would do as well in the place of an effect, now that the others are there."""
    k = next(k for k, step in enumerate(selection.steps) if step.chosen.effect is effect)
    named = set(map(label, selection.best.candidate.effects))
    selection.steps[k] = replace(selection.steps[k], alternatives=[e for e in close if e.effect_name not in named])


def _chain(search: Search, selection: Selection, best: FittedCandidate) -> Selection | None:
    """A selection that ends in a model, with every effect over those before it; none if one cannot be fitted."""
    models = [best]
    for k in range(len(best.candidate.effects) - 1, -1, -1):  # the base, too: in the same distribution of the noise
        below = _fitted(search, models[0], best.candidate.effects[:k])
        if below is None:
            return None
        models.insert(0, below)
    steps = list[Step]()
    for below, model in pairwise(models):
        gain, p_value = model.delta_bic(below, selection.tried), model.p_value(below, selection.tried)
        known = next((s for s in selection.steps if s.chosen.effect is model.effect), None)
        steps.append(
            replace(known, chosen=model, gain=gain, p_value=p_value)
            if known
            else Step(model, gain, p_value, [], [], gains={model.effect_name: gain})
        )
    return replace(selection, steps=steps)


def _fitted(search: Search, around: FittedCandidate, effects: Sequence[type[Effect]]) -> FittedCandidate | None:
    """A model with some of another's effects, fitted from where that one stands and in its noise."""
    moving = {effect.layout.start_of[state.name] for effect in effects for state in effect.layout.states}
    candidate = Candidate((), search.base, tuple(name for name in around.candidate.starts if name in moving))
    for effect in effects:
        candidate = candidate.with_effect(effect)
    try:
        return search.fit_from(candidate, around)
    except FAILURES:
        return None
