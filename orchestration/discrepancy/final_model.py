"""The final model of a diagnosis: fitted to all that was measured, and judged with its causes.

Causes that may do nothing beside those that came after them are dropped, and so are those that
leave something beside parameters that no specimen has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import Effect
from orchestration.discrepancy.candidates import FittedCandidate, label
from orchestration.discrepancy.data import Dataset, ValidationData
from orchestration.discrepancy.note import MIXED_UP, Note, NoteCode
from orchestration.discrepancy.residuals import (
    ResidualAnalysis,
    analyse_residuals,
    robust_power,
)
from orchestration.discrepancy.selection import (
    ACCEPT,
    ALTERNATIVE,
    FAILURES,
    Intersample,
    Search,
    Selection,
    Step,
    as_reported_models,
    change_from_nominal,
    interchangeable,
    intersample,
    without_effect,
)
from orchestration.discrepancy.validation import (
    ConfirmedSelection,
    by_likelihood_ratio,
    confirm,
    deviation_beside_fit,
    errors_in_variables,
    free_run_gain,
    identifiability_notes,
    implausible,
    neutral_value,
    parameter_estimates,
    significantly_changed,
    straight_parts,
    undetermined_effects,
)
from orchestration.identify.fitting import FitResult
from orchestration.identify.uncertainty import Estimate
from orchestration.records.runs import base_name

# Share of the structure in a residual that may remain beside a cause, which never has quite the
# catalogue's form.
TOLERATED_STRUCTURE = 0.25


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


@dataclass(frozen=True)
class ParameterAssessment:
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
        """True if a parameter has a value that no specimen can have."""
        return bool(self.ratios)


@dataclass(frozen=True)
class FinalModel:
    """The best model of a selection, fitted to all that was measured, and what is known of it.

    Attributes
    ----------
    judged : ConfirmedSelection
    model : FittedCandidate
    residuals : dict of str to ResidualAnalysis
        Of the best model over the estimation data.
    parameters : ParameterAssessment
    notes : list of Note
        On the fit to all that was measured.
    """

    judged: ConfirmedSelection
    model: FittedCandidate
    residuals: dict[str, ResidualAnalysis]
    parameters: ParameterAssessment
    notes: list[Note]


def judged_in_reason(search: Search, judged: ConfirmedSelection, data: DiagnosisData) -> FinalModel:
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
    if not has_unexplained_structure(selection, outcome.residuals, frozenset()):
        return outcome
    bare = _assess_final_model(search, judged.without_steps(data.validation), data)
    if bare.parameters.implausible:
        return bare
    parameters = replace(bare.parameters, ratios=beside.ratios, notes=beside.notes)
    return replace(bare, parameters=parameters)


def _with_cause_in_reason(
    search: Search, outcome: FinalModel, data: DiagnosisData
) -> FinalModel | None:
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
    if not is_in_reason or has_unexplained_structure(reached, final.residuals, frozenset()):
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
    return float(np.linalg.norm(change_from_nominal(fitted.problem, fitted.fit)))


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
) -> FinalModel:
    """Assess the final model, and drop the causes that may do nothing in it, one after another.

    What was named first was judged without what came after it.
    """
    outcome = _assess_final_model(search, judged, data)
    ratios = dict[type[Effect], float]()
    while (effect := _undetermined(outcome, ratios)) is not None:
        held = _held_against_less(search, outcome, effect, data)
        if isinstance(held, FinalModel):
            outcome = held
        else:
            ratios[effect] = held
    estimates = outcome.parameters.estimates
    needed = {
        effect.neutral: by_likelihood_ratio(estimates[effect.neutral], neutral_value(effect), ratio)
        for effect, ratio in ratios.items()
        if effect.neutral in estimates
    }
    return replace(outcome, parameters=replace(outcome.parameters, estimates=estimates | needed))


def _undetermined(outcome: FinalModel, needed: Mapping[type[Effect], float]) -> type[Effect] | None:
    """Return the next effect of which the interval holds that it does nothing; None if none does.

    Those that are known to be needed are not looked at again.
    """
    effects = undetermined_effects(outcome.model, outcome.parameters.estimates)
    return next((effect for effect in effects if effect not in needed), None)


def _held_against_less(
    search: Search, outcome: FinalModel, effect: type[Effect], data: DiagnosisData
) -> float | FinalModel:
    """Hold the final model against the one without an effect.

    A cause without which the record is much less likely stays, or without which unseen data are
    surely farther off: its interval is then that of the likelihood ratio, or of how sure that is.

    Returns
    -------
    float or FinalModel
        The ratio by which the effect is needed, as a difference of deviance; or the final model
        without it.
    """
    selection = outcome.judged.selection
    reported = as_reported_models(search, without_effect(search, selection, effect))
    fall = selection.best.delta_bic(reported.best, selection.tried)
    if fall > ACCEPT:
        # the model without it may have more parameters of the noise
        return max(reported.best.fit.deviance - selection.best.fit.deviance, fall)
    anew = confirm(reported, data.validation, search.trusted)
    gain = free_run_gain(data.validation, anew.predictions[-1], outcome.judged.predictions[-1])
    if gain.surely_nearer:
        return gain.fall**2
    note = _neutral_note(effect, outcome.parameters.estimates[effect.neutral])
    kept = replace(anew, notes=[*outcome.judged.notes, *anew.notes, note])
    return _assess_final_model(search, kept, data)


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
) -> FinalModel:
    """Fit the best model to all that was measured, and assess its parameters and residuals."""
    best = judged.selection.best
    final, notes = _fit_to_all(search, best, data)
    residuals = analyse_residuals(best, data.estimation)
    parameters = _assess_parameters(final, judged.selection, residuals, data)
    return FinalModel(judged, final, residuals, parameters, notes)


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


def _assess_parameters(
    final: FittedCandidate,
    selection: Selection,
    residuals: Mapping[str, ResidualAnalysis],
    data: DiagnosisData,
) -> ParameterAssessment:
    """Give the parameters of the final model their intervals, and tell which of them changed.

    What is determined only together with the curve of a cause is not said to have changed.
    """
    starts = final.candidate.cls.layout.start_parameters
    physical = [name for name in data.parameters if name not in starts]
    spreads = (
        data.input_noise.spread_of(final.problem.names),
        intersample.spread(data.intersample, final),
    )
    spread = deviation_beside_fit(final, spreads, selection, residuals)
    estimates = parameter_estimates(final, spread)
    slopes = straight_parts(final.candidate.effects, selection.base.candidate.cls, physical)
    apart = [name for name in physical if not any(name in names for names in slopes.values())]
    changed = significantly_changed(final, apart, spread) if data.informative else []
    ratios = implausible(estimates, physical)
    notes = [Note(NoteCode.STRAIGHT_PART, one, {"names": ns}) for one, ns in slopes.items()]
    if data.informative:
        notes += identifiability_notes(final, physical)
    if ratios:
        notes.append(Note(NoteCode.IMPLAUSIBLE, "", {"ratios": ratios}))
    return ParameterAssessment(estimates, changed, ratios, notes)


def has_unexplained_structure(
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


def _is_tolerated(before: FitResult, after: FitResult, output: str) -> bool:
    """Return whether only a small share of the structure in a residual remains beside a cause."""
    noise = robust_power(after.innovation[output]) * after.noise[output].deviation ** 2
    remaining = robust_power(after.residual[output]) - noise
    return remaining < TOLERATED_STRUCTURE * (robust_power(before.residual[output]) - noise)
