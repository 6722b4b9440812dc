"""Forward selection: one effect after another while the evidence asks for more, with the alternatives to each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fmus.kit import Effect
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.candidates.evidence import FittedCandidate, ScoredModel
from orchestration.discrepancy.residuals.innovations import power
from orchestration.discrepancy.selection.ranking import ACCEPT, ALTERNATIVE, Ranking, Row, ranked
from orchestration.discrepancy.selection.scoring import confounding, score, unidentifiable
from orchestration.discrepancy.selection.search import FAILURES, Search

NEGLIGIBLE = 0.01  # of what the first effect gained: less is its true shape, which is never quite that of the catalogue
SECONDARY = 0.2  # of the evidence for the first effect, below which another is a lesser matter
MOST = 3  # effects that are looked for
CHANCES = 6  # candidates that are fitted in noise of their own, the best first, until one is sure
EXPLAINED = 0.1  # of the error of the base beyond noise
SHORT = 5.0  # memory that is none: the variance of noise over that of its innovations
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
        Fall of BIC against the step before, less the price of looking at many, both in the noise of the best candidate.
    evidence : float
        The same, each in the noise that is likeliest for it.
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
    evidence: float
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
        return [step for step in self.steps if step.evidence >= SECONDARY * self.steps[0].evidence]

    def ending_in(self, best: FittedCandidate) -> Selection:
        """The same, its best model fitted anew."""
        if not self.steps:
            return replace(self, base=best)
        return replace(self, steps=[*self.steps[:-1], replace(self.steps[-1], chosen=best)])

    @property
    def best(self) -> FittedCandidate:
        """The model with every effect that was named."""
        return self.steps[-1].chosen if self.steps else self.base


def select(
    search: Search, effects: Sequence[type[Effect]], known: ScoredModel | None = None
) -> Selection:
    """Look for effects, one at a time.

    Parameters
    ----------
    search : Search
    effects : sequence of type[Effect]
        The catalogue.
    known : ScoredModel, optional
        The model without effects, if it is known where effects would move it.

    Returns
    -------
    Selection
    """
    known = known or score(search, search.nominal(), effects)
    base = known.model
    near = base if search.budget.spent() else search.near_nominal(NEAR_NOMINAL)
    overfitted = near.fit.deviance - base.fit.deviance > OVERFITTED
    scored = [known, *([score(search, near, effects)] if overfitted else [])]
    silent = unidentifiable(scored[0])
    search.not_assessed |= silent
    selection = Selection(base, tried=len(effects))
    remaining = [effect for effect in effects if label(effect) not in silent]
    while remaining and len(selection.steps) < MOST:
        if search.budget.spent():
            search.budget.leave(map(label, remaining))
            break
        tried = ranked(search, selection.best, scored, remaining)
        found = _named(search, selection, tried, len(remaining))
        lowered = selection.best.fit.bic - found.below.fit.bic
        if found.below is not selection.best:
            selection = selection.ending_in(found.below)
        if found.step and lowered > ALTERNATIVE:  # all were fitted from a lesser optimum
            scored.append(score(search, found.below, remaining))
            tried = ranked(search, found.below, scored[-1:], remaining, tried.near)
            again = _named(search, selection, tried, len(remaining))
            found = found if search.budget.spent() else again
        selection.unsure.update(found.unsure)
        if found.step is None:
            selection.rejected.extend(found.tried.rows)
            break
        step = found.step
        named = {label(effect) for effect in step.chosen.candidate.effects}
        remaining = [effect for effect in remaining if label(effect) not in named]
        nearest = _nearest(scored, step.chosen)
        others = [other for other in remaining if not interchangeable(other, step.chosen.effect)]
        shares = confounding(nearest, step.chosen.effect, others)
        step = replace(step, chosen=search.renewed(step.chosen), confounding=shares)
        selection.steps.append(step)
        scored = [ScoredModel(step.chosen, nearest.directions)]
    for fitted, _ in [*((s.chosen, s.gain) for s in selection.steps), *selection.rejected]:
        search.not_assessed.pop(fitted.effect_name, None)  # from elsewhere it could be fitted
    # what was named beside another is no alternative to it
    named = {label(effect) for effect in selection.best.candidate.effects}
    steps = [
        replace(s, alternatives=[e for e in s.alternatives if e.effect_name not in named])
        for s in selection.steps
    ]
    return replace(selection, steps=steps)


@dataclass(frozen=True)
class _Found:
    """What came of one look at all candidates.

    Attributes
    ----------
    step : Step or None
        None where nothing is sure.
    below : FittedCandidate
        The model that was looked at; fitted anew where a richer one has shown a better optimum.
    tried : Ranking
    unsure : set of str
        Labels of effects of which the evidence would do in noise that is as a likelihood takes it to be.
    """

    step: Step | None
    below: FittedCandidate
    tried: Ranking
    unsure: set[str] = field(default_factory=set)


def _named(search: Search, selection: Selection, tried: Ranking, looked_at: int) -> _Found:
    """The best of the candidates of which there is evidence in noise of its own, too, and what is as good."""
    below, unsure, refused = selection.best, set[str](), list[Row]()
    threshold = max(ACCEPT, NEGLIGIBLE * selection.steps[0].evidence if selection.steps else 0.0)
    for row in _in_turn(tried)[:CHANCES]:
        candidate, gain = row
        refused.append(row)
        if gain <= threshold or not tried.may_be(row):
            continue
        try:
            chosen = search.fit_from(candidate.candidate, candidate)
        except FAILURES:
            continue
        below = search.nested(below, chosen)
        beyond = 0.0
        if loses_memory(
            below, candidate
        ):  # noise of its own lets the model without it off too easily
            chosen, beyond = candidate, gain - candidate.delta_bic(below, looked_at)
        evidence = chosen.delta_bic(below, looked_at) + beyond
        if evidence <= threshold:
            continue
        robust = chosen.robust_fall(below, looked_at, beyond) > ACCEPT or tried.surely_foretells(
            row
        )
        if not (robust and _is_sure(selection, below, chosen)):
            unsure.add(chosen.effect_name)
            continue
        others = [
            r
            for r in tried.rows
            if r is not row and not interchangeable(r[0].effect, chosen.effect)
        ]
        alike = [r for r in others if tried.are_alike(row, r) and r not in refused]
        step = Step(
            replace(chosen, free_run=tried.near[chosen.effect].fit),
            gain,
            evidence,
            chosen.p_value(below, looked_at, beyond),
            [e for e, _ in alike],
            [r for r in others if r not in alike],
            gains={e.effect_name: g for e, g in tried.rows},
        )
        return _Found(step, below, tried, unsure)
    return _Found(None, below, tried, unsure)


def _in_turn(tried: Ranking) -> list[Row]:
    """Candidates in the order in which they are asked: those that are as good as the best first, by the criterion.

    One of measuring takes no credit for what physics explains, too, which comes before it; nor one of an input for what
    a law explains as well by the criterion.
    """
    as_good = [
        row for row in tried.rows if row is tried.rows[0] or tried.are_alike(tried.rows[0], row)
    ]
    most = max((gain for _, gain in as_good), default=0.0)

    def place(row: Row) -> tuple[bool, bool, bool, float]:
        effect, gain = row[0].effect, row[1]
        of_input = bool(effect.term.signal) and not effect.term.law
        return bool(effect.output), most - gain >= ALTERNATIVE, of_input, -gain

    others = [row for row in tried.rows if row not in as_good]
    return [
        *sorted(as_good, key=place),
        *sorted(others, key=lambda row: bool(row[0].effect.output)),
    ]


def loses_memory(below: FittedCandidate, richer: FittedCandidate) -> bool:
    """Whether next to nothing of the memory is left in what a model leaves, that is long without an effect.

    An autoregression with hindsight follows a slow error better than a simulation whose form is not quite right. But
    noise that has a long memory keeps it whatever is simulated: of a random walk an offset and a drift take away all
    but 2/15 of the mean square, and what is left walks still.
    """
    before, after = _memory(below), _memory(richer)
    return any(after[o] < SHORT and after[o] < EXPLAINED * before[o] for o in after)


def _memory(fitted: FittedCandidate) -> dict[str, float]:
    """Mean square of a residual over that of its innovations, by output."""
    fit = fitted.fit
    return {
        o: power(fit.residual[o]) / (power(fit.innovation[o]) * n.deviation**2)
        for o, n in fit.noise.items()
    }


def _is_sure(selection: Selection, below: FittedCandidate, chosen: FittedCandidate) -> bool:
    """Whether a simulation is nearer, and another cause is a cause for enough."""
    if not chosen.is_nearer_than(below):
        return False
    first = not selection.steps or _is_shape_of(chosen.effect, selection)
    return first or takes_enough(selection.base, selection.best, chosen)


def _is_shape_of(effect: type[Effect], selection: Selection) -> bool:
    """Whether an effect is another shape of a cause that was named, and so no other cause."""
    named = [step.chosen.effect for step in selection.steps]
    return any(
        interchangeable(effect, one) and bool(effect.layout.states) == bool(one.layout.states)
        for one in named
    )


def takes_enough(base: FittedCandidate, below: FittedCandidate, richer: FittedCandidate) -> bool:
    """Whether a model takes away a tenth of what the base gets wrong in some output, beyond noise.

    No cause has quite the form that a catalogue gives it. What that leaves is the size of a tenth, and some effect
    always fits it.
    """
    before, noise = base.fit.residual, {o: n.deviation**2 for o, n in richer.fit.noise.items()}
    wrong = {o: power(before[o]) - power(richer.fit.innovation[o]) * noise[o] for o in noise}
    taken = {o: power(below.fit.residual[o]) - power(richer.fit.residual[o]) for o in noise}
    return any(taken[o] > EXPLAINED * wrong[o] > 0.0 for o in noise)


def _nearest(scored: Sequence[ScoredModel], chosen: FittedCandidate) -> ScoredModel:
    """The model, of those that were scored with an effect, from which it is the shortest way to where it was fitted."""
    able = [model for model in scored if model.directions.get(chosen.effect, (None, []))[1]]
    return min(able, key=lambda model: _distance(model.model, chosen))


def interchangeable(one: type[Effect], other: type[Effect]) -> bool:
    """Whether they are one cause in two shapes, such as the second and the third element of a chain."""
    return one is other or (bool(one.term.family) and one.term.family == other.term.family)


def _distance(one: FittedCandidate, other: FittedCandidate) -> float:
    """How far apart two models are in the parameters that both have."""
    shared = [
        n for n in one.problem.names if n in other.problem.names
    ]  # in order: a sum must not hang on hashes
    pairs = [(e.fit.q[e.problem.names.index(n)] for e in (one, other)) for n in shared]
    return float(sum((a - b) ** 2 for a, b in pairs))
