"""Corrections of a model's laws as dictionaries, ready for JSON."""

from __future__ import annotations

from typing import Any

from orchestration.discrepancy.laws import Correction
from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.law_report import (
    LawReport,
    is_confirmed,
    shape_estimates,
)
from orchestration.discrepancy.report.wording import message
from orchestration.identify import finite_or_none


def law_map(law_report: LawReport) -> list[dict[str, Any]]:
    """Return every correction, the best first, and then those beside it.

    Parameters
    ----------
    law_report : LawReport

    Returns
    -------
    list of dict
        Numbers SI, no NaN nor infinity (null instead).
    """
    return [
        _correction(each, correction)
        for each in law_report.rounds
        for correction in each.corrections
    ]


def laws_summary(law_report: LawReport) -> dict[str, Any]:
    """Return the figures that ``ppy laws --json`` writes.

    Parameters
    ----------
    law_report : LawReport

    Returns
    -------
    dict
        Numbers SI, no NaN nor infinity (null instead).
    """
    result = law_report.result
    last_best = law_report.rounds[-1].best
    before = law_report.best.errors[0] if law_report.best else {}
    after = last_best.errors[1] if last_best else {}
    return {
        "sentence": wording.sentence(law_report),
        "law_map": law_map(law_report),
        "spectrum": [
            {"constant": constant, "amount": amount} for constant, amount in law_report.relaxations
        ],
        "errors": {
            "holdout_nrmse_before": {
                output: finite_or_none(error) for output, error in before.items()
            },
            "holdout_nrmse_after": {
                output: finite_or_none(error) for output, error in after.items()
            },
        },
        "looked_at": len(law_report.found.entries) if law_report.found else 0,
        "causes": law_report.causes,
        "parameters": {name: e.to_dict() for name, e in result.diagnosis.estimates.items()},
        "notes": [
            {"code": str(note.code), "subject": note.subject, "message": message(note)}
            for note in result.notes
        ],
    }


def _correction(law_report: LawReport, correction: Correction) -> dict[str, Any]:
    entry = correction.entry
    values, low, high = correction.band
    law_unit, signal_unit = law_report.units(correction)
    columns = {"x": entry.basis.knots, "y": values, "low": low, "high": high}
    curve = {name: [finite_or_none(float(v)) for v in column] for name, column in columns.items()}
    return {
        "effect": law_report.effect_name(correction),
        "law": entry.law,
        "signal": entry.signal.name,
        "memory": entry.signal.memory,
        "constant": float(entry.signal.constant),
        "kind": entry.kind,
        "delta_bic": float(correction.gain),
        "shape": correction.shape,
        "parameters": {name: e.to_dict() for name, e in shape_estimates(correction).items()},
        "curve": curve,
        "units": {"law": law_unit, "signal": signal_unit},
        "confirmed": is_confirmed(correction),
        "alike": law_report.indistinguishable(correction),
        "beside": law_report.causes,
    }
