"""Screening of effects: their score directions at a fitted model, and the gain of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from fmus.kit import Effect
from orchestration.discrepancy.candidates import (
    FittedCandidate,
    ScoreDirections,
    ScoredModel,
    ScreenedCandidate,
    label,
    own_parameters,
    score_directions,
    simulated_directions,
    strongest,
)
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import Counter, parallel_map
from orchestration.discrepancy.selection.search import FAILURES, Search

PROMISING = 8  # effects that are fitted, if they are worth it
WORTH = 5.0  # fall that is expected of a fit, below which it cannot come to what is accepted
# of the largest fall that is expected of any, below which a fit cannot come near the best one
COMPARABLE = 0.15
_UNIDENTIFIABLE = 1e-6  # share of an effect, in power, below which other parameters do the same


def score(search: Search, below: FittedCandidate, effects: Sequence[type[Effect]]) -> ScoredModel:
    """Find how every effect would move a fitted model."""
    counter = Counter(search.progress, "scoring effects", len(effects))
    linear = search.data.inputs if search.data.linear is True else search.data.linear or ()
    directions: dict[type[Effect], ScoreDirections] = {}
    to_simulate = []
    for effect, found in score_directions(below, effects, linear):
        if found is None:
            to_simulate.append(effect)
            continue
        directions[effect] = found
        counter.one_more()

    def simulate(effect: type[Effect]) -> None:
        if search.budget.spent():
            search.budget.leave([label(effect)])
            return
        fixed = {**search.fixed, **below.fit.values}
        try:
            candidate = below.candidate.with_effect(effect)
            problem = search.problem(candidate, own_parameters(effect), fixed)
            directions[effect] = simulated_directions(problem, effect)
        except FAILURES as error:
            name = label(effect)
            note = Note(NoteCode.NOT_SIMULATED, name, {"reason": str(error)})
            search.not_assessed[name] = note
        counter.one_more()

    parallel_map(simulate, to_simulate)
    return ScoredModel(below, directions)


def unidentifiable(scored: ScoredModel) -> dict[str, Note]:
    """Return notes on effects of which a record says nothing, by their label."""
    model = scored.linearised
    notes = {}
    for effect, directions in scored.directions.items():
        name = label(effect)
        if not directions.settings:
            notes[name] = Note(NoteCode.NO_TRACE, name)
        elif (model.identifiable_shares(directions) < _UNIDENTIFIABLE).all():
            notes[name] = Note(NoteCode.UNIDENTIFIABLE, name)
    return notes


def confounding(
    scored: ScoredModel, effect: type[Effect], others: Sequence[type[Effect]]
) -> dict[str, float]:
    """Return by label the share of an effect, beyond its base model, that each other makes too."""
    model = scored.linearised
    own = scored.directions[effect]
    _, in_white = model.score_statistics(own)
    shares = model.confounded_shares(own, int(np.argmax(in_white)))
    largest = {}
    for other in others:
        directions = scored.directions.get(other)
        if directions is None:
            continue
        # of a little of it only: a lot of it may look like anything
        little = np.array([one.least <= 0.0 for one in directions.settings], dtype=bool)
        largest[label(other)] = float(shares(directions)[little].max(initial=0.0))
    return largest


def screen(scored: ScoredModel, effects: Sequence[type[Effect]]) -> list[ScreenedCandidate]:
    """Return starts for fits of effects, at the best score in coloured or white noise."""
    starts: list[ScreenedCandidate] = []
    for effect in effects:
        directions = scored.directions.get(effect)
        if directions is None:
            continue
        # what cannot be foretold, such as where a response runs away, is no start
        with suppress(*FAILURES):
            starts += _screened(scored, directions)
    return starts


def _screened(scored: ScoredModel, directions: ScoreDirections) -> list[ScreenedCandidate]:
    """Return starts for fits of one effect.

    The noise as estimated may have swallowed a slow effect, and white noise knows nothing of
    colour: both count.
    """
    model = scored.linearised
    starts = []
    for k in strongest(model.score_statistics(directions)):
        improvement = model.predicted_improvement(directions, k)
        start = directions.start_values(k, improvement.amount)
        starts.append(ScreenedCandidate(scored.model, directions.effect, start, improvement))
    return starts
