"""Effects fitted over a model, the best first.

A noise model of its own lets every candidate take for noise what it cannot simulate, and the farther its simulation is
from the record the more. So candidates are fitted by how near their simulations come, in white noise, and the best of
them then in one noise: that of the one that comes nearest (as an F test takes the variance of the larger model).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Effect
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.candidates.evidence import (
    FittedCandidate,
    ScoredModel,
    ScreenedCandidate,
)
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import Counter, side_by_side
from orchestration.discrepancy.residuals.analysis import has_structure
from orchestration.discrepancy.selection.left_out import Blocks, foretells_better, foretold
from orchestration.discrepancy.selection.scoring import PROMISING, WORTH, screen
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.identify.method import ALIKE, AS_IT_STANDS

FEW = PROMISING // 2  # effects that tell which way to take inputs
# By which BIC, less the price of looking, must fall for one more effect, whatever the noise: very strong evidence.
ACCEPT = 10.0
FINALISTS = 5  # candidates that foretell blocks left out, the nearest first,
LIKELIEST = 3  # and the likeliest in noise of their own
ALTERNATIVE = (
    6.0  # within which another candidate counts as not told apart, if one of the models is right
)
CONTENDER = 0.5  # of what the best gains, from which on it is worth making sure of a fit

Array = NDArray[np.float64]
_Fitted = dict[type[Effect], FittedCandidate]
Row = tuple[FittedCandidate, float]


@dataclass(frozen=True)
class Ranking:
    """Effects fitted over a model, in one noise.

    Attributes
    ----------
    rows : list of tuple of FittedCandidate and float
        Candidates with the fall of BIC that each brings, less the price of looking at many; the best first.
    foretold : dict of type[Effect] to ndarray, shape (blocks,)
        Where the nearest leaves structure, so that none of the models is right: errors in blocks that a candidate was
        not fitted to, of those that have a chance.
    without : ndarray, shape (blocks,)
        The same of the model without them.
    near : dict of type[Effect] to FittedCandidate
        Candidates fitted in white noise.
    """

    rows: list[Row] = field(default_factory=list)
    foretold: dict[type[Effect], Array] = field(default_factory=dict)
    without: Array = field(default_factory=lambda: np.empty(0))
    near: _Fitted = field(default_factory=dict)

    def may_be(self, row: Row) -> bool:
        """Whether a candidate may be named: where none is right, it foretells more than the model without it."""
        effect = row[0].effect
        return not self.foretold or (
            effect in self.foretold and self.foretold[effect].sum() < self.without.sum()
        )

    def surely_foretells(self, row: Row) -> bool:
        """Whether blocks agree that a candidate foretells more than the model without it."""
        effect = row[0].effect
        return effect in self.foretold and foretells_better(self.foretold[effect], self.without)

    def are_alike(self, better: Row, other: Row) -> bool:
        """Whether the record does not tell a candidate from one that comes before it."""
        if not self.foretold:
            return better[1] - other[1] < ALTERNATIVE
        one, two = (
            self.foretold.get(fitted.effect, self.without + np.inf) for fitted, _ in (better, other)
        )
        return other[1] > ACCEPT and not foretells_better(one, two)


def ranked(
    search: Search,
    below: FittedCandidate,
    scored: Sequence[ScoredModel],
    effects: Sequence[type[Effect]],
    known: Mapping[type[Effect], FittedCandidate] | None = None,
) -> Ranking:
    """Fit effects over a model: the promising ones, and for a first one all where the best of these leaves structure.

    Parameters
    ----------
    search : Search
    below : FittedCandidate
        The model.
    scored : sequence of ScoredModel
        Where fits begin: that model, and others of the same effects.
    effects : sequence of type[Effect]
    known : Mapping of type[Effect] to FittedCandidate, optional
        Fitted in white noise from elsewhere.
    """
    starts = _starts(scored, effects)
    promising = _promising(starts)
    plain, base = _in_white_noise(search, below)
    seen: _Fitted = dict(known or {})
    _glance(plain, base, {e: starts[e] for e in promising}, seen)
    others = {e: several for e, several in starts.items() if e not in promising}
    nearest, left = _nearest(search, base, seen)
    # a further cause is no small one, so that its score shows it
    if others and left and not below.candidate.effects:
        _glance(plain, base, others, seen)
        nearest, left = _nearest(search, base, seen)
    if not seen:
        return Ranking()
    most = base.fit.bic - nearest.fit.bic
    contenders = [
        e for e, f in seen.items() if base.fit.bic - f.fit.bic > max(CONTENDER * most, WORTH)
    ]
    if not (left and contenders):
        rows = _in_one_noise(search, below, nearest, seen, contenders, len(effects))
        return Ranking(rows, near=seen)
    contenders = sorted(contenders, key=lambda e: seen[e].fit.bic)[:FINALISTS]
    contenders += [e for e in _likeliest(search, seen)[:LIKELIEST] if e not in contenders]
    without, *foretellings = _foretold(plain, [base, *(seen[e] for e in contenders)], left)
    errors = dict(zip(contenders, foretellings, strict=True))
    best = min(contenders, key=lambda e: errors[e].sum())
    rows = _in_one_noise(search, below, seen[best], seen, contenders, len(effects))
    rows.sort(key=lambda row: errors[row[0].effect].sum() if row[0].effect in errors else np.inf)
    return Ranking(rows, errors, without, seen)


def _nearest(
    search: Search, base: FittedCandidate, seen: _Fitted
) -> tuple[FittedCandidate, FittedCandidate | None]:
    """What comes nearest in white noise; and the same in its own colour, if it leaves more than coloured noise."""
    nearest = min([base, *seen.values()], key=_bic)
    fitted = None if search.budget.spent() else _again(search.in_noise_of(nearest), nearest)
    return nearest, fitted if fitted and has_structure(fitted, search.data) else None


def _likeliest(search: Search, seen: _Fitted) -> list[type[Effect]]:
    """Effects by how likely each is where it stands, in noise of its own: slow errors may outweigh what is sought."""
    as_they_are = replace(search, method=AS_IT_STANDS)

    def bic(fitted: FittedCandidate) -> float:
        own = _again(as_they_are, fitted)
        return own.fit.bic if own else np.inf

    found = dict(zip(seen, side_by_side(bic, list(seen.values())), strict=True))
    return sorted(found, key=lambda e: found[e])


def _foretold(
    plain: Search, candidates: Sequence[FittedCandidate], nearest: FittedCandidate
) -> list[Array]:
    """Errors of candidates in blocks left out."""
    blocks = Blocks.of(plain.data, bool(plain.each))
    counter = Counter(plain.progress, "foretelling blocks left out", len(candidates))

    def one(fitted: FittedCandidate) -> Array:
        errors = foretold(plain, fitted, blocks, nearest)
        counter.one_more()
        return errors

    return side_by_side(one, candidates)


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
    for candidate in sorted(
        (c for s in scored for c in screen(s, effects)), key=lambda c: -c.predicted.fall
    ):
        starts.setdefault(candidate.effect, []).append(candidate)
    return starts


def _promising(starts: Mapping[type[Effect], Sequence[ScreenedCandidate]]) -> list[type[Effect]]:
    return [e for e, several in starts.items() if several[0].predicted.fall > WORTH][:PROMISING]


def _in_white_noise(search: Search, below: FittedCandidate) -> tuple[Search, FittedCandidate]:
    plain = search.in_white_noise()
    return plain, plain.fit_from(below.candidate, below)


def _glance(
    plain: Search,
    below: FittedCandidate,
    starts: Mapping[type[Effect], Sequence[ScreenedCandidate]],
    seen: _Fitted,
) -> None:
    """Fit effects in white noise, a few steps of each and the best to the end, and put them into `seen`."""
    glanced = _glanced(plain, below, starts)
    to_the_end = replace(plain, method=ALIKE)
    best = sorted(glanced, key=_bic)[:PROMISING]
    ended = side_by_side(lambda f: _again(to_the_end, f), best)
    for fitted in (*glanced, *filter(None, ended)):
        seen[fitted.effect] = min(fitted, seen.get(fitted.effect, fitted), key=_bic)


def _glanced(
    plain: Search,
    below: FittedCandidate,
    starts: Mapping[type[Effect], Sequence[ScreenedCandidate]],
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


def _in_one_noise(
    search: Search,
    below: FittedCandidate,
    nearest: FittedCandidate,
    seen: _Fitted,
    contenders: Sequence[type[Effect]],
    number: int,
) -> list[Row]:
    """Hold candidates against each other in the noise of the nearest; what has a chance is made sure of."""
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


def _tried(
    search: Search, below: FittedCandidate, screened: ScreenedCandidate
) -> FittedCandidate | None:
    try:
        return search.fit_extended(screened, below)
    except FAILURES as error:
        name = label(screened.effect)
        search.not_assessed[name] = Note(NoteCode.NOT_SIMULATED, name, {"reason": str(error)})
        return None
