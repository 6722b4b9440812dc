"""A diagnosis as figures, ready for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.law_map import LawMap
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.report import wording
from orchestration.diagnosis.report.curves import term_curves
from orchestration.diagnosis.term_names import (
    estimates,
    memory_text,
    seen_unit,
    shape_text,
    stems,
    term_parameters,
    unit_of,
)
from orchestration.diagnosis.terms import Term
from orchestration.identify.uncertainty import Estimate


def summary(diagnosis: Diagnosis, written: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return the figures of a diagnosis, SI; None is a figure that there is none of.

    Parameters
    ----------
    diagnosis : Diagnosis
    written : Mapping of str to str, optional
        Files that are written with it, by option; see `wording.next_step`.
    """
    causes = diagnosis.causes if diagnosis.is_named else ()
    group = [cause_figures(diagnosis, cause) for cause in diagnosis.causes]
    before = diagnosis.errors_before
    experiment = diagnosis.experiment
    return {
        "verdict": diagnosis.verdict,
        "headline": wording.answer(diagnosis),
        "next_step": wording.next_step(diagnosis, written),
        "baseline": {"holdout_fit_percent": {n: wording.fit_percent(v) for n, v in before.items()}},
        "parameters": {n: e.to_dict() for n, e in diagnosis.parameters.items()},
        "changed": list(diagnosis.changed),
        "causes": group[:1] if diagnosis.is_named else [],
        "alternatives": [
            {"effect": c.name, "instead_of": causes[0].name, "probability": float(c.probability)}
            for c in causes[1:]
        ],
        "group": group,
        "nothing": {"probability": float(diagnosis.conclusion.nothing)},
        "ladder": [
            {"terms": [wording.name(part) for part in rung.parts], "error": rung.error}
            for rung in diagnosis.ladder
        ],
        "gain": {"holdout_nrmse_before": before, "holdout_nrmse_after": diagnosis.errors_after},
        "left": [
            {
                "output": one.output,
                "share": one.share,
                "noise_widths": one.noise_widths,
                **one.tests,
                "pace": one.pace,
            }
            for one in diagnosis.remainders
        ],
        "notes": [
            {"code": code, "subject": subject, "message": message}
            for code, subject, message in diagnosis.notes
        ],
        **({"experiment": experiment.as_json()} if experiment else {}),
    }


def law_figures(law_map: LawMap) -> list[dict[str, Any]]:
    """Return what each law gains over each signal; curves of the terms of the first cause, SI."""
    diagnosis = law_map.diagnosis
    cls = diagnosis.cls
    fitted = term_curves(diagnosis.final.fit, diagnosis.terms).values()
    curves = {one.term.cause: one for one in fitted}
    rows = []
    for entry in law_map.entries:
        term = entry.term
        curve = curves.get(term.cause)
        row = {
            "effect": term.name,
            "law": term.law,
            "signal": term.signal,
            "memory": memory_text(term),
            "factor": term.factor,
            "shape": shape_text(term),
            "gain": entry.gain,
        }
        if curve is not None:
            unit = "1" if curve.term.factor == term.law else unit_of(cls, term.law)
            row |= {
                "curve": {"x": curve.signal.tolist(), "y": curve.addition.tolist()},
                "units": {"law": unit, "signal": seen_unit(cls, curve.term)},
            }
        rows.append(row)
    return rows


def cause_figures(diagnosis: Diagnosis, cause: Cause) -> dict[str, Any]:
    """Return the figures of a cause: its leading part, and those that go with it."""
    named = stems(diagnosis.cls, cause.terms)
    fitted = estimates(cause.judged.fit, named)
    of_terms = {term: _term_figures(diagnosis, stem, term, fitted) for stem, term in named.items()}
    first, *others = [
        {"reading": _reading_figures(part)} if isinstance(part, Reading) else of_terms[part]
        for part in cause.parts
    ]
    return {
        "effect": cause.name,
        "component": diagnosis.model.name,
        "title": wording.cause_text(diagnosis, cause),
        "probability": float(cause.probability),
        **first,
        "with": others,
        "aliases": list(cause.aliases),
        "sizes": [size.to_dict() for size in wording.sizes(diagnosis, cause)],
        "error": diagnosis.error(cause.judged),
    }


def _reading_figures(reading: Reading) -> dict[str, Any]:
    """Return a reading of the files: ``factor * value + shift`` is what they mean."""
    return {
        "kind": reading.kind.name.lower(),
        "columns": list(reading.columns),
        "factor": reading.factor,
        "shift": reading.shift,
        "levels": list(reading.levels),
        "unit": reading.unit,
        "correction": reading.correction,
        "instead": [_reading_figures(other) for other in reading.instead],
    }


def _term_figures(
    diagnosis: Diagnosis, stem: str, term: Term, fitted: dict[str, Estimate]
) -> dict[str, Any]:
    cls = diagnosis.cls
    names = [parameter.name for parameter in term_parameters(cls, stem, term)]
    return {
        "law": term.law,
        "signal": term.signal,
        "shape": shape_text(term),
        "memory": memory_text(term),
        "factor": term.factor,
        "middle": term.middle,
        "scale": term.scale,
        "places": [*term.knots],
        "parameters": {name: fitted[name].to_dict() for name in names},
    }
