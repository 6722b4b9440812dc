"""Confirmation of named causes by validation data, and removal of those that are refuted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from fmus.kit.arrays import Array, Indices
from orchestration.discrepancy.candidates import (
    FittedCandidate,
    PairedInnovations,
    PairedScore,
    paired_score,
)
from orchestration.discrepancy.data import ValidationData, is_at_rest, telling_of_simulation
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection import FAILURES, Selection, Step
from orchestration.discrepancy.validation.prediction import Prediction, judged_innovations, predict

_BLOCKS = 24  # that a standard error is estimated from
_LEAST = 32  # samples in each: more than the memory of the noise
_OVER_UNSEEN = "the data held out, as it was fitted"
_OTHERS = 3  # candidates that are judged in the place of one that is refuted
_SURE = 2.0  # standard errors
# of the error of a free run, up to which it must fall for that alone to confirm a cause
_NEARER = 0.8
# gain that is expected, below which an effect does not act: a factor of 1.6 in the likelihood
_IDLE = 0.5


class Outcome(StrEnum):
    """Judgement of unseen data on a cause."""

    CONFIRMED = "confirmed"
    NOT_POSSIBLE = "not_possible"
    REFUTED = "refuted"


@dataclass(frozen=True)
class FreeRunGain:
    """Comparison of the free runs of two models on unseen data.

    Attributes
    ----------
    ratio : float
        RMS error of the richer model over that of the simpler one, each output over its spread.
    fall : float
        By which the mean squared error falls, over its standard error in blocks.
    """

    ratio: float = 1.0
    fall: float = 0.0

    @property
    def surely_nearer(self) -> bool:
        """True if the richer model is nearer by more than a little, surely."""
        return self.ratio < _NEARER and self.fall > _SURE

    @property
    def surely_farther(self) -> bool:
        """True if the richer model is surely farther from the data."""
        return self.fall < -_SURE


@dataclass(frozen=True)
class Confirmation:
    """Evidence of unseen data for or against a cause.

    Attributes
    ----------
    score : PairedScore
        Of the model with it against the one before.
    free_run : FreeRunGain
        Likewise.
    at_rest : bool
        Whether nothing moves there.
    """

    score: PairedScore
    free_run: FreeRunGain = FreeRunGain()
    at_rest: bool = False

    @property
    def outcome(self) -> Outcome:
        """Confirmed if unseen data are surely likelier, or nearer, with the cause; or refuted.

        A likelihood is of what changes from one sample to the next, given the noise as it was
        estimated. Where that is of a long memory, a simulation may be much nearer and no likelier;
        what it comes nearer by is no noise. So a free run that is surely nearer confirms a cause,
        and one that is surely farther does not.

        A cause is refuted that makes unseen data less likely, if that is sure, or if the gain that
        the effect as fitted should have there is more than its noise.
        """
        score = self.score
        likelier = score.gain > _SURE * score.standard_error
        if self.free_run.surely_nearer or (likelier and not self.free_run.surely_farther):
            return Outcome.CONFIRMED
        surely_worse = score.gain < -_SURE * score.standard_error or self.free_run.surely_farther
        powerful = score.expected > score.expected_error
        if not likelier and (surely_worse or (score.gain < 0.0 and powerful)):
            return Outcome.REFUTED
        return Outcome.NOT_POSSIBLE

    @property
    def idle(self) -> bool:
        """True if the effect, as fitted, does next to nothing there."""
        return self.score.expected < _IDLE


@dataclass(frozen=True)
class ConfirmedSelection:
    """A selection without the steps that unseen data refute.

    Attributes
    ----------
    selection : Selection
    predictions : list of Prediction
        Of the base model and of every step that is kept.
    confirmations : dict of str to Confirmation
        By the name of the effect.
    notes : list of Note
        On what is not claimed.
    """

    selection: Selection
    predictions: list[Prediction]
    confirmations: dict[str, Confirmation]
    notes: list[Note]

    def without_steps(self, validation: ValidationData) -> ConfirmedSelection:
        """Return the same with nothing named; what was is rejected."""
        if not self.selection.steps:
            return self
        bare = _without(self.selection, 0)
        return ConfirmedSelection(bare, [predict(validation, bare.base)], {}, self.notes)


def confirm(
    selection: Selection,
    validation: ValidationData,
    reported: Callable[[FittedCandidate, FittedCandidate], FittedCandidate],
) -> ConfirmedSelection:
    """Judge every step of a selection against the one before on unseen data.

    In the place of a step that is refuted stands another shape of it, or what the record could not
    tell from it, if unseen data confirm that; else it is dropped. With it goes all that rests on
    it.

    Parameters
    ----------
    selection : Selection
    validation : ValidationData
    reported : callable
        Returns a model as it is reported, given the one below it.
    """
    with telling_of_simulation(selection.base.candidate.cls, _OVER_UNSEEN):
        predictions = [predict(validation, selection.base)]
    notes: list[Note] = []
    confirmations = dict[str, Confirmation]()
    at_rest = is_at_rest(validation.data, validation.judged)
    for k, step in enumerate(selection.steps):
        before = predictions[-1]
        judged = _judge(validation, before, selection.steps[k:], at_rest)
        if isinstance(judged, Note):
            notes.append(judged)
            selection = _without(selection, k)
            better = _first_confirmed(validation, before, _next_best(step), reported, at_rest)
            if better is None:
                break
            judged = better
            step = _in_place(step, better[0].model)
            selection.steps.append(step)
        prediction, confirmation = judged
        # of a model before the best one none but its errors are asked for any more
        predictions[-1] = replace(before, sensitivities={})
        predictions.append(prediction)
        confirmations[step.chosen.effect_name] = confirmation
        if notes:
            break
    return ConfirmedSelection(selection, predictions, confirmations, notes)


def _judge(
    validation: ValidationData, before: Prediction, steps: Sequence[Step], at_rest: bool
) -> tuple[Prediction, Confirmation] | Note:
    """Judge the first of some steps against the model before it.

    Returns
    -------
    tuple of Prediction and Confirmation, or Note
        A note where it is refuted, or cannot be simulated where nothing was fitted: why it, and all
        that rests on it, is not claimed.
    """
    model = steps[0].chosen
    try:
        prediction = predict(validation, model)
    except FAILURES as error:
        reason = f"over the part held out, {error}"
        return Note(NoteCode.NOT_SIMULATED, model.effect_name, {"reason": reason})
    confirmation = compare(validation, before, prediction, at_rest)
    if confirmation.outcome is Outcome.REFUTED:
        return _refutation(steps, confirmation)
    return prediction, confirmation


def _without(selection: Selection, first: int) -> Selection:
    """Return a selection without a step and all after it; what they tried is rejected."""
    refuted = selection.steps[first]
    chosen = (refuted.chosen, refuted.gain)
    others = [(one, refuted.gains[one.effect_name]) for one in refuted.alternatives]
    rejected = [chosen, *others, *refuted.rejected]
    return replace(selection, steps=selection.steps[:first], rejected=rejected)


def _refutation(steps: Sequence[Step], confirmation: Confirmation) -> Note:
    """Return the note on steps the first of which is refuted."""
    names = ", ".join(step.chosen.effect_name for step in steps)
    gains = {"score": confirmation.score.gain, "expected": confirmation.score.expected}
    return Note(NoteCode.NOT_VALIDATED, names, gains)


def _first_confirmed(
    validation: ValidationData,
    before: Prediction,
    others: Sequence[FittedCandidate],
    reported: Callable[[FittedCandidate, FittedCandidate], FittedCandidate],
    at_rest: bool,
) -> tuple[Prediction, Confirmation] | None:
    """Return the first of some models that unseen data confirm, as it is reported."""
    for other in others:
        with suppress(*FAILURES):
            prediction = predict(validation, reported(other, before.model))
            confirmation = compare(validation, before, prediction, at_rest)
            if confirmation.outcome is Outcome.CONFIRMED:
                return prediction, confirmation
    return None


def _next_best(step: Step) -> list[FittedCandidate]:
    """Return other shapes of what a step named, and what cannot be told from it, best first."""
    others = [*step.shapes, *step.alternatives]
    return sorted(others, key=lambda fitted: -step.gains.get(fitted.effect_name, 0.0))[:_OTHERS]


def _in_place(step: Step, other: FittedCandidate) -> Step:
    """Return a step that names another of its candidates."""
    named = other.effect_name
    gain = step.gains[named]
    return replace(
        step,
        chosen=other,
        gain=gain,
        evidence=gain,
        alternatives=[],
        rejected=[row for row in step.rejected if row[0].effect_name != named],
        confounding={},
    )


def compare(
    validation: ValidationData, before: Prediction, after: Prediction, at_rest: bool
) -> Confirmation:
    """Hold a model against the one before where nothing was fitted."""
    gain = free_run_gain(validation, before, after)
    return Confirmation(score(validation, before, after), gain, at_rest)


def free_run_gain(validation: ValidationData, before: Prediction, after: Prediction) -> FreeRunGain:
    """Compare the free runs of two models where nothing was fitted."""
    falls = []
    squares = np.zeros(2)
    for output, y in validation.data.measured.items():
        judged = np.flatnonzero(np.isfinite(y) & validation.judged)
        variance = float(np.var(y[judged]))
        if not variance > 0.0:
            continue
        errors = np.array([y[judged] - one.simulated[output][judged] for one in (before, after)])
        weighed = errors**2 / (variance * judged.size)
        squares += weighed.sum(axis=1)
        falls.append(np.bincount(_blocks(judged), weights=weighed[0] - weighed[1]))
    if not squares.all():
        return FreeRunGain()
    blocks = np.concatenate(falls)
    scatter = float(np.std(blocks, ddof=1)) * blocks.size**0.5 if blocks.size > 1 else np.inf
    fall = float(blocks.sum() / scatter) if scatter > 0.0 else 0.0
    return FreeRunGain(float(np.sqrt(squares[1] / squares[0])), fall)


def score(validation: ValidationData, before: Prediction, after: Prediction) -> PairedScore:
    """Score a model against the one before where nothing was fitted, in the noise of its own fit.

    A sample that is far out for both counts little in heavy tails, and as little for one as for the
    other.
    """
    noise = after.model.fit.noise
    simpler, simpler_slopes = judged_innovations(validation, before, noise)
    richer, richer_slopes = judged_innovations(validation, after, noise)
    samples = {
        o: np.flatnonzero(np.isfinite(y) & validation.judged)
        for o, y in validation.data.measured.items()
    }
    ends = np.cumsum([len(at) for at in samples.values()])[:-1]
    smaller = np.split(np.minimum(np.abs(simpler), np.abs(richer)), ends)
    weights = [noise[o].weights(r) for o, r in zip(samples, smaller, strict=True)]
    root = np.sqrt(np.concatenate(weights))
    return paired_score(
        _weighted(simpler, simpler_slopes, root, before),
        _weighted(richer, richer_slopes, root, after),
        _blocks(np.concatenate(list(samples.values()))),
    )


def _weighted(
    innovations: Array, slopes: Array, root: Array, prediction: Prediction
) -> PairedInnovations:
    """Weight innovations (m,) and their Jacobian (m, p) by the roots (m,) of weights."""
    covariance = prediction.model.fit.covariance.matrix
    return PairedInnovations(innovations * root, slopes * root[:, np.newaxis], covariance)


def _blocks(samples: Indices) -> Indices:
    """Assign samples (m,) to blocks that are contiguous in time and of equal length."""
    rank = np.unique(samples, return_inverse=True)[1]
    count = int(rank.max()) + 1
    return np.asarray(rank * min(max(count // _LEAST, 1), _BLOCKS) // count)
