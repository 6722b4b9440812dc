"""Forward selection: one effect after another while the evidence asks for more, with the alternatives to each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fmus.kit import Effect
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.candidates.evidence import FittedCandidate, ScoredModel, ScreenedCandidate
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import Counter, side_by_side
from orchestration.discrepancy.selection.scoring import confounding, score, screen, unidentifiable
from orchestration.discrepancy.selection.search import FAILURES, Search

# By which BIC, less the price of looking, must fall for one more effect, whatever the noise: very strong evidence.
ACCEPT = 10.0
ALTERNATIVE = 6.0  # within which another candidate counts as not told apart
NEGLIGIBLE = 0.01  # of what the first effect gained: less is its true shape, which is never quite that of the catalogue
SECONDARY = 0.2  # of the evidence for the first effect, below which another is a lesser matter
MOST = 3  # effects that are looked for
AT_ONCE = 2
CONTENDER = 0.5  # of what the best gains, from which on it is worth making sure of a fit
DOMINATED = 0.2  # of what another has gained already
# A model left free may bend its parameters out of all reason to follow what it has no word for, and what an effect
# would add to that tells little. Where one held this close to nominal (in the logarithm) is this much less likely,
# effects are looked at from both.
NEAR_NOMINAL = 0.1
OVERFITTED = 50.0


@dataclass(frozen=True)
class Step:
    """One effect named.

    Attributes
    ----------
    chosen : FittedCandidate
    gain : float
        Fall of BIC against the step before, less the price of looking at many.
    p_value : float
        Corrected for their number.
    alternatives : list of FittedCandidate
        Candidates that cannot be told apart from it, the best first.
    rejected : list of tuple of FittedCandidate and float
        Others that were fitted, with their gain.
    confounding : dict of str to float
        Share of what it does that other effects do too, by their label.
    gains : dict of str to float
        That of every candidate, by its label; the fits may be made anew since.
    """

    chosen: FittedCandidate
    gain: float
    p_value: float
    alternatives: list[FittedCandidate]
    rejected: list[tuple[FittedCandidate, float]]
    confounding: dict[str, float] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Selection:
    """Effects selected, and what was tried beside them.

    Attributes
    ----------
    base : FittedCandidate
        The model without effects, refitted.
    steps : list of Step
    rejected : list of tuple of FittedCandidate and float
        Candidates of the last step, which named nothing more, with their gain.
    tried : int
        Effects in the catalogue.
    unsure : set of str
        Labels of effects whose evidence would do, were noise of the level and the colour that a likelihood takes it to
        be.
    """

    base: FittedCandidate
    steps: list[Step] = field(default_factory=list)
    rejected: list[tuple[FittedCandidate, float]] = field(default_factory=list)
    tried: int = 0
    unsure: set[str] = field(default_factory=set)

    @property
    def strong(self) -> list[Step]:
        """Steps for which there is not much less evidence than for the first."""
        return [step for step in self.steps if step.gain >= SECONDARY * self.steps[0].gain]

    def ending_in(self, best: FittedCandidate) -> Selection:
        """The same, its best model fitted anew."""
        if not self.steps:
            return replace(self, base=best)
        return replace(self, steps=[*self.steps[:-1], replace(self.steps[-1], chosen=best)])

    @property
    def best(self) -> FittedCandidate:
        """The model with every effect that was named."""
        return self.steps[-1].chosen if self.steps else self.base


def select(search: Search, effects: Sequence[type[Effect]], base: FittedCandidate | None = None) -> Selection:
    """Look for effects, one at a time.

    Parameters
    ----------
    search : Search
    effects : sequence of type[Effect]
        The catalogue.
    base : FittedCandidate, optional
        The model without effects, if it is fitted already.

    Returns
    -------
    Selection
    """
    base = base or search.nominal()
    near = base if search.budget.spent() else search.near_nominal(NEAR_NOMINAL)
    overfitted = near.fit.deviance - base.fit.deviance > OVERFITTED
    scored = [score(search, model, effects) for model in ([base, near] if overfitted else [base])]
    silent = unidentifiable(scored[0])
    search.not_assessed |= silent
    selection = Selection(base, tried=len(effects))
    remaining = [effect for effect in effects if label(effect) not in silent]
    while remaining and len(selection.steps) < MOST:
        if search.budget.spent():
            search.budget.leave(map(label, remaining))
            break
        below = selection.best
        ranked = _fitted(search, below, scored, remaining)
        threshold = max(ACCEPT, NEGLIGIBLE * selection.steps[0].gain if selection.steps else 0.0)
        if ranked and ranked[0][1] > threshold:
            below, before = search.nested(below, ranked[0][0]), below
            ranked = [(fitted, gain - (before.fit.bic - below.fit.bic)) for fitted, gain in ranked]
            selection = selection.ending_in(below)
        beyond = [(e, g) for e, g in ranked if g > threshold]
        sure = [(e, g) for e, g in beyond if e.robust_fall(below, len(remaining)) > ACCEPT]
        selection.unsure.update({e.effect_name for e, _ in beyond} - {e.effect_name for e, _ in sure})
        if not sure:
            selection.rejected.extend(ranked)
            break
        chosen, gain = sure[0]
        effect = chosen.effect
        others = [row for row in ranked if row[0] is not chosen and not _interchangeable(row[0].effect, effect)]
        close = {e.effect_name for e, g in sure if gain - g < ALTERNATIVE}
        alternatives = [e for e, _ in others if e.effect_name in close]
        rejected = [(e, g) for e, g in others if e.effect_name not in close]
        named = {label(effect) for effect in chosen.candidate.effects}
        remaining = [effect for effect in remaining if label(effect) not in named]
        able = [model for model in scored if model.directions.get(effect, (None, []))[1]]
        nearest = min(able, key=lambda model: _distance(model.model, chosen))
        shares = confounding(nearest, effect, [other for other in remaining if not _interchangeable(other, effect)])
        p_value = chosen.p_value(below, selection.tried)
        chosen, gains = search.renewed(chosen), {e.effect_name: g for e, g in ranked}
        selection.steps.append(Step(chosen, gain, p_value, alternatives, rejected, shares, gains))
        scored = [ScoredModel(chosen, nearest.directions)]
    for fitted, _ in [*((s.chosen, s.gain) for s in selection.steps), *selection.rejected]:
        search.not_assessed.pop(fitted.effect_name, None)  # from elsewhere it could be fitted
    # what was named beside another is no alternative to it
    named = {label(effect) for effect in selection.best.candidate.effects}
    steps = [
        replace(s, alternatives=[e for e in s.alternatives if e.effect_name not in named]) for s in selection.steps
    ]
    return replace(selection, steps=steps)


def _interchangeable(one: type[Effect], other: type[Effect]) -> bool:
    """Whether they are one cause in two shapes, such as the second and the third element of a chain."""
    return one is other or (bool(one.term.family) and one.term.family == other.term.family)


def _distance(one: FittedCandidate, other: FittedCandidate) -> float:
    """How far apart two models are in the parameters that both have."""
    shared = [n for n in one.problem.names if n in other.problem.names]  # in order: a sum must not hang on hashes
    pairs = [(e.fit.q[e.problem.names.index(n)] for e in (one, other)) for n in shared]
    return float(sum((a - b) ** 2 for a, b in pairs))


def _fitted(
    search: Search, below: FittedCandidate, scored: Sequence[ScoredModel], effects: Sequence[type[Effect]]
) -> list[tuple[FittedCandidate, float]]:
    """Promising effects over a model, fitted from every model that was scored, the best first."""
    best: dict[type[Effect], FittedCandidate] = {}
    for origin in scored:
        _fit_promising(search, below, origin, effects, best)
    gains = {effect: below.fit.bic - e.fit.bic for effect, e in best.items()}
    contenders = [effect for effect, gain in gains.items() if gain > CONTENDER * max(0.0, *gains.values())]
    counter = Counter(search.progress, "making sure of fits", len(contenders))

    def sure(effect: type[Effect]) -> FittedCandidate:
        refined = search.refine(best[effect])
        counter.one_more()
        return refined

    best |= zip(contenders, side_by_side(sure, contenders), strict=True)
    return sorted(((e, e.delta_bic(below, len(effects))) for e in best.values()), key=lambda row: -row[1])


def _fit_promising(
    search: Search, below: FittedCandidate, origin: ScoredModel, effects: Sequence[type[Effect]],
    best: dict[type[Effect], FittedCandidate],
) -> None:  # fmt: skip
    """Fit what may be worth it, beginning with one of the models that were scored; put into `best` what is better."""
    candidates = screen(origin, effects)
    counter = Counter(search.progress, "fitting effects", len(candidates))

    def tried(candidate: ScreenedCandidate) -> FittedCandidate | None:
        fitted = _tried(search, below, candidate)
        counter.one_more()
        return fitted

    while candidates:
        if search.budget.spent():
            search.budget.leave(label(c.effect) for c in candidates if c.effect not in best)
            return
        # what the best of them gains tells which of the others still has a chance
        batch, candidates = candidates[:AT_ONCE], candidates[AT_ONCE:]
        for fitted in filter(None, side_by_side(tried, batch)):
            effect = fitted.effect
            best[effect] = min(best.get(effect, fitted), fitted, key=lambda e: e.fit.bic)
        gained = max((origin.model.fit.deviance - e.fit.deviance for e in best.values()), default=0.0)
        candidates = [c for c in candidates if c.predicted.fall > DOMINATED * gained]


def _tried(search: Search, below: FittedCandidate, screened: ScreenedCandidate) -> FittedCandidate | None:
    try:
        fitted = search.fit_extended(screened)
        if fitted.fit.deviance > below.fit.deviance:  # it contains that model, so the search was lost
            at_rest = screened.predicted.without_step()
            fitted = search.fit_extended(replace(screened, below=below, predicted=at_rest))
    except FAILURES as error:
        name = label(screened.effect)
        search.not_assessed[name] = Note(NoteCode.NOT_SIMULATED, name, {"reason": str(error)})
        return None
    return fitted
