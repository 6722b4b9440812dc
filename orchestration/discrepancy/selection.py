"""Naming: one effect after another, as long as the record asks for more, and what cannot be told apart from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from fmus.kit import Effect
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidate import label
from orchestration.discrepancy.evidence import Evidence, Prospect, Search, side_by_side

ACCEPT = 10.0  # by which BIC, less the price of looking, must fall for one more effect: very strong evidence
RIVAL = 6.0  # within which another candidate counts as not told apart
MOST = 3  # effects that are looked for
AT_ONCE = 2
HOPELESS = 0.1  # of what another has gained already


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
    """

    chosen: Evidence
    gain: float
    p_value: float
    rivals: list[Evidence]
    rejected: list[tuple[Evidence, float]]


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
    base = search.nominal()
    search.look(base, effects)
    found = Selection(base, tried=len(effects))
    left = list(effects)
    while len(found.steps) < MOST:
        below = found.best
        ranked = _fitted(search, below, left)
        better = [row for row in ranked if row[1] > ACCEPT]
        if not better:
            found.rejected.extend(ranked)
            break
        chosen, gain = better[0]
        rivals = [e for e, g in better[1:] if gain - g < RIVAL]
        rejected = [row for row in ranked[1:] if row[0] not in rivals]
        found.steps.append(Step(chosen, gain, chosen.p_value(below, found.tried), rivals, rejected))
        named = {label(effect) for effect in chosen.candidate.effects}
        left = [effect for effect in left if label(effect) not in named]
    return found


def _fitted(search: Search, below: Evidence, effects: Sequence[type[Effect]]) -> list[tuple[Evidence, float]]:
    """Promising effects over a model, fitted, the best first."""
    result: list[tuple[Evidence, float]] = []
    prospects = search.prospects(below, effects)
    while prospects:
        # what the best of them gains tells which of the others still has a chance
        batch, prospects = prospects[:AT_ONCE], prospects[AT_ONCE:]
        fits = side_by_side(lambda prospect: _tried(search, below, prospect), batch)
        result += [(found, found.over(below, len(effects))) for found in fits if found]
        gained = max((below.fitted.deviance - e.fitted.deviance for e, _ in result), default=0.0)
        prospects = [prospect for prospect in prospects if prospect.outlook.fall > HOPELESS * gained]
    return sorted(result, key=lambda row: -row[1])


def _tried(search: Search, below: Evidence, prospect: Prospect) -> Evidence | None:
    try:
        return search.extended(below, prospect)
    except UserError as error:
        search.unjudged[label(prospect.effect)] = str(error)
        return None
