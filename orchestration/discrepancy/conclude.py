"""The conclusion of a diagnosis: what a selected model is worth, its parameters, and the verdict.

It is drawn in one place, whether the selected effects come from the catalogue or from a law that
was found to lack something.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from fmus.kit import Effect
from orchestration.discrepancy.candidates import FittedCandidate, label
from orchestration.discrepancy.data import Dataset, ValidationData
from orchestration.discrepancy.note import MIXED_UP, Note, NoteCode
from orchestration.discrepancy.residuals import (
    ResidualAnalysis,
    Structure,
    analyse_residuals,
    residual_notes,
    robust_power,
)
from orchestration.discrepancy.selection import (
    ACCEPT,
    ALTERNATIVE,
    FAILURES,
    SOLVER_ERROR,
    Intersample,
    Search,
    Selection,
    Step,
    as_reported_models,
    interchangeable,
    intersample,
    solver_error_notes,
    without_effect,
)
from orchestration.discrepancy.validation import (
    Confirmation,
    ConfirmedSelection,
    Errors,
    by_likelihood_ratio,
    confirm,
    deviation_beside_fit,
    errors_in_variables,
    free_run_gain,
    identifiability_notes,
    implausible,
    model_errors,
    neutral_value,
    parameter_estimates,
    significantly_changed,
    straight_parts,
    undetermined_effects,
    unpredicted_output_notes,
)
from orchestration.identify.fitting import FitResult
from orchestration.identify.uncertainty import Estimate
from orchestration.records import base_name

DEGRADED = 1.1  # times the error before, above which it has grown
# Share of the structure in a residual that may remain beside a cause, which never has quite the
# catalogue's form.
TOLERATED_STRUCTURE = 0.25
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

    def unexplained_structure(self, output: str) -> list[Structure]:
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


@dataclass(frozen=True)
class DiagnosisData:
    """The data that a diagnosis is concluded from, and what was learned about them before.

    Attributes
    ----------
    estimation : Dataset
        What the models of the selection were fitted to.
    validation : ValidationData
        What was held out.
    usable : Dataset
        All that the best model is fitted to at the end.
    more_than_estimation : bool
        Whether `usable` holds more than the estimation data.
    parameters : sequence of str
        Of the base model, that are searched in the final fit.
    intersample : dict of str to Intersample
        What every input that moves is taken to do between samples.
    input_noise : errors_in_variables.InputNoise
        Noise on measured inputs, and what it does to the estimates of the base model.
    informative : bool
        Whether the record can tell anything of the model at all.
    notes : sequence of Note
        On the data and on the search, which come before those on the model.
    """

    estimation: Dataset
    validation: ValidationData
    usable: Dataset
    more_than_estimation: bool
    parameters: Sequence[str]
    intersample: dict[str, Intersample]
    input_noise: errors_in_variables.InputNoise
    informative: bool = True
    notes: Sequence[Note] = ()


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
    outcome = _judged_in_reason(search, judged, data)
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


def _fit_to_all(
    search: Search, best: FittedCandidate, data: DiagnosisData
) -> tuple[FittedCandidate, list[Note]]:
    """Fit the best model to all that was measured; if that fails, keep its fit to the first part.

    Where there is no more than that part, the model is fitted once more only if parameters were
    left out of the search.
    """
    complete = {*map(base_name, best.problem.names)}.issuperset(data.parameters)
    if complete and not data.more_than_estimation:
        return best, []
    whole = replace(search, data=data.usable, parameters=data.parameters)
    try:
        return whole.trusted(whole.refit(best)), []
    except FAILURES as error:
        return best, [Note(NoteCode.NOT_REFITTED, "", {"reason": str(error)})]


@dataclass(frozen=True)
class _ParameterAssessment:
    """Parameters of the final model, and the reservations about them.

    Attributes
    ----------
    estimates : dict of str to Estimate
    changed : list of str
        Those that differ significantly from nominal.
    ratios : dict of str to float
        Those that have a value that no specimen can have: times nominal.
    notes : list of Note
    """

    estimates: dict[str, Estimate]
    changed: list[str]
    ratios: dict[str, float]
    notes: list[Note]

    @property
    def implausible(self) -> bool:
        """Whether a parameter has a value that no specimen can have."""
        return bool(self.ratios)


@dataclass(frozen=True)
class _FinalModel:
    """The best model of a selection, fitted to all that was measured, and what is known of it.

    Attributes
    ----------
    judged : ConfirmedSelection
    model : FittedCandidate
    residuals : dict of str to ResidualAnalysis
        Of the best model over the estimation data.
    parameters : _ParameterAssessment
    notes : list of Note
        On the fit to all that was measured.
    """

    judged: ConfirmedSelection
    model: FittedCandidate
    residuals: dict[str, ResidualAnalysis]
    parameters: _ParameterAssessment
    notes: list[Note]


def _judged_in_reason(
    search: Search, judged: ConfirmedSelection, data: DiagnosisData
) -> _FinalModel:
    """Assess the final model, and drop causes that leave something beside impossible parameters.

    What comes nearer to a record, but not all the way, and only with a plant that no specimen is,
    explains nothing of one. Where impossible parameters do what a cause does, it is named instead.
    """
    outcome = _judged_in_final_model(search, judged, data)
    beside = outcome.parameters
    selection = outcome.judged.selection
    if not beside.implausible:
        return outcome
    if not selection.steps:
        return _with_cause_in_reason(search, outcome, data) or outcome
    if not _has_unexplained_structure(selection, outcome.residuals, frozenset()):
        return outcome
    bare = _assess_final_model(search, judged.without_steps(data.validation), data)
    if bare.parameters.implausible:
        return bare
    parameters = replace(bare.parameters, ratios=beside.ratios, notes=beside.notes)
    return replace(bare, parameters=parameters)


def _with_cause_in_reason(
    search: Search, outcome: _FinalModel, data: DiagnosisData
) -> _FinalModel | None:
    """Return the model with a cause that does what impossible parameters do, if there is one.

    A model bends what it has to what it has no word for. A cause with which the record is no less
    likely, and the plant one that a specimen can be, is judged against the model that has those
    parameters at nominal. It leaves nothing, and columns that are mixed up are no cause.
    """
    selection = outcome.judged.selection
    as_good = _as_likely_as_base(selection)
    if not as_good or any(note.code in MIXED_UP for note in data.notes):
        return None
    names = [name for name in search.parameters if name not in outcome.parameters.ratios]
    try:
        held = replace(search, parameters=names).refit(selection.base)
        chosen = min(as_good, key=_distance_from_nominal)
        if selection.compared:
            chosen = search.refit_over(chosen, selection.base)
        named = Selection(held, tried=selection.tried)
        named.steps.append(_only_step(chosen, held, as_good, selection))
        judged = confirm(named, data.validation, search.trusted)
        if not judged.selection.steps:
            return None
        final = _judged_in_final_model(search, judged, data)
    except FAILURES:
        return None
    reached = final.judged.selection
    is_in_reason = bool(reached.steps) and not final.parameters.implausible
    if not is_in_reason or _has_unexplained_structure(reached, final.residuals, frozenset()):
        return None
    return final


def _as_likely_as_base(selection: Selection) -> list[FittedCandidate]:
    """Return the best rejected candidates with which the record is no less likely than without."""
    base = selection.compared[0] if selection.compared else selection.base
    rivals = [c for c, _ in selection.rejected if c.fit.deviance <= base.fit.deviance]
    least = min((rival.fit.bic for rival in rivals), default=np.inf)
    return [rival for rival in rivals if rival.fit.bic <= least + ALTERNATIVE]


def _distance_from_nominal(fitted: FittedCandidate) -> float:
    """Return how far a model's parameters are from nominal, in searched coordinates."""
    problem = fitted.problem
    physical = [not problem.declared[name].starts for name in problem.names]
    return float(np.linalg.norm((fitted.fit.q - problem.position(problem.start))[physical]))


def _only_step(
    chosen: FittedCandidate,
    below: FittedCandidate,
    as_good: Sequence[FittedCandidate],
    selection: Selection,
) -> Step:
    """Return the step that names a rejected candidate over a model, beside others as good."""
    fitted = [candidate for candidate, _ in selection.rejected]
    tried = selection.tried
    gains = {one.effect_name: one.delta_bic(below, tried) for one in fitted}
    gain = chosen.delta_bic(below, tried)
    others = [one for one in as_good if one.effect is not chosen.effect]
    shapes = [one for one in others if interchangeable(one.effect, chosen.effect)]
    rejected = [one for one in fitted if all(one is not other for other in as_good)]
    return Step(
        chosen=chosen,
        gain=gain,
        evidence=gain,
        p_value=chosen.p_value(below, tried),
        alternatives=[one for one in others if one not in shapes],
        rejected=[(one, gains[one.effect_name]) for one in rejected],
        shapes=shapes,
        gains=gains,
    )


def _judged_in_final_model(
    search: Search, judged: ConfirmedSelection, data: DiagnosisData
) -> _FinalModel:
    """Assess the final model, and drop the causes that may do nothing in it, one after another.

    What was named first was judged without what came after it. A cause without which the record is
    much less likely stays, or without which unseen data are surely farther off: its interval is
    then that of the likelihood ratio, or of how sure that is.
    """
    outcome = _assess_final_model(search, judged, data)
    ratios = dict[type[Effect], float]()
    while True:
        selection = outcome.judged.selection
        estimates = outcome.parameters.estimates
        open_effects = undetermined_effects(outcome.model, estimates)
        effect = next((one for one in open_effects if one not in ratios), None)
        if effect is None:
            break
        shorter = without_effect(search, selection, effect)
        reported = as_reported_models(search, shorter)
        fall = selection.best.delta_bic(reported.best, selection.tried)
        if fall > ACCEPT:
            # the model without it may have more parameters of the noise
            ratio = reported.best.fit.deviance - selection.best.fit.deviance
            ratios[effect] = max(ratio, fall)
            continue
        note = _neutral_note(effect, estimates[effect.neutral])
        anew = confirm(reported, data.validation, search.trusted)
        gain = free_run_gain(data.validation, anew.predictions[-1], outcome.judged.predictions[-1])
        if gain.surely_nearer:
            ratios[effect] = gain.fall**2
            continue
        kept = replace(anew, notes=[*outcome.judged.notes, *anew.notes, note])
        outcome = _assess_final_model(search, kept, data)
    estimates = outcome.parameters.estimates
    needed = {
        effect.neutral: by_likelihood_ratio(estimates[effect.neutral], neutral_value(effect), ratio)
        for effect, ratio in ratios.items()
        if effect.neutral in estimates
    }
    return replace(outcome, parameters=replace(outcome.parameters, estimates=estimates | needed))


def _neutral_note(effect: type[Effect], strength: Estimate) -> Note:
    """Return the note on an effect that may do nothing in the final model."""
    low, high = strength.interval
    facts = {
        "parameter": effect.neutral,
        "value": strength.value,
        "low": low,
        "high": high,
        "unit": strength.unit,
        "neutral": neutral_value(effect),
    }
    return Note(NoteCode.MAY_BE_NEUTRAL, label(effect), facts)


def _assess_final_model(
    search: Search, judged: ConfirmedSelection, data: DiagnosisData
) -> _FinalModel:
    """Fit the best model to all that was measured, and assess its parameters and residuals."""
    best = judged.selection.best
    final, notes = _fit_to_all(search, best, data)
    residuals = analyse_residuals(best, data.estimation)
    parameters = _assess_parameters(final, judged.selection, residuals, data)
    return _FinalModel(judged, final, residuals, parameters, notes)


def _assess_parameters(
    final: FittedCandidate,
    selection: Selection,
    residuals: Mapping[str, ResidualAnalysis],
    data: DiagnosisData,
) -> _ParameterAssessment:
    """Give the parameters of the final model their intervals, and tell which of them changed.

    What is determined only together with the curve of a cause is not said to have changed.
    """
    starts = final.candidate.cls.layout.start_parameters
    physical = [name for name in data.parameters if name not in starts]
    by_input_noise = data.input_noise.spread_of(final.problem.names)
    by_intersample = intersample.spread(data.intersample, final)
    spread = deviation_beside_fit(final, (by_input_noise, by_intersample), selection, residuals)
    estimates = parameter_estimates(final, spread)
    effects = final.candidate.effects
    slopes = straight_parts(effects, selection.base.candidate.cls, physical)
    apart = [name for name in physical if not any(name in names for names in slopes.values())]
    changed = significantly_changed(final, apart, spread) if data.informative else []
    ratios = implausible(estimates, physical)
    notes = [Note(NoteCode.STRAIGHT_PART, one, {"names": ns}) for one, ns in slopes.items()]
    if data.informative:
        notes += identifiability_notes(final, physical)
    if ratios:
        notes.append(Note(NoteCode.IMPLAUSIBLE, "", {"ratios": ratios}))
    return _ParameterAssessment(estimates, changed, ratios, notes)


class _Remainder(NamedTuple):
    """What the best model does not account for.

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
        structure = _has_unexplained_structure(selection, residuals, of_input_noise)
        return _Remainder(structure, [*residual_notes(residuals)], unfollowed)
    is_followed = max(prediction.errors.values()) <= SOLVER_ERROR
    return _Remainder(False, of_solver, [] if is_followed else unfollowed)


def _has_unexplained_structure(
    selection: Selection,
    residuals: Mapping[str, ResidualAnalysis],
    of_input_noise: frozenset[tuple[str, type]],
) -> bool:
    """Return whether residuals hold structure that neither input noise nor a named effect makes.

    Parameters
    ----------
    selection : Selection
    residuals : Mapping of str to ResidualAnalysis
        Of the best model.
    of_input_noise : frozenset of tuple of str and type
        Outputs and types of tests that noise on the inputs explains.
    """
    # neither noise on the inputs nor the form of an effect makes a spectral line or a level shift
    if any(analysis.lines or analysis.level_shifts for analysis in residuals.values()):
        return True
    structured = [
        output
        for output, analysis in residuals.items()
        if any((output, type(s)) not in of_input_noise for s in analysis.structure)
    ]
    if not selection.steps:
        return bool(structured)
    # a plant never has quite the catalogue's form of an effect, which leaves some where it acts
    before = selection.base.fit
    after = selection.best.fit
    return not all(_is_tolerated(before, after, output) for output in structured)


def _doubts(
    judged: ConfirmedSelection,
    structure_remains: bool,
    improves: Callable[[Mapping[str, float], Mapping[str, float]], bool],
    is_misread: bool,
) -> list[Note]:
    """Return the notes on what speaks against the best model, whatever its causes gained.

    Where it is known what is wrong with the record, outputs may well follow inputs.
    """
    if not judged.selection.steps:
        large = _large_errors(judged.selection.best)
        if not large:
            return []
        facts = {"outputs": tuple(large), "share": max(large.values())}
        is_hopeless = _pooled(large, judged.selection.best) > _HOPELESS
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


def _pooled(errors: Mapping[str, float], best: FittedCandidate) -> float:
    """Return the root mean square of errors by output, of which those that are absent are none."""
    return float(np.sqrt(sum(error**2 for error in errors.values()) / len(best.fit.residual)))


def _is_tolerated(before: FitResult, after: FitResult, output: str) -> bool:
    """Return whether only a small share of the structure in a residual remains beside a cause."""
    noise = robust_power(after.innovation[output]) * after.noise[output].deviation ** 2
    remaining = robust_power(after.residual[output]) - noise
    return remaining < TOLERATED_STRUCTURE * (robust_power(before.residual[output]) - noise)


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
    selection: Selection, parameters: _ParameterAssessment, misfit: bool, informative: bool
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
