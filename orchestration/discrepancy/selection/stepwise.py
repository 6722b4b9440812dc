"""Forward selection of effects, one at a time while there is evidence, with alternatives."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace

from fmus.kit import Effect
from orchestration.discrepancy.candidates import (
    FittedCandidate,
    ScoredModel,
    label,
    own_parameters,
)
from orchestration.discrepancy.residuals import robust_power
from orchestration.discrepancy.selection.equivalence import is_of_input
from orchestration.discrepancy.selection.ranking import (
    ACCEPT,
    ALTERNATIVE,
    REFINED,
    Fitted,
    Ranking,
    Row,
    ranked,
)
from orchestration.discrepancy.selection.scoring import confounding, score, unidentifiable
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.discrepancy.selection.solver_error import solver_error_notes
from orchestration.identify.fitting import choose_credible_fit

# of what the first effect gained: less is its true shape, which is never quite that of the
# catalogue
NEGLIGIBLE = 0.01
SECONDARY = 0.2  # of the evidence for the first effect, below which another is a lesser matter
MOST = 3  # effects that are looked for
CHANCES = 6  # candidates that are fitted in noise of their own, the best first, until one is sure
EXPLAINED = 0.1  # of the error of the base beyond noise
# of what an effect gains, by which a better optimum of the model without it must be better for all
# to be fitted from there: by less, none that is not as good comes to be the best
LOWERED = 0.1
SHORT = 5.0  # ratio of the variance of noise to that of its innovations, below which it is white
# A model left free may bend its parameters out of all reason to follow what it has no word for, and
# what an effect would add to that tells little. Where one held this close to nominal (in the
# logarithm) is this much less likely, effects are scored at both.
NEAR_NOMINAL = 0.1
OVERFITTED = 50.0
# Effects by which a signal arrives late. By all others another amount of it arrives.
_TIMING = {"input_lag", "sensor_lag", "transport_delay"}


@dataclass(frozen=True)
class Step:
    """A step of forward selection, in which one effect was named.

    Attributes
    ----------
    chosen : FittedCandidate
    gain : float
        Fall of BIC against the step before, less the price of looking at many, both in the noise of
        the best candidate.
    evidence : float
        The same, each in the noise that is likeliest for it.
    p_value : float
        Corrected for their number.
    alternatives : list of FittedCandidate
        Candidates that cannot be told apart from it, the best first.
    rejected : list of tuple of FittedCandidate and float
        Others that were fitted, with their gain.
    shapes : list of FittedCandidate
        Others for which there is evidence that are shapes of the same cause, the best first.
    confounding : dict of str to float
        Share of what it does that other effects do too, by their label.
    gains : dict of str to float
        That of every candidate, by its label; the fits may be made anew since.
    equivalents : list of tuple of FittedCandidate and float
        Others that are the same model in other parameters, which no experiment tells from it.
    """

    chosen: FittedCandidate
    gain: float
    evidence: float
    p_value: float
    alternatives: list[FittedCandidate]
    rejected: list[tuple[FittedCandidate, float]]
    shapes: list[FittedCandidate] = field(default_factory=list)
    confounding: dict[str, float] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)
    equivalents: list[tuple[FittedCandidate, float]] = field(default_factory=list)


@dataclass(frozen=True)
class Selection:
    """Effects that were selected, and candidates that were rejected.

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
        Labels of effects whose evidence would do, were noise of the level and the colour that a
        likelihood takes it to be.
    compared : tuple of FittedCandidate
        Where the search saw a stretch of the record and the models are fitted to all of it: the
        models in that stretch, of the base and of every step, to which effects were added there.
    """

    base: FittedCandidate
    steps: list[Step] = field(default_factory=list)
    rejected: list[tuple[FittedCandidate, float]] = field(default_factory=list)
    tried: int = 0
    unsure: set[str] = field(default_factory=set)
    compared: tuple[FittedCandidate, ...] = ()

    @property
    def by_cause(self) -> list[list[Step]]:
        """Steps by the cause that they concern: the first names it, any others correct its shape.

        No cause has quite the form that a catalogue gives it. What acts where a cause does is no
        cause of its own, but makes up for that.
        """
        groups: dict[Hashable, list[Step]] = {}
        for step in self.steps:
            groups.setdefault(place_of(step.chosen.effect), []).append(step)
        return list(groups.values())

    @property
    def strong(self) -> list[Step]:
        """Steps for which there is not much less evidence than for the first."""
        return [step for step in self.steps if step.evidence >= SECONDARY * self.steps[0].evidence]

    def ending_in(self, best: FittedCandidate) -> Selection:
        """Return the same selection with its best model fitted anew."""
        if not self.steps:
            return replace(self, base=best)
        return replace(self, steps=[*self.steps[:-1], replace(self.steps[-1], chosen=best)])

    @property
    def best(self) -> FittedCandidate:
        """The model with every effect that was named."""
        return self.steps[-1].chosen if self.steps else self.base


def select(
    search: Search,
    effects: Sequence[type[Effect]],
    known: ScoredModel | None = None,
    fitted: Fitted | None = None,
) -> Selection:
    """Select effects, one at a time.

    Parameters
    ----------
    search : Search
    effects : sequence of type[Effect]
        The catalogue.
    known : ScoredModel, optional
        The model without effects, if it was scored already.
    fitted : Mapping of type[Effect] to FittedCandidate, optional
        Effects over that model which were fitted in white noise already.

    Returns
    -------
    Selection
    """
    first = known or score(search, search.nominal(), effects)
    scored = [first, *_scored_elsewhere(search, first.model, effects)]
    silent = unidentifiable(first)
    search.not_assessed |= silent
    assessed = [effect for effect in effects if label(effect) not in silent]
    known_fits = fitted or {}
    selection, alone = _selected(search, scored, assessed, len(effects), known_fits)
    if alone:
        known_fits = {**known_fits, **alone}
        selection, _ = _selected(search, scored, assessed, len(effects), known_fits)
    for one, _ in [*((s.chosen, s.gain) for s in selection.steps), *selection.rejected]:
        search.not_assessed.pop(one.effect_name, None)  # from elsewhere it could be fitted
    return _without_named_alternatives(selection)


def _selected(
    search: Search,
    scored: Sequence[ScoredModel],
    effects: Sequence[type[Effect]],
    tried: int,
    fitted: Fitted,
) -> tuple[Selection, Fitted]:
    """Select effects by forward selection.

    Parameters
    ----------
    search : Search
    scored : sequence of ScoredModel
        Models without effects; the first of them is the base.
    effects : sequence of type[Effect]
        Of which the record says something.
    tried : int
        Effects in the catalogue.
    fitted : Mapping of type[Effect] to FittedCandidate
        Effects fitted over a model without effects, in white noise.

    Returns
    -------
    selection : Selection
    alone : Mapping of type[Effect] to FittedCandidate
        Effects that come nearer alone than the first that was named, fitted in white noise.
    """
    selection = Selection(scored[0].model, tried=tried)
    remaining = list(effects)
    bases = list(scored)
    while remaining and len(selection.steps) < MOST:
        if solver_error_notes(selection.best):
            break
        if search.budget.spent():
            search.budget.leave(map(label, remaining))
            break
        known_fits = {} if selection.steps else fitted
        selection, result = _search_step(search, selection, bases, remaining, known_fits)
        selection.unsure.update(result.unsure)
        if result.step is None:
            selection.rejected.extend(result.tried.rows)
            return selection, _nearer_alone(search, selection, result.tried)
        named = {label(effect) for effect in result.step.chosen.candidate.effects}
        remaining = [effect for effect in remaining if label(effect) not in named]
        nearest = _nearest(bases, result.step.chosen)
        step = _completed(search, result.step, nearest, remaining)
        selection.steps.append(step)
        bases = [ScoredModel(step.chosen, nearest.directions)]
    return selection, {}


def _nearer_alone(search: Search, selection: Selection, tried: Ranking) -> Fitted:
    """Fit the nearest effects of a step that named none without the one named before.

    Where a model lacks something its parameters are bent, and a fit of what it lacks that starts
    there may end beside its optimum. Beside an effect that follows the record more closely it may
    reach it, and then the other is not needed. Both may have exchanged their parts with the model:
    so the fits start from nominal parameters, too.

    Returns
    -------
    Mapping of type[Effect] to FittedCandidate
        Those that come nearer alone than the one that was named, in white noise.
    """
    if len(selection.steps) != 1 or search.budget.spent():
        return {}
    named = selection.best.free_run
    assert named is not None
    plain = search.in_white_noise()
    # what is the one that was named in other parameters is that alone, too
    same = [fitted.effect for fitted, _ in selection.steps[0].equivalents]
    gaining = [
        tried.near[f.effect] for f, gain in tried.rows if gain > ACCEPT and f.effect not in same
    ]
    alone = {}
    for beside in sorted(gaining, key=lambda f: f.fit.bic)[:REFINED]:
        effect = beside.effect
        own = {name: beside.fit.values[name] for name in own_parameters(effect)}
        fits = [plain.fit_with([effect], beside, start) for start in (None, own)]
        nearest = min(filter(None, fits), key=lambda f: f.fit.bic, default=None)
        if nearest and named.bic - nearest.fit.bic > ALTERNATIVE:
            alone[effect] = nearest
    return alone


def _scored_elsewhere(
    search: Search, base: FittedCandidate, effects: Sequence[type[Effect]]
) -> list[ScoredModel]:
    """Return the model near nominal, and that of its free run, scored, where these tell more.

    A base that is fitted out of all reason, or in noise that has swallowed what it lacks, is too
    far from the plant for what effects do to it to tell what they do to the plant.
    """
    if search.budget.spent():
        return []
    others = []
    near = search.near_nominal(NEAR_NOMINAL)
    if near.fit.deviance - base.fit.deviance > OVERFITTED:
        others.append(near)
    free_run = base.free_run
    if free_run and choose_credible_fit(base.problem, base.fit, free_run) is free_run:
        others.append(replace(base, fit=free_run))
    return [score(search, other, effects) for other in others]


def _search_step(
    search: Search,
    selection: Selection,
    scored: list[ScoredModel],
    remaining: Sequence[type[Effect]],
    known: Fitted,
) -> tuple[Selection, _StepResult]:
    """Search for one more effect; again if a richer model has shown a better optimum below.

    Parameters
    ----------
    search : Search
    selection : Selection
    scored : list of ScoredModel
        Models with the effects so far, of which there is one more where the search is repeated.
    remaining : sequence of type[Effect]
    known : Mapping of type[Effect] to FittedCandidate
        Fitted in white noise already.

    Returns
    -------
    selection : Selection
        The same, its best model fitted anew if there is a better optimum.
    result : _StepResult
    """
    tried = ranked(search, selection.best, scored, remaining, rough=known)
    result = _best_sure(search, selection, tried, len(remaining))
    lowered = selection.best.fit.bic - result.below.fit.bic
    improved = selection
    if result.below is not selection.best:
        improved = selection.ending_in(result.below)
    if result.step is None or not lowered > max(ALTERNATIVE, LOWERED * result.step.gain):
        return improved, result
    # all were fitted from a lesser optimum
    scored.append(score(search, result.below, remaining))
    tried_again = ranked(search, result.below, scored[-1:], remaining, tried.near)
    again = _best_sure(search, improved, tried_again, len(remaining))
    return improved, result if search.budget.spent() else again


def _completed(
    search: Search, step: Step, nearest: ScoredModel, remaining: Sequence[type[Effect]]
) -> Step:
    """Return a step with its model fitted in renewed noise, and with what is confounded with it."""
    effect = step.chosen.effect
    others = [other for other in remaining if not interchangeable(other, effect)]
    shares = confounding(nearest, effect, others)
    return replace(step, chosen=search.renewed(step.chosen), confounding=shares)


def _without_named_alternatives(selection: Selection) -> Selection:
    """Return the selection without alternatives that were named in another step."""
    named = {label(effect) for effect in selection.best.candidate.effects}
    steps = []
    for step in selection.steps:
        others = [e for e in step.alternatives if e.effect_name not in named]
        steps.append(replace(step, alternatives=others))
    return replace(selection, steps=steps)


@dataclass(frozen=True)
class _StepResult:
    """The result of one search among all candidates.

    Attributes
    ----------
    step : Step or None
        None where nothing is sure.
    below : FittedCandidate
        The model without them; fitted anew where a richer one has shown a better optimum.
    tried : Ranking
    unsure : set of str
        Labels of effects of which the evidence would do in noise that is as a likelihood takes it
        to be.
    """

    step: Step | None
    below: FittedCandidate
    tried: Ranking
    unsure: set[str] = field(default_factory=set)


def _best_sure(search: Search, selection: Selection, tried: Ranking, looked_at: int) -> _StepResult:
    """Return the best candidate with evidence in noise of its own, too, and those as good."""
    below = selection.best
    unsure: set[str] = set()
    refused: list[Row] = []
    threshold = max(ACCEPT, NEGLIGIBLE * selection.steps[0].evidence if selection.steps else 0.0)
    for row in _in_turn(tried)[:CHANCES]:
        candidate, gain = row
        refused.append(row)
        if gain <= threshold or not tried.is_admissible(row):
            continue
        try:
            chosen = search.fit_from(candidate.candidate, candidate)
        except FAILURES:
            continue
        below = search.nested(below, chosen)
        chosen = search.containing(chosen, below)
        beyond = 0.0
        # noise of its own lets the model without it off too easily
        if whitens_residual(below, candidate) or tried.comes_nearer(row):
            chosen = candidate
            beyond = gain - candidate.delta_bic(below, looked_at)
        evidence = chosen.delta_bic(below, looked_at) + beyond
        if evidence <= threshold:
            continue
        is_robust = chosen.robust_fall(below, looked_at, beyond) > ACCEPT
        is_robust = is_robust or tried.cv_significant(row)
        if not (is_robust and _is_sure(selection, below, chosen)):
            unsure.add(chosen.effect_name)
            continue
        p_value = chosen.p_value(below, looked_at, beyond)
        named = Step(chosen, gain, evidence, p_value, [], [])
        return _StepResult(_with_others(named, tried, row, refused), below, tried, unsure)
    return _StepResult(None, below, tried, unsure)


def _with_others(step: Step, tried: Ranking, row: Row, refused: Sequence[Row]) -> Step:
    """Add to a step the other candidates: its alternatives, and those rejected.

    Parameters
    ----------
    step : Step
    tried : Ranking
    row : tuple of FittedCandidate and float
        Of the effect that was named.
    refused : sequence of tuple of FittedCandidate and float
        Candidates judged before it, and itself, which are no alternatives.
    """
    effect = step.chosen.effect
    others = [
        other
        for other in tried.rows
        if other is not row and not interchangeable(other[0].effect, effect)
    ]
    shapes = [
        fitted
        for fitted, gain in tried.rows
        if fitted is not row[0] and gain > ACCEPT and interchangeable(fitted.effect, effect)
    ]
    as_good = [o for o in others if tried.indistinguishable(row, o) and o not in refused]
    return replace(
        step,
        chosen=replace(step.chosen, free_run=tried.near[effect].fit),
        alternatives=[fitted for fitted, _ in as_good],
        rejected=[other for other in others if other not in as_good],
        shapes=shapes,
        gains={fitted.effect_name: gain for fitted, gain in tried.rows},
        equivalents=tried.equivalents.get(effect, []),
    )


def _in_turn(tried: Ranking) -> list[Row]:
    """Return candidates in the order in which they are judged: those as good as the best first.

    One that follows any slow course comes after what explains this one without, and one that is
    less likely and less near after the likeliest. One of measuring takes no credit for what physics
    explains as well, which comes before it; nor one of an input for what a law explains as well. Of
    shapes of one cause the best comes first.
    """
    as_good = [
        row
        for row in tried.rows
        if row is tried.rows[0] or tried.indistinguishable(tried.rows[0], row)
    ]
    likeliest = max(as_good, key=lambda row: row[1], default=None)

    def place(row: Row) -> tuple[bool, bool, bool, bool, float]:
        candidate, gain = row
        effect = candidate.effect
        return (
            tried.follows_any_course(candidate),
            likeliest is not None and tried.is_behind(likeliest, row),
            bool(effect.output),
            is_of_input(effect),
            -gain,
        )

    def place_of_cause(row: Row) -> tuple[tuple[bool, bool, bool, bool, float], float]:
        shapes = [o for o in as_good if interchangeable(o[0].effect, row[0].effect)]
        return min(map(place, shapes)), tried.criterion(row)

    others = [row for row in tried.rows if row not in as_good]
    return [
        *sorted(as_good, key=place_of_cause),
        *sorted(others, key=lambda row: bool(row[0].effect.output)),
    ]


def whitens_residual(below: FittedCandidate, richer: FittedCandidate) -> bool:
    """Return whether an effect takes nearly all of a long memory off the residual of some output.

    An autoregression with hindsight follows a slow error better than a simulation whose form is not
    quite right. But noise that has a long memory keeps it whatever is simulated: of a random walk
    an offset and a drift take away all but 2/15 of the mean square, and what is left walks still.
    """
    before = _memory(below)
    after = _memory(richer)
    return any(after[o] < SHORT and after[o] < EXPLAINED * before[o] for o in after)


def _memory(fitted: FittedCandidate) -> dict[str, float]:
    """Return the mean square of a residual over that of its innovations, by output."""
    fit = fitted.fit
    memory = {}
    for o, noise in fit.noise.items():
        power = robust_power(fit.residual[o])
        unforeseen = robust_power(fit.innovation[o]) * noise.deviation**2
        # an output without noise, such as one that rests, leaves nothing to remember
        memory[o] = power / unforeseen if unforeseen else 1.0
    return memory


def _is_sure(selection: Selection, below: FittedCandidate, chosen: FittedCandidate) -> bool:
    """Return whether a simulation is nearer, and a further cause accounts for enough."""
    if not chosen.is_nearer_than(below):
        return False
    first = not selection.steps or _is_shape_of(chosen.effect, selection)
    return first or takes_enough(selection.base, selection.best, chosen)


def _is_shape_of(effect: type[Effect], selection: Selection) -> bool:
    """Return whether an effect is another shape of a cause that was named."""
    named = [step.chosen.effect for step in selection.steps]
    return any(
        interchangeable(effect, one) and bool(effect.layout.states) == bool(one.layout.states)
        for one in named
    )


def takes_enough(base: FittedCandidate, below: FittedCandidate, richer: FittedCandidate) -> bool:
    """Return whether a model removes a tenth of the base's error in some output, beyond noise.

    No cause has quite the form that a catalogue gives it. What that leaves is the size of a tenth,
    and some effect always fits it.
    """
    before = base.fit.residual
    noise = {o: n.deviation**2 for o, n in richer.fit.noise.items()}
    wrong = {
        o: robust_power(before[o]) - robust_power(richer.fit.innovation[o]) * noise[o]
        for o in noise
    }
    taken = {
        o: robust_power(below.fit.residual[o]) - robust_power(richer.fit.residual[o]) for o in noise
    }
    return any(taken[o] > EXPLAINED * wrong[o] > 0.0 for o in noise)


def _nearest(scored: Sequence[ScoredModel], chosen: FittedCandidate) -> ScoredModel:
    """Return the model nearest to a fitted one, of those that were scored with its effect."""
    able = [
        one
        for one in scored
        if chosen.effect in one.directions and one.directions[chosen.effect].settings
    ]
    return min(able, key=lambda one: _distance(one.model, chosen))


def interchangeable(one: type[Effect], other: type[Effect]) -> bool:
    """Return whether two effects are shapes of one cause, such as two elements of a chain."""
    return one is other or (bool(one.term.family) and one.term.family == other.term.family)


def place_of(effect: type[Effect]) -> Hashable:
    """Return where an effect acts: a law over a signal, or an input or a sensor, or their timing.

    Effects of one place are shapes of one cause; one that declares no place has its own.
    """
    term = effect.term
    is_timing = effect.id in _TIMING
    if effect.output:
        return "sensor", effect.output, is_timing
    if term.signal and not term.law:
        return "input", term.signal, is_timing
    return ("law", term.family) if term.family else effect


def _distance(one: FittedCandidate, other: FittedCandidate) -> float:
    """Return the squared distance of two models in the parameters that both have."""
    # in order: a sum must not depend on hashes
    shared = [n for n in one.problem.names if n in other.problem.names]
    pairs = [(e.fit.q[e.problem.names.index(n)] for e in (one, other)) for n in shared]
    return float(sum((a - b) ** 2 for a, b in pairs))
