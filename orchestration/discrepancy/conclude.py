"""The conclusion of a diagnosis: what a selected model is worth, its parameters, and the verdict.

It is drawn in one place, whether the selected effects come from the catalogue or from a law that
was found to lack something.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from orchestration.discrepancy.candidates import FittedCandidate, label
from orchestration.discrepancy.data import Dataset, ValidationData
from orchestration.discrepancy.final_model import (
    DiagnosisData,
    ParameterAssessment,
    has_unexplained_structure,
    judged_in_reason,
)
from orchestration.discrepancy.note import MIXED_UP, Note, NoteCode
from orchestration.discrepancy.residuals import (
    ResidualAnalysis,
    ResidualTest,
    residual_notes,
    robust_power,
)
from orchestration.discrepancy.selection import (
    SOLVER_ERROR,
    Intersample,
    Search,
    Selection,
    pooled,
    solver_error_notes,
)
from orchestration.discrepancy.validation import (
    Confirmation,
    ConfirmedSelection,
    Errors,
    errors_in_variables,
    model_errors,
    unpredicted_output_notes,
)
from orchestration.identify.uncertainty import Estimate

DEGRADED = 1.1  # times the error before, above which it has grown
_LARGE = 0.15  # of the spread of an output, from which on an error is large
_HOPELESS = 0.6  # of that spread, from which on a model does not describe a record
_SPREAD = 1.0  # of that spread: the error of a model that is no nearer than the mean
_ROUNDED = 0.5  # of a step of the recorder, within which it rounds; as RMS it is 0.29
_FEWEST_MOVING = 20  # samples that move by a step or more, to judge rounding by them alone
_SLOW = 0.5  # of its power, which innovations have less of where it changes slowly
CONFOUNDED_SHARE = 0.75  # of what an effect does that another would do too, to be noted


class Verdict(StrEnum):
    """The verdict of a diagnosis (DESIGN, section 8)."""

    CONSISTENT = "consistent"
    RECALIBRATE = "recalibrate"
    CAUSE = "cause"
    AMBIGUOUS = "ambiguous"
    UNEXPLAINED = "unexplained"


@dataclass(frozen=True)
class Diagnosis:
    """A verdict and what it rests on.

    Attributes
    ----------
    verdict : Verdict
    selection : Selection
        Effects that were named and not refuted, and what was tried beside them.
    estimates : dict of str to Estimate
        Of the best model, fitted to all that was measured.
    changed : list of str
        Parameters that differ significantly from nominal, the surest first.
    residuals : dict of str to ResidualAnalysis
        By output, of the best model over the estimation data.
    fitted_errors, judged_errors : dict of str to dict of str to float
        Normalised RMS errors of free runs over the estimation and the validation data, by model and
        output; see `model_errors`.
    estimation : Dataset
        What was fitted to.
    validation : ValidationData
        What was held out.
    final : FittedCandidate
        The best model fitted to all that was measured, now that its gain is known; the estimates
        are its.
    notes : list of Note
        What could not be assessed, and why.
    intersample : dict of str to Intersample
        What every input that moves is taken to do between samples.
    structure_of_input_noise : frozenset of tuple of str and type
        Kinds of structure, by output, that noise on the inputs makes by itself.
    confirmations : dict of str to Confirmation
        What the validation data say of every effect that was named, by its name.
    """

    verdict: Verdict
    selection: Selection
    estimates: dict[str, Estimate]
    changed: list[str]
    residuals: dict[str, ResidualAnalysis]
    fitted_errors: Errors
    judged_errors: Errors
    estimation: Dataset
    validation: ValidationData
    final: FittedCandidate
    notes: list[Note] = field(default_factory=list)
    intersample: dict[str, Intersample] = field(default_factory=dict)
    structure_of_input_noise: frozenset[tuple[str, type]] = frozenset()
    confirmations: dict[str, Confirmation] = field(default_factory=dict)

    def unexplained_structure(self, output: str) -> list[ResidualTest]:
        """Return structure in the residual of an output that input noise does not make by itself.

        The most telling comes first.
        """
        return [
            s
            for s in self.residuals[output].structure
            if (output, type(s)) not in self.structure_of_input_noise
        ]

    @property
    def before(self) -> dict[str, float]:
        """Normalised RMS error of the refitted model on the validation data, by output."""
        return self.judged_errors["refitted"]

    @property
    def after(self) -> dict[str, float]:
        """Normalised RMS error of the best model on the validation data, by output."""
        return self.judged_errors.get("extended", self.before)

    @property
    def usable(self) -> Dataset:
        """All measured data that the final model was fitted to."""
        problem = self.final.problem
        several = problem.runs if len(problem.runs) > 1 else ()
        return Dataset(
            problem.time, problem.inputs, problem.measured, self.estimation.linear, several
        )

    @property
    def causes(self) -> list[str]:
        """Effects that are named as causes; those that correct the shape of one are none."""
        return [step.chosen.effect_name for step, *_ in self.selection.by_cause]

    @property
    def alternatives(self) -> list[str]:
        """Effects that the record cannot tell from those that were selected."""
        return [other.effect_name for step in self.selection.steps for other in step.alternatives]

    @property
    def explained(self) -> bool:
        """True if the effects named, or parameters, account for all that the record shows."""
        beside = {NoteCode.SOMETHING_LEFT, NoteCode.IMPLAUSIBLE}
        return self.verdict is not Verdict.UNEXPLAINED and not beside & {
            note.code for note in self.notes
        }

    @property
    def inconclusive(self) -> bool:
        """True if nothing can be said of the model: nothing was excited, or nothing was fitted."""
        return self.verdict is Verdict.AMBIGUOUS and not self.causes


def errors_fall(before: Mapping[str, float], after: Mapping[str, float]) -> bool:
    """Return whether the error fell in some output and grew noticeably in none."""
    falls = any(after[o] < before[o] for o in before)
    grows = any(after[o] > DEGRADED * before[o] for o in before)
    return falls and not grows


def conclude(
    search: Search,
    judged: ConfirmedSelection,
    data: DiagnosisData,
    *,
    improves: Callable[[Mapping[str, float], Mapping[str, float]], bool] = errors_fall,
) -> Diagnosis:
    """Draw the conclusion from a selection of effects that was judged on unseen data.

    The best model is fitted to all that was measured, its parameters get their intervals, its
    residuals are analysed, and the verdict follows from what it does not account for.

    Parameters
    ----------
    search : Search
        Fits of models over the estimation data.
    judged : ConfirmedSelection
        The selection less what unseen data refute, with its predictions of these.
    data : DiagnosisData
    improves : callable
        Given the errors on unseen data without and with the effects, by output, returns whether
        the effects are worth having; if not, a note says so.

    Returns
    -------
    Diagnosis

    Raises
    ------
    UserError
        If the best model cannot be simulated over the data.
    """
    if _describes_nothing(judged):
        judged = judged.without_steps(data.validation)
    if _is_below_resolution(judged.selection.base, data):
        judged = judged.without_steps(data.validation)
    outcome = judged_in_reason(search, judged, data)
    judged = outcome.judged
    selection = judged.selection
    residuals = outcome.residuals
    parameters = outcome.parameters
    outcome.model.problem.forget_simulation()
    of_input_noise = errors_in_variables.structure_of_input_noise(
        residuals, selection, search, data.input_noise
    )
    remainder = _remainder(judged, residuals, of_input_noise, data)
    is_misread = any(note.code in MIXED_UP for note in data.notes)
    doubts = _doubts(judged, remainder.structure, improves, is_misread)
    notes = [
        *data.notes,
        *judged.notes,
        *outcome.notes,
        *parameters.notes,
        *(note for _, note in sorted(search.not_assessed.items())),
        *_confounding_notes(selection),
        *remainder.residual_notes,
        *remainder.unfollowed,
        *doubts,
        *search.budget.notes,
    ]
    misfit = remainder.structure or parameters.implausible
    misfit = misfit or is_misread or bool(remainder.unfollowed or doubts)
    fitted_errors, judged_errors = model_errors(judged.predictions, data.validation)
    return Diagnosis(
        verdict=_verdict(selection, parameters, misfit, data.informative),
        selection=selection,
        estimates=parameters.estimates,
        changed=parameters.changed,
        residuals=residuals,
        fitted_errors=fitted_errors,
        judged_errors=judged_errors,
        estimation=data.estimation,
        validation=data.validation,
        final=outcome.model,
        notes=notes,
        intersample=data.intersample,
        structure_of_input_noise=of_input_noise,
        confirmations=judged.confirmations,
    )


def _describes_nothing(judged: ConfirmedSelection) -> bool:
    """Return whether a model misses nearly all of a record, or much of it and the unseen data."""
    large = _large_errors(judged.selection.best)
    unseen = judged.predictions[-1].errors.values()
    return max(large.values(), default=0.0) > _HOPELESS or bool(large and min(unseen) > _SPREAD)


def _is_below_resolution(base: FittedCandidate, data: DiagnosisData) -> bool:
    """Return whether a model misses no output by more than its recorder rounds, where that moves.

    Rounding is no noise: it goes with the signal, and any effect may follow some of it. At rest a
    model misses little, whatever it lacks.
    """
    steps = {
        note.subject: note.facts["resolution"]
        for note in data.notes
        if note.code is NoteCode.QUANTISED
    }
    for output, residual in base.fit.residual.items():
        if output not in steps:
            return False
        measured = base.problem.measured[output][base.problem.present[output]]
        moving = np.abs(np.gradient(measured)) >= steps[output]
        counted = residual[moving] if moving.sum() >= _FEWEST_MOVING else residual
        if not float(np.std(counted)) < _ROUNDED * steps[output]:
            return False
    return True


class _Remainder(NamedTuple):
    """Remainder of a record that the best model does not account for.

    Attributes
    ----------
    structure : bool
        Whether residuals hold structure.
    residual_notes : list of Note
    unfollowed : list of Note
        On outputs that it does not predict as well as the fit lets expect.
    """

    structure: bool
    residual_notes: list[Note]
    unfollowed: list[Note]


def _remainder(
    judged: ConfirmedSelection,
    residuals: Mapping[str, ResidualAnalysis],
    of_input_noise: frozenset[tuple[str, type]],
    data: DiagnosisData,
) -> _Remainder:
    """Gather what the best model does not account for; an error of a solver is nothing of it."""
    selection = judged.selection
    prediction = judged.predictions[-1]
    unfollowed = unpredicted_output_notes(data.validation, prediction)
    of_solver = solver_error_notes(selection.best)
    if not of_solver:
        structure = has_unexplained_structure(selection, residuals, of_input_noise)
        return _Remainder(structure, [*residual_notes(residuals)], unfollowed)
    is_followed = max(prediction.errors.values()) <= SOLVER_ERROR
    return _Remainder(False, of_solver, [] if is_followed else unfollowed)


def _doubts(
    judged: ConfirmedSelection,
    structure_remains: bool,
    improves: Callable[[Mapping[str, float], Mapping[str, float]], bool],
    is_misread: bool,
) -> list[Note]:
    """Return the notes on what speaks against the best model, whatever its causes gained.

    Where it is known what is wrong with the record, outputs may well follow inputs.
    """
    best = judged.selection.best
    if not judged.selection.steps:
        large = _large_errors(best)
        if not large:
            return []
        facts = {"outputs": tuple(large), "share": max(large.values())}
        is_hopeless = pooled([large.get(output, 0.0) ** 2 for output in best.fit.noise]) > _HOPELESS
        is_unrelated = is_hopeless and not is_misread
        return [Note(NoteCode.UNRELATED if is_unrelated else NoteCode.LARGE_ERROR, "", facts)]
    doubts = []
    if structure_remains:
        doubts.append(Note(NoteCode.SOMETHING_LEFT))
    if not improves(judged.predictions[0].errors, judged.predictions[-1].errors):
        doubts.append(Note(NoteCode.NO_GAIN))
    return doubts


def _large_errors(best: FittedCandidate) -> dict[str, float]:
    """Return by output the errors so large, and so slow, that a model cannot be fine.

    A noise model with a long memory follows any slow error, and leaves a residual that is white.

    Returns
    -------
    dict of str to float
        RMS error over the spread.
    """
    missed = {}
    for output, noise in best.fit.noise.items():
        measured = best.problem.measured[output][best.problem.present[output]]
        residual = best.fit.residual[output]
        spread = float(np.std(measured))
        share = float(np.std(residual)) / spread if spread else 0.0
        follows = robust_power(best.fit.innovation[output]) * noise.deviation**2
        if share > _LARGE and follows < _SLOW * robust_power(residual):
            missed[output] = share
    return missed


def _confounding_notes(selection: Selection) -> list[Note]:
    """Note the effects not named that would do much of what a named one does."""
    named = {label(effect) for effect in selection.best.candidate.effects}
    notes = []
    for step in selection.steps:
        known = named | {alternative.effect_name for alternative in step.alternatives}
        confounders = {
            name: share
            for name, share in step.confounding.items()
            if share > CONFOUNDED_SHARE and name not in known
        }
        if confounders:
            shares = dict(sorted(confounders.items(), key=lambda item: -item[1]))
            notes.append(Note(NoteCode.CONFOUNDED, step.chosen.effect_name, {"shares": shares}))
    return notes


def _verdict(
    selection: Selection, parameters: ParameterAssessment, misfit: bool, informative: bool
) -> Verdict:
    """Return the verdict; a cause that is named and not refuted goes before any misfit."""
    if not informative:
        return Verdict.AMBIGUOUS
    if selection.steps:
        ambiguous = any(step.alternatives for step in selection.strong)
        return Verdict.AMBIGUOUS if ambiguous else Verdict.CAUSE
    if misfit:
        return Verdict.UNEXPLAINED
    return Verdict.RECALIBRATE if parameters.changed else Verdict.CONSISTENT
