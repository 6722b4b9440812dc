"""Ranking of effects that are fitted over a model, the best first.

A noise model of its own lets every candidate take for noise what it cannot simulate, and the
farther its simulation is from the record the more. So candidates are fitted by how near their
simulations come, in white noise, and the best of them then in one noise: that of the one that comes
nearest (as an F test takes the variance of the larger model).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fmus.kit import Effect
from fmus.kit.arrays import Array
from fmus.kit.symbolic import NAMELESS
from orchestration.discrepancy.candidates import (
    FittedCandidate,
    ScoredModel,
    ScreenedCandidate,
    label,
    own_parameters,
)
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import Counter, parallel_map
from orchestration.discrepancy.residuals import has_structure
from orchestration.discrepancy.selection.block_cross_validation import (
    Blocks,
    cv_errors,
    movement,
    predicts_better,
)
from orchestration.discrepancy.selection.equivalence import as_another, is_of_input
from orchestration.discrepancy.selection.scoring import COMPARABLE, PROMISING, WORTH, screen
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.identify.fitting import EVALUATE, FIXED_COLOUR, Method

FEW = PROMISING // 2  # effects by which hypotheses about inputs are judged
# By which BIC, less the price of looking, must fall for one more effect, whatever the noise: very
# strong evidence.
ACCEPT = 10.0
FINALISTS = 4  # candidates that are cross-validated in blocks, the nearest first,
LIKELIEST = 2  # and the likeliest in noise of their own
# of BIC, within which another candidate counts as not told apart, if one of the models is right
ALTERNATIVE = 6.0
AS_PROMISING = 0.5  # of the best fall that is expected of an effect, for a fit from elsewhere too
REFINED = 3  # contenders, the nearest first, that are fitted from beside their optima too
CONTENDER = 0.5  # of what the best gains, from which on it is worth making sure of a fit
# of the error in blocks left out, up to which it must fall for that alone to speak for an effect
NEARER = 0.9
OBVIOUS = 50.0  # fall of BIC that it must have beside
ABOUT = 0.98  # of the error there of another, from which on one comes about as near
# Of the gain of an effect whose memory starts anywhere, from which on one without is as good, where
# it decays all the time, as in a free response or one that is not much longer than its time
# constant: it follows any slow course, with two figures more.
WITHOUT_MEMORY = 0.9
# of the gain of an effect, by which another that answers any input alike may be less likely: no
# effect has quite the form of the truth, and some come nearer to it by a little
_AS_LIKELY = 0.1
# of the power of what an effect changes, in which another may differ that can be equivalent
_MUCH_ALIKE = 0.1
_SLOW = 1 / 3  # of the record: of a longer time constant it shows no more than a single decay
_STAGE = Method(passes=1, trials=25, restarts=0)  # of a fit to the end
_HOPED = 5.0  # times what a stage gained, which the next ones may gain

Fitted = Mapping[type[Effect], FittedCandidate]
_Fitted = dict[type[Effect], FittedCandidate]
Row = tuple[FittedCandidate, float]


@dataclass(frozen=True)
class Ranking:
    """Effects fitted over a model, in one noise.

    Attributes
    ----------
    rows : list of tuple of FittedCandidate and float
        Candidates with the fall of BIC that each brings, less the price of looking at many; the
        best first.
    cv_errors : dict of type[Effect] to ndarray, shape (blocks,)
        Where the nearest leaves structure, so that none of the models is right: errors in blocks
        that a candidate was not fitted to, of those that have a chance.
    base_cv_errors : ndarray, shape (blocks,)
        The same of the model without them.
    near : dict of type[Effect] to FittedCandidate
        Candidates fitted in white noise.
    free : bool
        Whether the record is a free response.
    equivalents : dict of type[Effect] to list of tuple of FittedCandidate and float
        Candidates that are one of the rows in other parameters, by the effect of that.
    """

    rows: list[Row] = field(default_factory=list)
    cv_errors: dict[type[Effect], Array] = field(default_factory=dict)
    base_cv_errors: Array = field(default_factory=lambda: np.empty(0))
    near: _Fitted = field(default_factory=dict)
    free: bool = False
    equivalents: dict[type[Effect], list[Row]] = field(default_factory=dict)

    def by_cv_error(self, rows: Sequence[Row]) -> list[Row]:
        """Return candidates by their errors in blocks left out, and the others behind."""
        errors = {effect: errors.sum() for effect, errors in self.cv_errors.items()}
        return sorted(rows, key=lambda row: errors.get(row[0].effect, np.inf))

    def is_admissible(self, row: Row) -> bool:
        """Return whether a candidate may be named, by its prediction errors where none is right."""
        if not self.cv_errors:
            return True
        candidate, _ = row
        errors = self.cv_errors.get(candidate.effect)
        return errors is not None and bool(errors.sum() < self.base_cv_errors.sum())

    def cv_significant(self, row: Row) -> bool:
        """Return whether a candidate predicts blocks significantly better than the base model."""
        candidate, _ = row
        errors = self.cv_errors.get(candidate.effect)
        return errors is not None and predicts_better(errors, self.base_cv_errors)

    def comes_nearer(self, row: Row) -> bool:
        """Return whether a candidate foretells blocks significantly better, and by more than a bit.

        What it comes nearer by is no noise, of whatever colour.
        """
        candidate, gain = row
        errors = self.cv_errors.get(candidate.effect)
        if errors is None or gain < OBVIOUS or not predicts_better(errors, self.base_cv_errors):
            return False
        return bool(np.mean(self.base_cv_errors - errors) > -2.0 * np.log(NEARER))

    def criterion(self, row: Row) -> float:
        """Return what tells shapes of one cause apart: errors in blocks left out, or else BIC."""
        candidate, gain = row
        if not self.cv_errors:
            return -gain
        errors = self.cv_errors.get(candidate.effect)
        return np.inf if errors is None else float(errors.sum())

    def is_behind(self, best: Row, other: Row) -> bool:
        """Return whether a candidate is worse than another by the criterion, and not as near."""
        if best[1] - other[1] < ALTERNATIVE:
            return False
        if not self.cv_errors:
            return True
        further = (self.criterion(other) - self.criterion(best)) / len(self.base_cv_errors)
        return further > -2.0 * np.log(NEARER)

    def follows_any_course(self, fitted: FittedCandidate) -> bool:
        """Return whether an effect follows any slow course, by a memory that starts anywhere."""
        if not _has_memory(fitted):
            return False
        return self.free or (bool(fitted.candidate.starts) and _is_slow(fitted))

    def indistinguishable(self, better: Row, other: Row) -> bool:
        """Return whether the record does not tell a candidate from one that comes before it."""
        better_candidate, better_gain = better
        other_candidate, other_gain = other
        if self.follows_any_course(better_candidate) and not _has_memory(other_candidate):
            return other_gain > max(WITHOUT_MEMORY * better_gain, ACCEPT)
        if not self.cv_errors:
            return better_gain - other_gain < ALTERNATIVE
        unknown = self.base_cv_errors + np.inf
        better_errors = self.cv_errors.get(better_candidate.effect, unknown)
        other_errors = self.cv_errors.get(other_candidate.effect, unknown)
        if not other_gain > ACCEPT:
            return False
        # where none is right, of two that come about as near either may be the nearer one
        about = float(np.mean(other_errors - better_errors)) < -2.0 * np.log(ABOUT)
        return about or not predicts_better(better_errors, other_errors)


def ranked(
    search: Search,
    below: FittedCandidate,
    scored: Sequence[ScoredModel],
    effects: Sequence[type[Effect]],
    known: Fitted | None = None,
    rough: Fitted | None = None,
) -> Ranking:
    """Fit promising effects over a model, and more where these leave structure, and rank them.

    Parameters
    ----------
    search : Search
    below : FittedCandidate
        The model.
    scored : sequence of ScoredModel
        That model, and others with the same effects, from which fits start.
    effects : sequence of type[Effect]
    known : Mapping of type[Effect] to FittedCandidate, optional
        Fitted in white noise from elsewhere.
    rough : Mapping of type[Effect] to FittedCandidate, optional
        Fitted in white noise from here, a few steps of each.
    """
    starts = _starts(scored, effects)
    promising = list(starts) if search.loses_step(below) else _promising(starts)
    near = _NearFits(search, below, known)
    near.fit({e: starts[e] for e in promising}, rough)
    others = _untried(starts, {*promising, *near.fits})
    if others and near.structured is not None:
        near.fit(others)
    if not near.fits:
        return Ranking()
    nearest = near.nearest
    contenders = near.contenders()
    merged = near.merge(contenders)
    contenders = [e for e in contenders if e not in merged]
    ranking = Ranking(near=near.fits, free=search.free)
    if near.structured is not None and contenders:
        contenders = near.finalists(contenders, merged)
        base_errors, errors = near.cross_validated(contenders, near.structured)
        nearest = near.fits[min(contenders, key=lambda e: errors[e].sum())]
        ranking = replace(ranking, cv_errors=errors, base_cv_errors=base_errors)
    rows = near.in_noise_of(nearest, contenders, len(effects))
    return _merged(replace(ranking, rows=ranking.by_cv_error(rows)), merged)


class _NearFits:
    """A model, and effects over it, fitted in white noise.

    Parameters
    ----------
    search : Search
    below : FittedCandidate
        The model, in noise of its own.
    known : Mapping of type[Effect] to FittedCandidate, optional
        Fitted from elsewhere.

    Attributes
    ----------
    base : FittedCandidate
        The model in white noise.
    fits : dict of type[Effect] to FittedCandidate
    structured : FittedCandidate or None
        The nearest in its own colour, if it leaves more than coloured noise.
    """

    def __init__(self, search: Search, below: FittedCandidate, known: Fitted | None = None):
        self._search = search
        self._below = below
        self._plain, self.base = _in_white_noise(search, below)
        self.fits: _Fitted = dict(known or {})
        self.structured: FittedCandidate | None = None

    @property
    def nearest(self) -> FittedCandidate:
        """The candidate whose simulation comes nearest to the record."""
        return min([self.base, *self.fits.values()], key=_bic)

    def fit(
        self,
        starts: Mapping[type[Effect], Sequence[ScreenedCandidate]],
        rough: Fitted | None = None,
    ) -> None:
        """Fit effects: a few steps of each, the best to the end.

        Fits in `rough` have taken their few steps.
        """
        begun = dict(rough or {})
        new = {effect: several for effect, several in starts.items() if effect not in begun}
        screened = [*begun.values(), *_screened(self._plain, self.base, new)]
        best = sorted(screened, key=_bic)[:PROMISING]
        for fitted in (*screened, *_ended(self._plain, self.base, best, self.nearest)):
            before = self.fits.get(fitted.effect, fitted)
            self.fits[fitted.effect] = min(fitted, before, key=_bic)
        self.structured = _structured(self._search, self.nearest)

    def contenders(self) -> list[type[Effect]]:
        """Return the effects that gain enough for their fits to be made sure of."""
        base = self.base.fit.bic
        threshold = max(CONTENDER * (base - self.nearest.fit.bic), WORTH)
        return [e for e, fitted in self.fits.items() if base - fitted.fit.bic > threshold]

    def merge(self, contenders: Sequence[type[Effect]]) -> dict[type[Effect], type[Effect]]:
        """Return the contenders that are another one in other parameters, and that one.

        Of several it is the one that fits best of those that are most to be expected. It is fitted
        on from where it does what the best of them does, and then may be less likely by a share of
        what that gains: by any where none of the models is right, for there a likelihood tells
        nothing.
        """
        standing: list[type[Effect]] = []
        merged: dict[type[Effect], type[Effect]] = {}
        for effect in sorted(contenders, key=lambda e: (*_expectation(e), _bic(self.fits[e]))):
            for other in standing:
                # a sensor is another thing than the plant: it can be tested by itself
                if other.output != effect.output:
                    continue
                nearer = self._in_other_parameters(self.fits[other], self.fits[effect])
                if nearer is not None:
                    self.fits[other] = nearer
                    merged[effect] = other
                    break
            else:
                standing.append(effect)
        return merged

    def _in_other_parameters(
        self, one: FittedCandidate, other: FittedCandidate
    ) -> FittedCandidate | None:
        """Return a candidate that is equivalent to another, and fits about as well as that.

        None where it does not.
        """
        if not _run_alike(self.base, one, other):
            return None
        values = as_another(self._plain, one, other, self.base)
        if values is None:
            return None
        if one.fit.bic > other.fit.bic:
            again = self._plain.fit_with(one.candidate.effects, one, one.fit.values | values)
            one = min(filter(None, (one, again)), key=_bic)
        share = _AS_LIKELY if self.structured is None else np.inf
        tolerance = max(ALTERNATIVE, share * (self.base.fit.bic - other.fit.bic))
        return one if one.fit.bic <= other.fit.bic + tolerance else None

    def finalists(
        self, contenders: Sequence[type[Effect]], merged: Collection[type[Effect]]
    ) -> list[type[Effect]]:
        """Return the effects that are cross-validated: the nearest, and the likeliest."""
        finalists = sorted(contenders, key=lambda e: self.fits[e].fit.bic)[:FINALISTS]
        others = {e: fitted for e, fitted in self.fits.items() if e not in merged}
        likeliest = _likeliest(self._search, others)[:LIKELIEST]
        return finalists + [e for e in likeliest if e not in finalists]

    def cross_validated(
        self, effects: Sequence[type[Effect]], structured: FittedCandidate
    ) -> tuple[Array, dict[type[Effect], Array]]:
        """Return the errors of the model and of effects in blocks left out, in turn.

        Parameters
        ----------
        effects : sequence of type[Effect]
        structured : FittedCandidate
            In whose noise the errors are.
        """
        plain = self._plain
        candidates = [self.base, *(self.fits[e] for e in effects)]
        blocks = Blocks.of(plain.data, bool(plain.each), movement(self.base))
        counter = Counter(plain.progress, "foretelling blocks left out", len(candidates))

        def errors_of(fitted: FittedCandidate) -> Array:
            errors = cv_errors(plain, fitted, blocks, structured)
            counter.one_more()
            return errors

        base_errors, *errors = parallel_map(errors_of, candidates)
        return base_errors, dict(zip(effects, errors, strict=True))

    def in_noise_of(
        self, nearest: FittedCandidate, contenders: Sequence[type[Effect]], number: int
    ) -> list[Row]:
        """Compare candidates in the noise of the nearest; fits of contenders are made sure of.

        Parameters
        ----------
        nearest : FittedCandidate
        contenders : sequence of type[Effect]
        number : int
            Effects that were looked at, which is the price of each.
        """
        counter = Counter(self._search.progress, "making sure of fits", len(contenders))
        surest = sorted(contenders, key=lambda e: self.fits[e].fit.bic)[:REFINED]
        in_one_noise = self._search.in_noise_of(nearest)
        as_they_are = replace(in_one_noise, method=EVALUATE)

        def fit_effect(effect: type[Effect]) -> FittedCandidate | None:
            if effect not in contenders:
                return _again(as_they_are, self.fits[effect])
            fitted = _again(in_one_noise, self.fits[effect])
            counter.one_more()
            return in_one_noise.refine(fitted) if fitted and effect in surest else fitted

        base = in_one_noise.fit_from(self._below.candidate, self._below)
        fitted_effects = filter(None, parallel_map(fit_effect, list(self.fits)))
        candidates = [as_they_are.containing(fitted, base) for fitted in fitted_effects]
        rows = [(candidate, candidate.delta_bic(base, number)) for candidate in candidates]
        return sorted(rows, key=lambda row: -row[1])


def _expectation(effect: type[Effect]) -> tuple[bool, bool]:
    """Return a key that sorts effects by how much they are to be expected.

    A law comes before an input, and what has a name in its field before what has none.
    """
    return is_of_input(effect), effect.id in NAMELESS


def _run_alike(base: FittedCandidate, one: FittedCandidate, other: FittedCandidate) -> bool:
    """Return whether two candidates change the simulation of a record in about the same way."""

    def power(first: FittedCandidate, second: FittedCandidate) -> float:
        pairs = ((e, second.fit.residual[o], o) for o, e in first.fit.residual.items())
        return sum(
            float(np.sum((a - b) ** 2)) / other.fit.noise[o].deviation ** 2 for a, b, o in pairs
        )

    return power(one, other) < _MUCH_ALIKE * power(base, other)


def _merged(ranking: Ranking, merged: Mapping[type[Effect], type[Effect]]) -> Ranking:
    """Return a ranking in which candidates that are another one in other parameters are apart."""
    equivalents: dict[type[Effect], list[Row]] = {}
    for row in ranking.rows:
        if row[0].effect in merged:
            equivalents.setdefault(merged[row[0].effect], []).append(row)
    rows = [row for row in ranking.rows if row[0].effect not in merged]
    return replace(ranking, rows=rows, equivalents=equivalents)


def _structured(search: Search, nearest: FittedCandidate) -> FittedCandidate | None:
    """Return the nearest candidate in its own colour; None if it leaves but coloured noise."""
    if search.budget.spent():
        return None
    coloured = _again(search.in_noise_of(nearest), nearest)
    if coloured is None or not has_structure(coloured, search.data):
        return None
    return coloured


def _likeliest(search: Search, seen: _Fitted) -> list[type[Effect]]:
    """Return effects by the likelihood of each as it stands, in noise of its own.

    In white noise slow errors may outweigh what is sought.
    """
    as_they_are = replace(search, method=EVALUATE)

    def bic(fitted: FittedCandidate) -> float:
        own = _again(as_they_are, fitted)
        return own.fit.bic if own else np.inf

    criteria = dict(zip(seen, parallel_map(bic, list(seen.values())), strict=True))
    return sorted(criteria, key=lambda e: criteria[e])


def few(scored: ScoredModel, effects: Sequence[type[Effect]]) -> list[type[Effect]]:
    """Return the few most promising effects."""
    return _promising(_starts([scored], effects))[:FEW]


def nearest(
    search: Search, scored: ScoredModel, effects: Sequence[type[Effect]]
) -> tuple[float, _Fitted]:
    """Fit a model and effects over it in white noise, a few steps of each.

    Returns
    -------
    bic : float
        The least of any.
    fitted : dict of type[Effect] to FittedCandidate
    """
    plain, base = _in_white_noise(search, scored.model)
    fitted = {f.effect: f for f in _screened(plain, base, _starts([scored], effects))}
    return min(f.fit.bic for f in (base, *fitted.values())), fitted


def _starts(
    scored: Sequence[ScoredModel], effects: Sequence[type[Effect]]
) -> dict[type[Effect], list[ScreenedCandidate]]:
    """Return the starts of the fits of every effect, the most promising first."""
    candidates = [candidate for model in scored for candidate in screen(model, effects)]
    starts: dict[type[Effect], list[ScreenedCandidate]] = {}
    for candidate in sorted(candidates, key=lambda c: -c.predicted.beyond):
        starts.setdefault(candidate.effect, []).append(candidate)
    return starts


def _promising(starts: Mapping[type[Effect], Sequence[ScreenedCandidate]]) -> list[type[Effect]]:
    best = max((several[0].predicted.beyond for several in starts.values()), default=0.0)
    worth = max(WORTH, COMPARABLE * best)
    return [e for e, several in starts.items() if several[0].predicted.beyond > worth][:PROMISING]


def _untried(
    starts: Mapping[type[Effect], list[ScreenedCandidate]], tried: Collection[type[Effect]]
) -> dict[type[Effect], list[ScreenedCandidate]]:
    """Return the most promising effects of those that were not tried, with their starts."""
    others = [effect for effect in starts if effect not in tried]
    return {effect: starts[effect] for effect in others[:PROMISING]}


def _in_white_noise(search: Search, below: FittedCandidate) -> tuple[Search, FittedCandidate]:
    plain = search.in_white_noise()
    return plain, plain.fit_from(below.candidate, below)


def _ended(
    plain: Search,
    below: FittedCandidate,
    begun: Sequence[FittedCandidate],
    known: FittedCandidate,
) -> list[FittedCandidate]:
    """Fit candidates on, in stages, to the end, or to where they can be no contenders.

    Parameters
    ----------
    plain : Search
        In white noise.
    below : FittedCandidate
        The model without their effects.
    begun : sequence of FittedCandidate
        After their first steps.
    known : FittedCandidate
        The best of others.

    Returns
    -------
    list of FittedCandidate
        Where each ended; contenders once more, in as many passes as their noise takes.
    """
    stage = replace(plain, method=_STAGE)
    ended: list[FittedCandidate] = []
    running = list(begun)
    contends = below.fit.bic
    while running:
        further = parallel_map(lambda f: _again(stage, f), running)
        pairs = [(before, after) for before, after in zip(running, further, strict=True) if after]
        least = min(map(_bic, [known, *ended, *(after for _, after in pairs)]))
        contends = below.fit.bic - CONTENDER * (below.fit.bic - least)
        running = []
        for before, after in pairs:
            gained = before.fit.bic - after.fit.bic
            is_hopeful = after.fit.bic - _HOPED * gained < contends
            moves = gained > _STAGE.settled and not after.fit.converged
            (running if is_hopeful and moves else ended).append(after)
    to_the_end = replace(plain, method=FIXED_COLOUR)
    sure = parallel_map(lambda f: _again(to_the_end, f), [f for f in ended if _bic(f) <= contends])
    return [*ended, *filter(None, sure)]


def _screened(
    plain: Search,
    below: FittedCandidate,
    starts: Mapping[type[Effect], Sequence[ScreenedCandidate]],
) -> list[FittedCandidate]:
    """Fit effects in white noise, a few steps of each."""
    counter = Counter(plain.progress, "fitting effects", len(starts))

    def fit_effect(effect: type[Effect]) -> list[FittedCandidate]:
        if plain.budget.spent():
            plain.budget.leave([label(effect)])
            return []
        first, *others = starts[effect]
        least = AS_PROMISING * first.predicted.beyond
        worth = [first, *(start for start in others if start.predicted.beyond >= least)]
        fitted = [_tried(plain, below, start) for start in worth]
        counter.one_more()
        return [f for f in fitted if f]

    fits = parallel_map(fit_effect, list(starts))
    return [min(several, key=_bic) for several in fits if several]


def _has_memory(fitted: FittedCandidate) -> bool:
    """Return whether the last effect of a candidate has a state of its own."""
    return bool(fitted.effect.layout.states)


def _is_slow(fitted: FittedCandidate) -> bool:
    """Return whether the last effect of a candidate takes about the record to decay."""
    longest = fitted.problem.largest
    constants = [name for name in own_parameters(fitted.effect) if name in longest]
    return any(fitted.fit.values[name] > _SLOW * longest[name] for name in constants)


def _bic(fitted: FittedCandidate) -> float:
    return fitted.fit.bic


def _again(search: Search, fitted: FittedCandidate) -> FittedCandidate | None:
    """Fit a candidate from where it stands; return None where that fails."""
    try:
        return search.fit_from(fitted.candidate, fitted)
    except FAILURES:
        return None


def _tried(
    search: Search, below: FittedCandidate, screened: ScreenedCandidate
) -> FittedCandidate | None:
    """Fit a screened candidate; note why, and return None, where that fails."""
    try:
        return search.fit_extended(screened, below)
    except FAILURES as error:
        name = label(screened.effect)
        search.not_assessed[name] = Note(NoteCode.NOT_SIMULATED, name, {"reason": str(error)})
        return None
