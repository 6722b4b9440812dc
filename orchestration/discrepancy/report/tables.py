"""Rows of the tables that terminal, page and JSON share: errors, evidence and changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.kit.titles import effect_title, within_sentence
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.wording import EXTENDED, NOMINAL, REFITTED
from orchestration.discrepancy.validation import Errors, simulated_outputs
from orchestration.identify import finite_or_none, normalised_rms
from orchestration.records.runs import MeasuredRun

_MODELS = {"untouched": NOMINAL, "refitted": REFITTED, "extended": EXTENDED}
_NOTICED = 0.05  # relative difference of two errors that says something to a reader


@dataclass(frozen=True)
class RunError:
    """Errors of the best model in one record.

    Attributes
    ----------
    label : str
    held_out : bool
    samples : int
    nrmse : dict of str to float
        Normalised RMS error of every output; of a record held out, where it is judged.
    """

    label: str
    held_out: bool
    samples: int
    nrmse: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return {
            "record": self.label,
            "held_out": self.held_out,
            "samples": self.samples,
            "nrmse": {output: finite_or_none(error) for output, error in self.nrmse.items()},
        }


def run_errors(result: Result) -> list[RunError]:
    """Return the errors of the best model in every record; none where there is only one record.

    Parameters
    ----------
    result : Result

    Returns
    -------
    list of RunError
        First of the records fitted to, then of those held out, each in the order given.
    """
    estimation = result.diagnosis.estimation
    validation = result.diagnosis.validation
    if not (estimation.several or validation.data.several):
        return []
    best = result.diagnosis.selection.best
    simulated = result.gain.extended if result.gain else simulated_outputs(validation, best)
    errors = []
    for run in estimation.runs:
        label = run.label or result.files
        nrmse = _fitted_nrmse(best, estimation, run)
        errors.append(RunError(label, False, run.last - run.first, nrmse))
    for run in validation.data.runs:
        nrmse = validation.nrmse(simulated, run.samples)
        errors.append(RunError(run.label, not validation.continued, run.last - run.first, nrmse))
    return errors


def _fitted_nrmse(model: FittedCandidate, data: Dataset, run: MeasuredRun) -> dict[str, float]:
    """Return the error of every output in one run of the data that a model was fitted to."""
    nrmse = {}
    for output, present_residual in model.fit.residual.items():
        residual = np.full(len(data.time), np.nan)
        residual[model.problem.present[output]] = present_residual
        y = data.measured[output][run.samples]
        simulated = y - np.where(np.isnan(y), 0.0, residual[run.samples])
        nrmse[output] = normalised_rms(y, simulated)
    return nrmse


def error_table(diagnosis: Diagnosis) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of a table of normalised RMS errors of free runs.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    head : list of str
    rows : list of list of str
        One for every output and part of the data, with a column for every model.
    """
    models = [name for name in _MODELS if name in diagnosis.fitted_errors]
    rows = []
    for part, errors in _parts(diagnosis).items():
        for output in next(iter(errors.values()), {}):
            cells = [
                wording.format_error(errors[name][output]) if name in errors else ""
                for name in models
            ]
            rows.append([output, part, *cells])
    return ["output", "where", *(_MODELS[name] for name in models)], rows


def least_squares_table(diagnosis: Diagnosis) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of a table of the errors of plain least squares, where they tell more.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    head : list of str
    rows : list of list of str
        One for every output and part of the data in which another error is left than by the
        refitted parameters.
    """
    rows = []
    for part, errors in _parts(diagnosis).items():
        plain = errors.get("least_squares", {})
        for output, error in plain.items():
            refitted = errors["refitted"][output]
            if not abs(error - refitted) <= _NOTICED * refitted:
                cells = map(wording.format_error, (error, refitted))
                rows.append([output, part, *cells])
    return ["output", "where", "plain least squares", REFITTED], rows


def _parts(diagnosis: Diagnosis) -> dict[str, Errors]:
    return {"fitted": diagnosis.fitted_errors, "held out": diagnosis.judged_errors}


@dataclass(frozen=True)
class TriedEffect:
    """An effect that was fitted, with the evidence for it and its verdict.

    Attributes
    ----------
    candidate : FittedCandidate
        The model with the effect.
    gain : float
        Fall of BIC.
    p_value : float
    verdict : {"named", "shape", "not told apart", "the same", "rejected"}
        "shape" if it corrects the shape of a cause, "the same" if it is one in other parameters.
    reason : str
        Why it was rejected, what it is not told apart from, the cause of which it corrects the
        shape, what it is the same as, or what unseen data say of it.
    """

    candidate: FittedCandidate
    gain: float
    p_value: float
    verdict: str
    reason: str = ""


def tried_effects(diagnosis: Diagnosis) -> list[TriedEffect]:
    """Return every effect that was fitted, once: those selected, those as good, and others.

    Others are judged by the last step in which they were tried, and sorted by their gain.
    """
    listed = _selected_effects(diagnosis) + _alternative_effects(diagnosis)
    names = {row.candidate.effect_name for row in listed}
    rejected = _rejected_effects(diagnosis, names)
    return listed + sorted(rejected, key=lambda row: (-row.gain, row.candidate.candidate.name))


def _selected_effects(diagnosis: Diagnosis) -> list[TriedEffect]:
    rows = []
    for cause, *corrections in diagnosis.selection.by_cause:
        unseen = _unseen_evidence(diagnosis, cause.chosen)
        rows.append(TriedEffect(cause.chosen, cause.gain, cause.p_value, "named", unseen))
        for step in corrections:
            unseen = _unseen_evidence(diagnosis, step.chosen)
            reason = f"of {_title(cause.chosen)}" + (f"; {unseen}" if unseen else "")
            rows.append(TriedEffect(step.chosen, step.gain, step.p_value, "shape", reason))
    return rows


def _alternative_effects(diagnosis: Diagnosis) -> list[TriedEffect]:
    selection = diagnosis.selection
    rows = []
    for step, smaller in zip(selection.steps, _models_by_step(diagnosis), strict=False):
        for alternative in step.alternatives:
            gain = step.gains[alternative.effect_name]
            p_value = alternative.p_value(smaller, selection.tried)
            reason = f"from {_title(step.chosen)}"
            rows.append(TriedEffect(alternative, gain, p_value, "not told apart", reason))
        for same, gain in step.equivalents:
            p_value = same.p_value(smaller, selection.tried)
            reason = f"as {step.chosen.effect_name}, in other parameters"
            rows.append(TriedEffect(same, gain, p_value, "the same", reason))
    return rows


def _rejected_effects(diagnosis: Diagnosis, listed: set[str]) -> list[TriedEffect]:
    """Return effects that were tried and that no table has yet, by the last trial of each."""
    selection = diagnosis.selection
    rejected_by_step = [*(step.rejected for step in selection.steps), selection.rejected]
    rivals = [*(_title(step.chosen) for step in selection.steps), ""]
    last_trial: dict[str, tuple[FittedCandidate, FittedCandidate, str]] = {}
    gains: dict[str, list[float]] = {}
    models = _models_by_step(diagnosis)
    for rejected, smaller, rival in zip(rejected_by_step, models, rivals, strict=True):
        for candidate, gain in rejected:
            last_trial[candidate.effect_name] = candidate, smaller, rival
            gains.setdefault(candidate.effect_name, []).append(gain)
    refuted = {
        name
        for note in diagnosis.notes
        if note.code is NoteCode.NOT_VALIDATED
        for name in note.subject.split(", ")
    }
    causes = " and ".join(_title(step.chosen) for step in selection.steps)
    rows = []
    for name, (candidate, smaller, rival) in last_trial.items():
        if name not in listed:
            p_value = candidate.p_value(smaller, selection.tried)
            unsure = name in selection.unsure
            reason = wording.why_not(gains[name], causes, unsure, rival)
            reason = wording.REFUTED if name in refuted else reason
            rows.append(TriedEffect(candidate, gains[name][-1], p_value, "rejected", reason))
    return rows


def _title(candidate: FittedCandidate) -> str:
    return within_sentence(effect_title(candidate.effect))


def _models_by_step(diagnosis: Diagnosis) -> list[FittedCandidate]:
    """Return the models to which every step, and a last one in vain, tried to add an effect."""
    selection = diagnosis.selection
    models = [selection.base, *(step.chosen for step in selection.steps)]
    return [*selection.compared[: len(models)]] or models


def _unseen_evidence(diagnosis: Diagnosis, chosen: FittedCandidate) -> str:
    """Return what the part held out says of a cause, and how surely; empty if it was not judged."""
    confirmation = diagnosis.confirmations.get(chosen.effect_name)
    if confirmation is None:
        return ""
    score = confirmation.score
    outcome = wording.confirmation(diagnosis, chosen.effect_name)
    return f"{outcome} (log-likelihood {score.gain:+.3g} ± {score.standard_error:.2g})"
