"""A diagnosis as a dictionary, ready for JSON: the form of the design, section 8, and what the project adds to it."""

from __future__ import annotations

from inspect import isfunction
from typing import Any

from fmus.kit import Component, Effect
from fmus.kit.component import effect_name
from fmus.kit.corrections import correction
from orchestration.discrepancy.candidates.paired_score import PairedScore
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.errors import run_errors
from orchestration.discrepancy.report.laws.asked import Asked
from orchestration.discrepancy.report.laws.headline import headline
from orchestration.discrepancy.report.laws.summary import law_map
from orchestration.discrepancy.validation.side_by_side import Errors
from orchestration.identify.metrics import number


def summary(result: Result) -> dict[str, Any]:
    """Gather the figures of a diagnosis; numbers SI, no NaN nor infinity (null instead).

    The errors are those of the FMUs where they were run, else those of the simulation.
    """
    diagnosis, errors = result.diagnosis, result.gain or result.diagnosis
    figures = {
        "verdict": str(diagnosis.verdict),
        "headline": headline(result),
        "baseline": {
            "holdout_fit_percent": {
                o: number(100.0 * (1.0 - e)) for o, e in diagnosis.before.items()
            },
        },
        "parameters": {name: e.to_dict() for name, e in diagnosis.estimates.items()},
        "changed": diagnosis.changed,
        "causes": _causes(diagnosis),
        "alternatives": _alternatives(diagnosis),
        "law_map": law_map(Asked(result, result.laws)),
        "gain": {
            "holdout_nrmse_before": {o: number(e) for o, e in errors.before.items()},
            "holdout_nrmse_after": {o: number(e) for o, e in errors.after.items()},
            "residual_white_after": all(
                analysis.whiteness.is_white for analysis in diagnosis.residuals.values()
            ),
        },
        "errors": {
            "estimation": _numbers(diagnosis.fitted_errors),
            "validation": _numbers(diagnosis.judged_errors),
        },
        "inputs": {
            name: {
                "between_samples": "linear" if choice.linear else "held",
                "basis": str(choice.basis),
                "delta_bic": None if choice.margin is None else number(choice.margin),
            }
            for name, choice in diagnosis.intersample.items()
        },
        "notes": [
            {"code": str(note.code), "subject": note.subject, "message": wording.message(note)}
            for note in result.notes
        ],
        "residuals": {
            output: {
                "lines_hz": [line.frequency for line in analysis.lines],
                "level_shifts_s": [shift.time for shift in analysis.level_shifts],
                "structure": [wording.structure(item, output) for item in analysis.structure],
            }
            for output, analysis in diagnosis.residuals.items()
        },
    }
    if runs := run_errors(result):
        figures["runs"] = [run.to_dict() for run in runs]
    return figures | ({"experiment": result.experiment.as_json()} if result.experiment else {})


def _numbers(errors: Errors) -> dict[str, dict[str, float | None]]:
    return {model: {o: number(e) for o, e in of.items()} for model, of in errors.items()}


def _causes(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    best, causes = diagnosis.selection.best, []
    for step in diagnosis.selection.steps:
        effect, found = step.chosen.effect, diagnosis.confirmations.get(step.chosen.effect_name)
        own = [name for name in best.candidate.parameters if name in effect.declared]
        causes.append(
            {
                "effect": _id(effect),
                "component": diagnosis.selection.base.candidate.cls.name,
                **({"output": effect.output} if effect.output else {}),
                "law": effect.term.law or ", ".join(_overridden(effect, best.candidate.cls)),
                "signal": effect.term.signal,
                "shape": effect.term.shape,
                "parameters": {name: diagnosis.estimates[name].to_dict() for name in own},
                **({"confirmation": str(found.outcome)} if found else {}),
                "evidence": {"delta_bic": step.gain, "p_value": step.p_value}
                | (_score(found.score) if found else {}),
            }
        )
    return causes


def _id(effect: type[Effect]) -> str:
    """Id of an effect; one that no catalogue has is only known by what it is of."""
    return effect_name(effect) if getattr(effect, "made_by", None) is correction else effect.id


def _overridden(effect: type[Effect], cls: type[Component]) -> list[str]:
    """Laws of the base model that an effect of the physics overrides, where it does not tell what it adds to which."""
    base = vars(cls).get("stacked", (cls, ()))[0]
    return (
        []
        if effect.output
        else [n for n, law in vars(effect).items() if isfunction(law) and hasattr(base, n)]
    )


def _score(score: PairedScore) -> dict[str, float]:
    return {
        "holdout_score": score.gain,
        "holdout_score_error": score.standard_error,
        "holdout_score_expected": score.expected,
    }


def _alternatives(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    return [
        {
            "effect": alternative.effect_name,
            "instead_of": step.chosen.effect_name,
            "delta_bic": step.gains[alternative.effect_name],
        }
        for step in diagnosis.selection.steps
        for alternative in step.alternatives
    ]
