"""Which effects are worth a fit: score directions of all of them at a fitted model, and what a fit would gain."""

from __future__ import annotations

from collections.abc import Sequence

from fmus.kit import Effect
from orchestration.discrepancy.candidates.candidate import label, own_parameters
from orchestration.discrepancy.candidates.evidence import (
    FittedCandidate,
    ScoredModel,
    ScreenedCandidate,
)
from orchestration.discrepancy.candidates.outlook import LinearisedModel
from orchestration.discrepancy.candidates.score_test import (
    ScoreDirection,
    score_directions,
    start_values,
)
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import Counter, side_by_side
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.identify.problem import Problem

PROMISING = 8  # effects that are fitted, if they are worth it
WORTH = 5.0  # fall that is expected of a fit, below which it cannot come to what is accepted
_UNIDENTIFIABLE = (
    1e-6  # share of what an effect does, in power, below which other parameters do the same
)


def score(search: Search, below: FittedCandidate, effects: Sequence[type[Effect]]) -> ScoredModel:
    """Find where every effect would move a fitted model; it serves for what is laid over that model later, too."""
    directions: dict[type[Effect], tuple[Problem, list[ScoreDirection]]] = {}
    counter = Counter(search.progress, "scoring effects", len(effects))

    def one(effect: type[Effect]) -> None:
        if search.budget.spent():
            search.budget.leave([label(effect)])
            return
        candidate = below.candidate.with_effect(effect)
        try:
            problem = search.problem(
                candidate, own_parameters(effect), {**search.fixed, **below.fit.values}
            )
            directions[effect] = problem, score_directions(problem, effect)
            problem.forget()
        except FAILURES as error:
            search.not_assessed[label(effect)] = Note(
                NoteCode.NOT_SIMULATED, label(effect), {"reason": str(error)}
            )
        counter.one_more()

    side_by_side(one, effects)
    return ScoredModel(below, directions)


def unidentifiable(scored: ScoredModel) -> dict[str, Note]:
    """Effects that a record says nothing of, whatever they do, and why."""
    model = LinearisedModel(scored.model.problem, scored.model.fit)
    notes = {}
    for effect, (_, directions) in scored.directions.items():
        name = label(effect)
        if not any(
            gradient.any() for direction in directions for gradient in direction.gradient.values()
        ):
            notes[name] = Note(NoteCode.NO_TRACE, name)
        elif all(
            model.identifiable_share(direction.gradient) < _UNIDENTIFIABLE
            for direction in directions
        ):
            notes[name] = Note(NoteCode.UNIDENTIFIABLE, name)
    return notes


def confounding(
    scored: ScoredModel, effect: type[Effect], others: Sequence[type[Effect]]
) -> dict[str, float]:
    """Share of what an effect does, beyond the model it is laid over, that each of others does too."""
    model = LinearisedModel(scored.model.problem, scored.model.fit)
    own = scored.directions[effect][1]
    strongest = max(own, key=lambda d: model.score_statistics(d.gradient, d.least, d.most)[1])
    share = model.confounded_share(strongest.gradient)
    scorable = [other for other in others if other in scored.directions]

    def most(other: type[Effect]) -> float:
        # a little of it only: what a lot does may look like anything
        return max(
            (share(d.gradient) for d in scored.directions[other][1] if d.least <= 0.0), default=0.0
        )

    return dict(zip(map(label, scorable), side_by_side(most, scorable), strict=True))


def screen(scored: ScoredModel, effects: Sequence[type[Effect]]) -> list[ScreenedCandidate]:
    """Where fits of effects over a fitted model should begin: where either whitening has the highest score of each."""
    model = LinearisedModel(scored.model.problem, scored.model.fit)
    scorable = [effect for effect in effects if effect in scored.directions]
    statistics = side_by_side(
        lambda effect: [
            model.score_statistics(d.gradient, d.least, d.most)
            for d in scored.directions[effect][1]
        ],
        scorable,
    )
    # the noise as estimated may have swallowed a slow effect, and white noise knows nothing of colour: ask both
    chosen: dict[tuple[type[Effect], int], ScoreDirection] = {}
    for whitening in range(2):
        for effect, rows in zip(scorable, statistics, strict=True):
            if rows:
                k = max(range(len(rows)), key=lambda k: rows[k][whitening])
                chosen[effect, k] = scored.directions[effect][1][k]

    def predicted(item: tuple[tuple[type[Effect], int], ScoreDirection]) -> ScreenedCandidate:
        (effect, _), direction = item
        improvement = model.predicted_improvement(
            direction.gradient, direction.least, direction.most
        )
        problem = scored.directions[effect][0]
        start = start_values(direction, problem, own_parameters(effect)[0], improvement.amount)
        return ScreenedCandidate(scored.model, effect, start, improvement)

    return side_by_side(predicted, list(chosen.items()))
