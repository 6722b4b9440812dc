"""A diagnosis as a dictionary, ready for JSON."""

from __future__ import annotations

from inspect import isfunction
from typing import Any

from fmus.kit import Component, Effect
from fmus.kit.corrections import correction
from fmus.kit.effects import effect_name, made_by, unstack
from orchestration.discrepancy.candidates import PairedScore
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.tables import run_errors
from orchestration.discrepancy.report.wording import sizes_of
from orchestration.discrepancy.selection import Step
from orchestration.discrepancy.validation import Errors
from orchestration.identify import finite_or_none


def diagnosis_summary(result: Result) -> dict[str, Any]:
    """Return the figures of a diagnosis.

    Parameters
    ----------
    result : Result

    Returns
    -------
    dict
        SI, no NaN nor infinity (null instead). The errors are those of the FMUs where they were
        run, else those of the simulation. `docs/reference/diagnosis.md` has every field.
    """
    diagnosis = result.diagnosis
    errors = result.gain or diagnosis
    fit_percent = {
        o: finite_or_none(100.0 * (1.0 - error)) for o, error in diagnosis.before.items()
    }
    is_white = all(analysis.whiteness.is_white for analysis in diagnosis.residuals.values())
    figures = {
        "verdict": str(diagnosis.verdict),
        "headline": str(wording.headline(result)),
        "baseline": {"holdout_fit_percent": fit_percent},
        "parameters": {name: e.to_dict() for name, e in diagnosis.estimates.items()},
        "changed": diagnosis.changed,
        "causes": [_cause(diagnosis, *steps) for steps in diagnosis.selection.by_cause],
        "alternatives": _alternatives(diagnosis),
        "gain": {
            "holdout_nrmse_before": _numbers(errors.before),
            "holdout_nrmse_after": _numbers(errors.after),
            "residual_white_after": is_white,
        },
        "errors": {
            "estimation": _errors_by_model(diagnosis.fitted_errors),
            "validation": _errors_by_model(diagnosis.judged_errors),
        },
        "inputs": _inputs(diagnosis),
        "notes": [
            {"code": str(note.code), "subject": note.subject, "message": wording.message(note)}
            for note in result.notes
        ],
        "residuals": _residuals(diagnosis),
    }
    runs = run_errors(result)
    if runs:
        figures["runs"] = [run.to_dict() for run in runs]
    if result.experiment:
        figures["experiment"] = result.experiment.as_json()
    return figures


def _numbers(values: dict[str, float]) -> dict[str, float | None]:
    return {name: finite_or_none(value) for name, value in values.items()}


def _errors_by_model(errors: Errors) -> dict[str, dict[str, float | None]]:
    return {model: _numbers(by_output) for model, by_output in errors.items()}


def _inputs(diagnosis: Diagnosis) -> dict[str, dict[str, Any]]:
    """Return what every input is taken to do between samples, and by which evidence."""
    return {
        name: {
            "between_samples": "linear" if choice.linear else "held",
            "basis": str(choice.basis),
            "delta_bic": None if choice.margin is None else finite_or_none(choice.margin),
        }
        for name, choice in diagnosis.intersample.items()
    }


def _residuals(diagnosis: Diagnosis) -> dict[str, dict[str, Any]]:
    """Return what the tests find in the residual of every output."""
    return {
        output: {
            "lines_hz": [line.frequency for line in analysis.lines],
            "level_shifts_s": [shift.time for shift in analysis.level_shifts],
            "structure": [item.describe(output) for item in analysis.structure],
        }
        for output, analysis in diagnosis.residuals.items()
    }


def _cause(diagnosis: Diagnosis, step: Step, *corrections: Step) -> dict[str, Any]:
    """Return a cause, with its parameters, its evidence, and the effects that correct its shape."""
    selection = diagnosis.selection
    best = selection.best.candidate
    effect = step.chosen.effect
    confirmation = diagnosis.confirmations.get(step.chosen.effect_name)
    own_parameters = [name for name in best.parameters if name in effect.declared]
    cause: dict[str, Any] = {
        "effect": _effect_id(effect),
        "component": selection.base.candidate.cls.name,
    }
    if effect.output:
        cause["output"] = effect.output
    cause |= {
        "law": effect.term.law or ", ".join(_overridden_laws(effect, best.cls)),
        "signal": effect.term.signal,
        "shape": effect.term.shape,
        "shape_corrections": [other.chosen.effect_name for other in corrections],
        "parameters": {name: diagnosis.estimates[name].to_dict() for name in own_parameters},
        "sizes": [size.to_dict() for size in sizes_of(diagnosis, effect)],
    }
    evidence = {"delta_bic": step.gain, "p_value": step.p_value}
    if confirmation:
        cause["confirmation"] = str(confirmation.outcome)
        evidence |= _holdout_score(confirmation.score)
    cause["evidence"] = evidence
    return cause


def _effect_id(effect: type[Effect]) -> str:
    """Return the id of an effect; one in no catalogue is known by its law and its signal."""
    if made_by(effect) is correction:
        return effect_name(effect)
    return effect.id


def _overridden_laws(effect: type[Effect], cls: type[Component]) -> list[str]:
    """Return the laws of the base model that an effect overrides without declaring which."""
    if effect.output:
        return []
    base = unstack(cls)[0]
    return [name for name, law in vars(effect).items() if isfunction(law) and hasattr(base, name)]


def _holdout_score(score: PairedScore) -> dict[str, float]:
    return {
        "holdout_score": score.gain,
        "holdout_score_error": score.standard_error,
        "holdout_score_expected": score.expected,
    }


def _alternatives(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the effects that the record cannot tell from those named."""
    return [
        {
            "effect": alternative.effect_name,
            "instead_of": step.chosen.effect_name,
            "delta_bic": step.gains[alternative.effect_name],
        }
        for step in diagnosis.selection.steps
        for alternative in step.alternatives
    ]
