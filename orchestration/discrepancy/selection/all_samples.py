"""Fits to every sample of a record of which the search saw a stretch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset, longer_stretch, worst_stretch
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection.input_noise import simulated
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.discrepancy.selection.stepwise import (
    ACCEPT,
    Selection,
    Step,
    whitens_residual,
)
from orchestration.identify.fitting import Method

# The search has found the optimum of a stretch, which that of all samples is near.
_NEARBY = Method(tolerance=0.5, passes=2, restarts=0, near=True)


def base_over_all_samples(
    search: Search, base: FittedCandidate, data: Dataset, parameters: Sequence[str]
) -> tuple[Search, FittedCandidate]:
    """Fit the model without effects to every sample.

    Parameters
    ----------
    search : Search
        Over a stretch of the record.
    base : FittedCandidate
        Fitted there.
    data : Dataset
        All that is to be fitted to.
    parameters : sequence of str
        Of the model, that may leave a trace in it.

    Returns
    -------
    search, base
        Over all of the data.

    Raises
    ------
    UserError
        If the model cannot be simulated over the data.
    """
    search.progress("fitting base to all of the record")
    every = replace(search, data=data, parameters=list(parameters), method=_NEARBY)
    return every.drop_insensitive(every.nominal(base.fit.values))


def steps_over_all_samples(
    search: Search, base: FittedCandidate, selection: Selection
) -> Selection:
    """Fit the models of a selection to every sample, and keep the effects that these ask for too.

    Parameters
    ----------
    search : Search
        Over all of the record.
    base : FittedCandidate
        The model without effects, fitted there.
    selection : Selection
        Made in a stretch.

    Returns
    -------
    Selection
        Gains, alternatives and rejected effects are those of the stretch.
    """
    below = base
    steps: list[Step] = []
    for step in selection.steps:
        try:
            fitted = search.containing(search.refit_over(step.chosen, below), below)
        except FAILURES:
            break
        evidence = fitted.delta_bic(below, selection.tried)
        if evidence <= ACCEPT and not whitens_residual(below, fitted):
            break
        steps.append(replace(step, chosen=fitted, evidence=evidence))
        below = fitted
    dropped = selection.steps[len(steps) :]
    return replace(
        selection,
        base=base,
        steps=steps,
        rejected=[*((step.chosen, step.gain) for step in dropped), *selection.rejected],
        unsure=selection.unsure | {step.chosen.effect_name for step in dropped},
        compared=(selection.base, *(step.chosen for step in selection.steps[: len(steps)])),
    )


def dropped_notes(found: Selection, kept: Selection) -> list[Note]:
    """Return the note on effects that a stretch asks for and all samples do not, if there are any.

    Parameters
    ----------
    found : Selection
        Made in the stretch.
    kept : Selection
        What is left of it over all samples.
    """
    dropped = found.steps[len(kept.steps) :]
    names = ", ".join(step.chosen.effect_name for step in dropped)
    return [Note(NoteCode.NOT_IN_ALL_SAMPLES, names)] if dropped else []


def at_worst(search: Search, whole: Search, base: FittedCandidate) -> Search:
    """Return a search where the model without effects is clearly worse than in the stretch at hand.

    Parameters
    ----------
    search : Search
        Over a stretch of the record.
    whole : Search
        Over all of it.
    base : FittedCandidate
        Fitted to all of it.

    Returns
    -------
    Search
        The same if no stretch is clearly worse.
    """
    data = whole.data
    errors = np.zeros(len(data.time))
    for output, noise in base.fit.noise.items():
        squares = (base.fit.residual[output] / noise.deviation) ** 2
        errors[base.problem.present[output]] += squares
    stretch = worst_stretch(data, search.data, errors)
    if stretch is search.data:
        return search
    return _begun_at(search, stretch, whole, base)


def over_longer(search: Search, whole: Search, base: FittedCandidate) -> Search:
    """Return a search over a stretch several times as long; see `at_worst`."""
    return _begun_at(search, longer_stretch(whole.data, search.data), whole, base)


def _begun_at(search: Search, stretch: Dataset, whole: Search, base: FittedCandidate) -> Search:
    """Return a search over a stretch, from the states that the model has where it begins."""
    first = int(np.searchsorted(whole.data.time, stretch.time[0]))
    fixed = dict(search.fixed)
    if first > 0:
        states = simulated(whole, base, whole.data)
        layout = base.candidate.cls.layout
        fixed |= {layout.start_of[s.name]: float(states[s.name][first]) for s in layout.states}
    return replace(search, data=stretch, fixed=fixed)
