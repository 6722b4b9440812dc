"""What a model's laws lack, ready for JSON."""

from __future__ import annotations

from typing import Any

from orchestration.discrepancy.laws.discovery import Correction
from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.asked import Asked, shape_estimates, verdict
from orchestration.discrepancy.report.wording import message
from orchestration.identify.metrics import number


def law_map(asked: Asked) -> list[dict[str, Any]]:
    """Every correction, best first, and then those beside it; numbers SI, no NaN nor infinity (null instead)."""
    return [_correction(each, one) for each in asked.rounds for one in each.corrections]


def summary(asked: Asked) -> dict[str, Any]:
    """Gather the figures of a look at laws."""
    last = asked.rounds[-1]
    before = asked.best.errors[0] if asked.best else {}
    after = last.best.errors[1] if last.best else {}
    return {
        "sentence": wording.sentence(asked),
        "law_map": law_map(asked),
        "spectrum": [
            {"constant": constant, "amount": amount} for constant, amount in asked.spectrum
        ],
        "errors": {
            "holdout_nrmse_before": {o: number(e) for o, e in before.items()},
            "holdout_nrmse_after": {o: number(e) for o, e in after.items()},
        },
        "looked_at": len(asked.found.entries) if asked.found else 0,
        "causes": asked.causes,
        "parameters": {name: e.to_dict() for name, e in asked.result.diagnosis.estimates.items()},
        "notes": [
            {"code": str(note.code), "subject": note.subject, "message": message(note)}
            for note in asked.result.notes
        ],
    }


def _correction(asked: Asked, one: Correction) -> dict[str, Any]:
    entry = one.entry
    values, low, high = one.band
    law, signal = asked.units(one)
    curve = {"x": entry.basis.knots, "y": values, "low": low, "high": high}
    return {
        "effect": asked.effect(one),
        "law": entry.law,
        "signal": entry.signal.name,
        "memory": entry.signal.memory,
        "constant": float(entry.signal.constant),
        "kind": entry.kind,
        "delta_bic": float(one.gain),
        "shape": one.shape,
        "parameters": {name: e.to_dict() for name, e in shape_estimates(one).items()},
        "curve": {name: [number(float(v)) for v in of] for name, of in curve.items()},
        "units": {"law": law, "signal": signal},
        "confirmed": verdict(one),
        "alike": asked.alike(one),
        "beside": asked.causes,
    }
