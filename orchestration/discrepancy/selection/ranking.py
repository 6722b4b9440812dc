"""Effects fitted over a model, the best first: the promising ones, or all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fmus.kit import Effect
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.candidates.evidence import FittedCandidate, ScoredModel, ScreenedCandidate
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import Counter, side_by_side
from orchestration.discrepancy.residuals.analysis import has_structure
from orchestration.discrepancy.selection.scoring import PROMISING, WORTH, screen
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.identify.method import FULLY, GLANCE, Method

AT_ONCE = 2
DOMINATED = 0.2  # of what another has gained already
CONTENDER = 0.5  # of what the best gains, from which on it is worth making sure of a fit

Ranked = list[tuple[FittedCandidate, float]]
"""Candidates with the fall of BIC that each brings, less the price of looking at many; the best first."""


def ranked(
    search: Search, below: FittedCandidate, scored: Sequence[ScoredModel], effects: Sequence[type[Effect]]
) -> Ranked:
    """Fit the promising effects over a model.

    Parameters
    ----------
    search : Search
    below : FittedCandidate
        The model.
    scored : sequence of ScoredModel
        Where fits begin: that model, and others of the same effects.
    effects : sequence of type[Effect]
    """
    best: dict[type[Effect], FittedCandidate] = {}
    for origin in scored:
        promising = [c for c in screen(origin, effects, PROMISING) if c.predicted.fall > WORTH]
        _fit(search, below, promising[:PROMISING], best)
    return _in_order(search, below, best, len(effects))


def with_others(
    search: Search, below: FittedCandidate, scored: ScoredModel, effects: Sequence[type[Effect]], tried: Ranked
) -> Ranked:
    """Fit the other effects, too, where the model leaves structure.

    A score orders effects. It is linear, and what it expects little of may be right all the same.
    """
    done = {e.effect for e, _ in tried}
    others = [effect for effect in effects if effect not in done]
    if search.budget.spent() or not others or not has_structure(below, search.data):
        return tried
    best = _glanced_at(search, below, screen(scored, others, len(others)))
    more = _in_order(search, below, best, len(effects))
    return sorted([*tried, *more], key=lambda row: -row[1])


def _in_order(search: Search, below: FittedCandidate, best: dict[type[Effect], FittedCandidate], number: int) -> Ranked:
    _make_sure(search, below, best)
    return sorted(((e, e.delta_bic(below, number)) for e in best.values()), key=lambda row: -row[1])


def _make_sure(search: Search, below: FittedCandidate, best: dict[type[Effect], FittedCandidate]) -> None:
    """Fit those that have a chance once more, from beside where they ended."""
    gains = {effect: below.fit.bic - e.fit.bic for effect, e in best.items()}
    contenders = [effect for effect, gain in gains.items() if gain > CONTENDER * max(0.0, *gains.values())]
    counter = Counter(search.progress, "making sure of fits", len(contenders))

    def sure(effect: type[Effect]) -> FittedCandidate:
        refined = search.refine(best[effect])
        counter.one_more()
        return refined

    best |= zip(contenders, side_by_side(sure, contenders), strict=True)


def _fit(
    search: Search,
    below: FittedCandidate,
    candidates: Sequence[ScreenedCandidate],
    best: dict[type[Effect], FittedCandidate],
) -> None:
    """Fit promising candidates, and put into `best` what is better; what others have overtaken is left out."""
    counter = Counter(search.progress, "fitting effects", len(candidates))

    def fitted(candidate: ScreenedCandidate) -> FittedCandidate | None:
        found = _tried(search, below, candidate)
        counter.one_more()
        return found

    while candidates:
        if search.budget.spent():
            search.budget.leave(label(c.effect) for c in candidates if c.effect not in best)
            return
        # what the best of them gains tells which of the others still has a chance
        batch, candidates = candidates[:AT_ONCE], candidates[AT_ONCE:]
        _keep(side_by_side(fitted, batch), best)
        gained = max((batch[0].below.fit.deviance - e.fit.deviance for e in best.values()), default=0.0)
        candidates = [c for c in candidates if c.predicted.fall > DOMINATED * gained]


def _glanced_at(
    search: Search, below: FittedCandidate, candidates: Sequence[ScreenedCandidate]
) -> dict[type[Effect], FittedCandidate]:
    """Fit candidates of which little is expected: a few steps, and to the end what has a chance then."""
    counter, best = (
        Counter(search.progress, "fitting all effects", len(candidates)),
        dict[type[Effect], FittedCandidate](),
    )

    def glance(candidate: ScreenedCandidate) -> FittedCandidate | None:
        if search.budget.spent():
            search.budget.leave([label(candidate.effect)])
            return None
        seen = _tried(search, below, candidate, GLANCE)
        counter.one_more()
        return seen

    seen = side_by_side(glance, candidates)
    _keep(seen, best)
    gained = max((below.fit.bic - e.fit.bic for e in best.values()), default=0.0)
    least = below.fit.bic - max(CONTENDER * gained, 0.0)
    chances = [c for c, e in zip(candidates, seen, strict=True) if e and e.fit.bic < least]
    _keep(side_by_side(lambda c: _tried(search, below, c), chances), best)
    return best


def _keep(fitted: Sequence[FittedCandidate | None], best: dict[type[Effect], FittedCandidate]) -> None:
    for one in filter(None, fitted):
        best[one.effect] = min(best.get(one.effect, one), one, key=lambda e: e.fit.bic)


def _tried(
    search: Search, below: FittedCandidate, screened: ScreenedCandidate, method: Method = FULLY
) -> FittedCandidate | None:
    try:
        fitted = search.fit_extended(screened, method)
        if fitted.fit.deviance > below.fit.deviance:  # it contains that model, so the search was lost
            at_rest = screened.predicted.without_step()
            fitted = search.fit_extended(replace(screened, below=below, predicted=at_rest), method)
    except FAILURES as error:
        name = label(screened.effect)
        search.not_assessed[name] = Note(NoteCode.NOT_SIMULATED, name, {"reason": str(error)})
        return None
    return fitted
