"""Screening of effects: their score directions at a fitted model, and the gain of a fit."""

from __future__ import annotations

from collections.abc import Sequence

from fmus.kit import Effect
from orchestration.discrepancy.candidates import (
    FittedCandidate,
    LinearisedModel,
    ScoreDirection,
    ScoredModel,
    ScreenedCandidate,
    label,
    own_parameters,
    score_directions,
    start_values,
)
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import Counter, parallel_map
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.identify.fitting import Problem

PROMISING = 8  # effects that are fitted, if they are worth it
WORTH = 5.0  # fall that is expected of a fit, below which it cannot come to what is accepted
_UNIDENTIFIABLE = 1e-6  # share of an effect, in power, below which other parameters do the same


def score(search: Search, below: FittedCandidate, effects: Sequence[type[Effect]]) -> ScoredModel:
    """Find how every effect would move a fitted model."""
    directions: dict[type[Effect], tuple[Problem, list[ScoreDirection]]] = {}
    counter = Counter(search.progress, "scoring effects", len(effects))

    def score_effect(effect: type[Effect]) -> None:
        if search.budget.spent():
            search.budget.leave([label(effect)])
            return
        candidate = below.candidate.with_effect(effect)
        try:
            fixed = {**search.fixed, **below.fit.values}
            problem = search.problem(candidate, own_parameters(effect), fixed)
            directions[effect] = problem, score_directions(problem, effect)
            problem.forget_simulation()
        except FAILURES as error:
            name = label(effect)
            note = Note(NoteCode.NOT_SIMULATED, name, {"reason": str(error)})
            search.not_assessed[name] = note
        counter.one_more()

    parallel_map(score_effect, effects)
    return ScoredModel(below, directions)


def unidentifiable(scored: ScoredModel) -> dict[str, Note]:
    """Return notes on effects of which a record says nothing, by their label."""
    model = LinearisedModel(scored.model.problem, scored.model.fit)
    notes = {}
    for effect, (_, directions) in scored.directions.items():
        name = label(effect)
        gradients = [direction.gradient for direction in directions]
        if not any(column.any() for gradient in gradients for column in gradient.values()):
            notes[name] = Note(NoteCode.NO_TRACE, name)
        elif all(model.identifiable_share(gradient) < _UNIDENTIFIABLE for gradient in gradients):
            notes[name] = Note(NoteCode.UNIDENTIFIABLE, name)
    return notes


def confounding(
    scored: ScoredModel, effect: type[Effect], others: Sequence[type[Effect]]
) -> dict[str, float]:
    """Return by label the share of an effect, beyond its base model, that each other makes too."""
    model = LinearisedModel(scored.model.problem, scored.model.fit)
    _, own = scored.directions[effect]
    strongest = max(own, key=lambda d: model.score_statistics(d.gradient, d.least, d.most)[1])
    share = model.confounded_share(strongest.gradient)
    scorable = [other for other in others if other in scored.directions]

    def largest_share(other: type[Effect]) -> float:
        # of a little of it only: a lot of it may look like anything
        _, directions = scored.directions[other]
        return max((share(d.gradient) for d in directions if d.least <= 0.0), default=0.0)

    return dict(zip(map(label, scorable), parallel_map(largest_share, scorable), strict=True))


def screen(scored: ScoredModel, effects: Sequence[type[Effect]]) -> list[ScreenedCandidate]:
    """Return starts for fits of effects, at the best score in coloured or white noise."""
    model = LinearisedModel(scored.model.problem, scored.model.fit)
    scorable = [effect for effect in effects if effect in scored.directions]

    def score_statistics(effect: type[Effect]) -> list[list[float]]:
        _, directions = scored.directions[effect]
        return [model.score_statistics(d.gradient, d.least, d.most) for d in directions]

    statistics = parallel_map(score_statistics, scorable)
    # the noise as estimated may have swallowed a slow effect, and white noise knows nothing of
    # colour: both count
    chosen: dict[tuple[type[Effect], int], ScoreDirection] = {}
    for whitening in range(2):
        for effect, rows in zip(scorable, statistics, strict=True):
            if rows:
                scores = [row[whitening] for row in rows]
                k = scores.index(max(scores))
                chosen[effect, k] = scored.directions[effect][1][k]

    def predict(item: tuple[tuple[type[Effect], int], ScoreDirection]) -> ScreenedCandidate:
        (effect, _), direction = item
        improvement = model.predicted_improvement(
            direction.gradient, direction.least, direction.most
        )
        problem = scored.directions[effect][0]
        start = start_values(direction, problem, own_parameters(effect)[0], improvement.amount)
        return ScreenedCandidate(scored.model, effect, start, improvement)

    return parallel_map(predict, list(chosen.items()))
