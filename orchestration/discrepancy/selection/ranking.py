"""Effects fitted over a model, the best first.

A noise model of its own lets every candidate take for noise what it cannot simulate, and the farther its simulation is
from the record the more. So candidates are fitted by how near their simulations come, in white noise, and the best of
them then in one noise: that of the one that comes nearest (as an F test takes the variance of the larger model).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fmus.kit import Effect
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.candidates.evidence import FittedCandidate, ScoredModel, ScreenedCandidate
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import Counter, side_by_side
from orchestration.discrepancy.residuals.analysis import has_structure
from orchestration.discrepancy.selection.scoring import PROMISING, WORTH, screen
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.identify.method import ALIKE, AS_IT_STANDS

FEW = PROMISING // 2  # effects that tell which way to take inputs
CONTENDER = 0.5  # of what the best gains, from which on it is worth making sure of a fit

Ranked = list[tuple[FittedCandidate, float]]
"""Candidates with the fall of BIC that each brings, less the price of looking at many; the best first."""
_Fitted = dict[type[Effect], FittedCandidate]


def ranked(
    search: Search, below: FittedCandidate, scored: Sequence[ScoredModel], effects: Sequence[type[Effect]]
) -> Ranked:
    """Fit effects over a model: the promising ones, and for a first one all where the best of these leaves structure.

    Parameters
    ----------
    search : Search
    below : FittedCandidate
        The model.
    scored : sequence of ScoredModel
        Where fits begin: that model, and others of the same effects.
    effects : sequence of type[Effect]

    Returns
    -------
    list of tuple of FittedCandidate and float
        All in the same noise.
    """
    starts = _starts(scored, effects)
    promising = _promising(starts)
    plain, nearest = _in_white_noise(search, below)
    seen: _Fitted = {}
    _glance(plain, nearest, {e: starts[e] for e in promising}, seen)
    found = _in_one_noise(search, below, nearest, seen, len(effects))
    others = {e: several for e, several in starts.items() if e not in promising}
    # a further cause is no small one, so that its score shows it
    if (
        others
        and not below.candidate.effects
        and not search.budget.spent()
        and has_structure(found[0][0] if found else below, search.data)
    ):
        _glance(plain, nearest, others, seen)
        found = _in_one_noise(search, below, nearest, seen, len(effects))
    return found


def few(scored: ScoredModel, effects: Sequence[type[Effect]]) -> list[type[Effect]]:
    """Return the few most promising effects."""
    return _promising(_starts([scored], effects))[:FEW]


def nearest_bic(search: Search, scored: ScoredModel, effects: Sequence[type[Effect]]) -> float:
    """Return the BIC, in white noise and after a few steps, of what comes nearest of a model and effects over it."""
    plain, nearest = _in_white_noise(search, scored.model)
    return min(f.fit.bic for f in (nearest, *_glanced(plain, nearest, _starts([scored], effects))))


def _starts(
    scored: Sequence[ScoredModel], effects: Sequence[type[Effect]]
) -> dict[type[Effect], list[ScreenedCandidate]]:
    """Where the fits of every effect begin, the most promising first."""
    starts: dict[type[Effect], list[ScreenedCandidate]] = {}
    for candidate in sorted((c for s in scored for c in screen(s, effects)), key=lambda c: -c.predicted.fall):
        starts.setdefault(candidate.effect, []).append(candidate)
    return starts


def _promising(starts: Mapping[type[Effect], Sequence[ScreenedCandidate]]) -> list[type[Effect]]:
    return [e for e, several in starts.items() if several[0].predicted.fall > WORTH][:PROMISING]


def _in_white_noise(search: Search, below: FittedCandidate) -> tuple[Search, FittedCandidate]:
    plain = search.in_white_noise()
    return plain, plain.fit_from(below.candidate, below)


def _glance(
    plain: Search, below: FittedCandidate, starts: Mapping[type[Effect], Sequence[ScreenedCandidate]], seen: _Fitted
) -> None:
    """Fit effects in white noise, a few steps of each and the best to the end, and put them into `seen`."""
    glanced = _glanced(plain, below, starts)
    to_the_end = replace(plain, method=ALIKE)
    best = sorted(glanced, key=_bic)[:PROMISING]
    ended = side_by_side(lambda f: _again(to_the_end, f), best)
    seen |= {f.effect: f for f in [*glanced, *filter(None, ended)]}


def _glanced(
    plain: Search, below: FittedCandidate, starts: Mapping[type[Effect], Sequence[ScreenedCandidate]]
) -> list[FittedCandidate]:
    """Fit effects in white noise, a few steps of each."""
    counter = Counter(plain.progress, "fitting effects", len(starts))

    def one(effect: type[Effect]) -> list[FittedCandidate]:
        if plain.budget.spent():
            plain.budget.leave([label(effect)])
            return []
        fitted = [_tried(plain, below, start) for start in starts[effect]]
        counter.one_more()
        return [f for f in fitted if f]

    return [min(several, key=_bic) for several in side_by_side(one, list(starts)) if several]


def _in_one_noise(search: Search, below: FittedCandidate, plain: FittedCandidate, seen: _Fitted, number: int) -> Ranked:
    """Hold candidates against each other in the noise of the nearest; what has a chance is made sure of."""
    if not seen:
        return []
    nearest = min(*seen.values(), plain, key=_bic)
    most = plain.fit.bic - nearest.fit.bic
    contenders = [e for e, f in seen.items() if plain.fit.bic - f.fit.bic > max(CONTENDER * most, WORTH)]
    counter = Counter(search.progress, "making sure of fits", len(contenders))
    alike = search.in_noise_of(nearest)
    as_they_are = replace(alike, method=AS_IT_STANDS)

    def sure(effect: type[Effect]) -> FittedCandidate | None:
        if effect not in contenders:
            return _again(as_they_are, seen[effect])
        fitted = _again(alike, seen[effect])
        counter.one_more()
        return fitted and alike.refine(fitted)

    base = alike.fit_from(below.candidate, below)
    made = filter(None, side_by_side(sure, list(seen)))
    return sorted(((f, f.delta_bic(base, number)) for f in made), key=lambda row: -row[1])


def _bic(fitted: FittedCandidate) -> float:
    return fitted.fit.bic


def _again(search: Search, fitted: FittedCandidate) -> FittedCandidate | None:
    """Fit a candidate from where it stands."""
    try:
        return search.fit_from(fitted.candidate, fitted)
    except FAILURES:
        return None


def _tried(search: Search, below: FittedCandidate, screened: ScreenedCandidate) -> FittedCandidate | None:
    try:
        return search.fit_extended(screened, below)
    except FAILURES as error:
        name = label(screened.effect)
        search.not_assessed[name] = Note(NoteCode.NOT_SIMULATED, name, {"reason": str(error)})
        return None
