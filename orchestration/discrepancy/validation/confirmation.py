"""Confirmation: what unseen data say of every cause that was named where was fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.candidates.paired_score import Innovations, PairedScore, paired_score
from orchestration.discrepancy.data.holdout import ValidationData, is_at_rest
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection.stepwise import Selection
from orchestration.discrepancy.validation.prediction import Prediction, judged_innovations, predict

_BLOCKS = 24  # that a standard error is told by
_LEAST = 32  # samples in each: more than the memory of the noise
_SURE = 2.0  # standard errors
_IDLE = 0.5  # gain that is expected, below which an effect does not act: a factor of 1.6 in the likelihood


class Outcome(StrEnum):
    """What unseen data say of a cause."""

    CONFIRMED = "confirmed"
    NOT_POSSIBLE = "not_possible"
    REFUTED = "refuted"


@dataclass(frozen=True)
class Confirmation:
    """What unseen data say of a cause.

    Attributes
    ----------
    score : PairedScore
        Of the model with it against the one before.
    at_rest : bool
        Whether nothing moves there.
    """

    score: PairedScore
    at_rest: bool = False

    @property
    def outcome(self) -> Outcome:
        """Whether unseen data are surely likelier with it, are not though they should be, or tell nothing.

        Refuted is what makes them less likely, if that is sure, or if what the effect as fitted should gain there is
        more than its noise.
        """
        score = self.score
        if score.gain > _SURE * score.standard_error:
            return Outcome.CONFIRMED
        surely_worse = score.gain < -_SURE * score.standard_error
        powerful = score.expected > score.expected_error
        return (
            Outcome.REFUTED
            if surely_worse or (score.gain < 0.0 and powerful)
            else Outcome.NOT_POSSIBLE
        )

    @property
    def idle(self) -> bool:
        """Whether the effect, as fitted, does next to nothing there."""
        return self.score.expected < _IDLE


@dataclass(frozen=True)
class Confirmed:
    """A selection less what unseen data refute.

    Attributes
    ----------
    selection : Selection
    predictions : list of Prediction
        Of the base model and of every step that is kept.
    confirmations : dict of str to Confirmation
        By the name of the effect.
    notes : list of Note
        What is not claimed.
    """

    selection: Selection
    predictions: list[Prediction]
    confirmations: dict[str, Confirmation]
    notes: list[Note]


def confirmed(selection: Selection, validation: ValidationData) -> Confirmed:
    """Hold every step against the one before on unseen data, and drop it and what rests on it where it is refuted."""
    predictions, confirmations = [predict(validation, selection.base)], dict[str, Confirmation]()
    still = is_at_rest(validation.data, validation.judged)
    for k, step in enumerate(selection.steps):
        prediction = predict(validation, step.chosen)
        found = Confirmation(score(validation, predictions[-1], prediction), still)
        if found.outcome is Outcome.REFUTED:
            subject = ", ".join(s.chosen.effect_name for s in selection.steps[k:])
            facts = {"score": found.score.gain, "expected": found.score.expected}
            kept = replace(selection, steps=selection.steps[:k])
            return Confirmed(
                kept, predictions, confirmations, [Note(NoteCode.NOT_VALIDATED, subject, facts)]
            )
        predictions.append(prediction)
        confirmations[step.chosen.effect_name] = found
    return Confirmed(selection, predictions, confirmations, [])


def score(validation: ValidationData, before: Prediction, after: Prediction) -> PairedScore:
    """Hold a model against the one before where nothing was fitted, in the noise of its own fit.

    A sample that is far out for both counts little in heavy tails, and as little for one as for the other.
    """
    noise = after.model.fit.noise
    (r0, j0), (r1, j1) = (judged_innovations(validation, p, noise) for p in (before, after))
    judged = {
        o: np.flatnonzero(np.isfinite(y) & validation.judged)
        for o, y in validation.data.measured.items()
    }
    nearest = np.split(
        np.minimum(np.abs(r0), np.abs(r1)), np.cumsum([len(at) for at in judged.values()])[:-1]
    )
    root = np.sqrt(
        np.concatenate([noise[o].weights(r) for o, r in zip(judged, nearest, strict=True)])
    )
    simpler, richer = (
        Innovations(r * root, j * root[:, np.newaxis], p.model.fit.covariance.matrix)
        for r, j, p in ((r0, j0, before), (r1, j1, after))
    )
    return paired_score(simpler, richer, _blocks(np.concatenate(list(judged.values()))))


def _blocks(samples: NDArray[np.intp]) -> NDArray[np.intp]:
    """Contiguous blocks (m,) of samples in time, as long as each other."""
    rank = np.unique(samples, return_inverse=True)[1]
    count = int(rank.max()) + 1
    return np.asarray(rank * min(max(count // _LEAST, 1), _BLOCKS) // count)
