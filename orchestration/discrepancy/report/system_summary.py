"""The diagnosis of a system as a dictionary, ready for JSON; `docs/reference/diagnosis.md` has every field."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from orchestration.discrepancy.report import system_wording as wording
from orchestration.discrepancy.systems.verdict import MemberDiagnosis, SystemDiagnosis
from orchestration.identify.metrics import number

_LISTED = 5  # correlations, and regions, of an output


def summary(diagnosis: SystemDiagnosis) -> dict[str, Any]:
    """Gather the figures of a diagnosis; amounts in the units of the FMUs, no NaN nor infinity (null instead)."""
    members = [_member(member) for member in diagnosis.members]
    return {"system": diagnosis.system, "verdict": str(diagnosis.verdict), "members": members}


def _member(member: MemberDiagnosis) -> dict[str, Any]:
    return {
        "member": member.name,
        "fmu": member.fmu,
        "model": member.model,
        "ours": member.equations_known,
        "verdict": str(member.verdict),
        "why": wording.why(member),
        "reasons": [
            {"code": str(reason.code), "message": wording.message(reason)}
            for reason in member.reasons
        ],
        "fed": {
            name: wording.source(given, name in member.linear)
            for name, given in member.inputs.items()
        },
        "outputs": {output: _output(member, output) for output in member.final},
        "parameters": {name: asdict(parameter) for name, parameter in member.parameters.items()},
        "simulations": member.simulations,
    }


def _output(member: MemberDiagnosis, output: str) -> dict[str, Any]:
    before, final = member.before[output], member.final[output]
    return {
        "fit_percent_before": number(before.fit_percent),
        "fit_percent": number(final.fit_percent),
        "rms": number(final.rms),
        "unit": final.unit,
        "noise": final.noise_std,
        "doubt": final.input_uncertainty,
        "white": final.whiteness.is_white if final.whiteness else None,
        "explained": {"rms": final.regression.rms, "p_value": final.regression.p_value},
        "slow": {"rms": final.random_walk.rms, "p_value": final.random_walk.p_value},
        "associations": [wording.structure(c) for c in final.correlations if c.significant][
            :_LISTED
        ],
        "regions": [wording.structure(r) for r in final.regions if r.significant][:_LISTED],
    }
