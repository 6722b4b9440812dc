"""Naming: one effect after another, as long as the record asks for more, and what cannot be told apart from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fmus.kit import Effect
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.selection.search import Evidence, Origin, Prospect, Search, side_by_side

ACCEPT = 10.0  # by which BIC, less the price of looking, must fall for one more effect: very strong evidence
RIVAL = 6.0  # within which another candidate counts as not told apart
MINOR = 0.01  # of what the first effect gained: less is its true shape, which is never quite that of the catalogue
WEAK = 0.2  # of the evidence for the first effect, below which another is a lesser matter
MOST = 3  # effects that are looked for
AT_ONCE = 2
CONTENDS = 0.5  # of what the best gains, from which on it is worth making sure of a fit
HOPELESS = 0.2  # of what another has gained already
# A model left free may bend its parameters out of all reason to follow what it has no word for, and what an effect
# would add to that tells little. Where one held this close to nominal (in the logarithm) is this much less likely,
# effects are looked at from both.
NEAR_NOMINAL = 0.1
STRAYED = 50.0


@dataclass(frozen=True)
class Step:
    """One effect named.

    Attributes
    ----------
    chosen : Evidence
    gain : float
        Fall of BIC against the step before, less the price of looking at many.
    p_value : float
        Corrected for their number.
    rivals : list of Evidence
        Candidates that cannot be told apart from it, the best first.
    rejected : list of tuple of Evidence and float
        Others that were fitted, with their gain.
    alike : dict of str to float
        Share of what it does that other effects do too, by their label.
    """

    chosen: Evidence
    gain: float
    p_value: float
    rivals: list[Evidence]
    rejected: list[tuple[Evidence, float]]
    alike: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Selection:
    """What was found.

    Attributes
    ----------
    base : Evidence
        The model without effects, refitted.
    steps : list of Step
    rejected : list of tuple of Evidence and float
        Candidates of the last look, which found nothing more, with their gain.
    tried : int
        Effects in the catalogue.
    """

    base: Evidence
    steps: list[Step] = field(default_factory=list)
    rejected: list[tuple[Evidence, float]] = field(default_factory=list)
    tried: int = 0

    @property
    def strong(self) -> list[Step]:
        """Steps for which there is not much less evidence than for the first."""
        return [step for step in self.steps if step.gain >= WEAK * self.steps[0].gain]

    @property
    def best(self) -> Evidence:
        """The model with all that was found."""
        return self.steps[-1].chosen if self.steps else self.base


def select(search: Search, effects: Sequence[type[Effect]]) -> Selection:
    """Look for effects, one at a time.

    Parameters
    ----------
    search : Search
    effects : sequence of type[Effect]
        The catalogue.

    Returns
    -------
    Selection
    """
    base, near = search.nominal(), search.nominal(NEAR_NOMINAL)
    strayed = near.fitted.deviance - base.fitted.deviance > STRAYED
    origins = [search.look(model, effects) for model in ([base, near] if strayed else [base])]
    silent = search.silent(origins[0])
    search.unjudged |= silent
    found = Selection(base, tried=len(effects))
    left = [effect for effect in effects if label(effect) not in silent]
    while len(found.steps) < MOST:
        below = found.best
        ranked = _fitted(search, below, origins, left)
        enough = max(ACCEPT, MINOR * found.steps[0].gain if found.steps else 0.0)
        better = [row for row in ranked if row[1] > enough]
        if not better:
            found.rejected.extend(ranked)
            break
        chosen, gain = better[0]
        effect = chosen.effect
        others = [row for row in ranked[1:] if not _interchangeable(row[0].effect, effect)]
        rivals = [e for e, g in others if g > enough and gain - g < RIVAL]
        rejected = [row for row in others if row[0] not in rivals]
        named = {label(effect) for effect in chosen.candidate.effects}
        left = [effect for effect in left if label(effect) not in named]
        able = [origin for origin in origins if origin.seen.get(effect, (None, []))[1]]
        nearest = min(able, key=lambda origin: _distance(origin.evidence, chosen))
        alike = search.alike(nearest, effect, [other for other in left if not _interchangeable(other, effect)])
        found.steps.append(Step(chosen, gain, chosen.p_value(below, found.tried), rivals, rejected, alike))
        origins = [Origin(chosen, nearest.seen)]
    for evidence, _ in [*((s.chosen, s.gain) for s in found.steps), *found.rejected]:
        search.unjudged.pop(evidence.last, None)  # from elsewhere it could be fitted
    named = {label(effect) for effect in found.best.candidate.effects}  # who was named beside another is no rival of it
    steps = [replace(s, rivals=[e for e in s.rivals if e.last not in named]) for s in found.steps]
    return replace(found, steps=steps)


def _interchangeable(one: type[Effect], other: type[Effect]) -> bool:
    """Whether they are two of a kind, such as the second and the third element of a chain."""
    kinds = [(vars(e)["made_by"], *vars(e)["made_with"][:2]) if "made_by" in vars(e) else e for e in (one, other)]
    return kinds[0] == kinds[1]


def _distance(one: Evidence, other: Evidence) -> float:
    """How far apart two models are in the parameters that both have."""
    shared = [n for n in one.problem.names if n in other.problem.names]  # in order: a sum must not hang on hashes
    pairs = [(e.fitted.q[e.problem.names.index(n)] for e in (one, other)) for n in shared]
    return float(sum((a - b) ** 2 for a, b in pairs))


def _fitted(
    search: Search, below: Evidence, origins: Sequence[Origin], effects: Sequence[type[Effect]]
) -> list[tuple[Evidence, float]]:
    """Promising effects over a model, fitted from every origin, the best first."""
    best: dict[type[Effect], Evidence] = {}
    for origin in origins:
        prospects = search.prospects(origin, effects)
        while prospects:
            # what the best of them gains tells which of the others still has a chance
            batch, prospects = prospects[:AT_ONCE], prospects[AT_ONCE:]
            for found in filter(None, side_by_side(lambda prospect: _tried(search, below, prospect), batch)):
                effect = found.effect
                best[effect] = min(best.get(effect, found), found, key=lambda e: e.fitted.bic)
            gained = max((origin.evidence.fitted.deviance - e.fitted.deviance for e in best.values()), default=0.0)
            prospects = [prospect for prospect in prospects if prospect.outlook.fall > HOPELESS * gained]
    gains = {effect: below.fitted.bic - e.fitted.bic for effect, e in best.items()}
    contenders = [effect for effect, gain in gains.items() if gain > CONTENDS * max(0.0, *gains.values())]
    best |= zip(contenders, side_by_side(lambda effect: search.surer(best[effect]), contenders), strict=True)
    return sorted(((e, e.over(below, len(effects))) for e in best.values()), key=lambda row: -row[1])


def _tried(search: Search, below: Evidence, prospect: Prospect) -> Evidence | None:
    try:
        found = search.extended(prospect)
        if found.fitted.deviance > below.fitted.deviance:  # it contains that model, so the search was lost
            found = search.extended(replace(prospect, over=below, outlook=prospect.outlook.still()))
    except UserError as error:
        search.unjudged[label(prospect.effect)] = str(error)
        return None
    return found
