"""What inputs do between samples, asked once more with effects: a model that is wrong may ask for the wrong way.

What an effect delays looks like half a sample more, or less, than there is. So where a model without effects leaves
structure, and the record can tell one way of an input from the other, the best effect is looked for both ways, and
where the other way wins all are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fmus.kit import Effect
from orchestration.discrepancy.candidates.evidence import FittedCandidate, ScoredModel
from orchestration.discrepancy.residuals.analysis import has_structure
from orchestration.discrepancy.selection.intersample import CLEAR, Basis, Intersample, turned
from orchestration.discrepancy.selection.ranking import few, nearest_bic
from orchestration.discrepancy.selection.revision import explaining, revised
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import Selection, select


@dataclass(frozen=True)
class Way:
    """A way to take the inputs, and the model without effects that was fitted so.

    Attributes
    ----------
    search : Search
    scored : ScoredModel
        The model, and where effects would move it.
    chosen : dict of str to Intersample
    """

    search: Search
    scored: ScoredModel
    chosen: dict[str, Intersample]


def selected(
    search: Search,
    base: FittedCandidate,
    chosen: dict[str, Intersample],
    effects: Sequence[type[Effect]],
) -> tuple[Way, Selection]:
    """Select effects one after another, judged together, if they explain what is wrong; and inputs as these want them.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
        The model without effects.
    chosen : dict of str to Intersample
        By its fit.
    effects : sequence of type[Effect]
        The catalogue.
    """

    def judged(one: Way) -> Selection:
        return explaining(
            one.search, revised(one.search, select(one.search, effects, one.scored), effects)
        )

    way = Way(search, score(search, base, effects), chosen)
    selection, other = judged(way), by_effects(way, effects)
    if other is not way and (turned_over := judged(other)).steps:
        return other, turned_over
    return way, selection


def by_effects(way: Way, effects: Sequence[type[Effect]]) -> Way:
    """Let the best effect overrule how inputs are taken.

    Parameters
    ----------
    way : Way
        By the fit of the model without effects.
    effects : sequence of type[Effect]
        The catalogue.

    Returns
    -------
    Way
        The same, or what the record asks for.
    """
    names, base = [name for name, choice in way.chosen.items() if choice.open], way.scored.model
    if not names or way.search.budget.spent() or not has_structure(base, way.search.data):
        return way
    way.search.progress("looking at inputs both ways")
    promising, found = few(way.scored, effects), way
    least = nearest_bic(way.search, way.scored, promising)
    for name in names:
        other = turned(found.search, found.scored.model, [name])
        if other is None or way.search.budget.spent():
            continue
        scored = score(*other, promising)
        bic = nearest_bic(other[0], scored, promising)
        if least - bic >= CLEAR:
            choice = Intersample(not way.chosen[name].linear, Basis.FIT, least - bic)
            found, least = Way(other[0], scored, found.chosen | {name: choice}), bic
    return (
        found
        if found is way
        else replace(found, scored=score(found.search, found.scored.model, effects))
    )
