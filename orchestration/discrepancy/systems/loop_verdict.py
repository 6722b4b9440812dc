"""Diagnoses of the members of a loop, from that of the model of all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.conclude import Diagnosis, Verdict
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.systems.assessment import OutputAssessment, assessed
from orchestration.discrepancy.systems.by_equations import LoopDiagnosis
from orchestration.discrepancy.systems.cut import Reason, ReasonCode
from orchestration.discrepancy.systems.verdict import (
    AdjustedParameter,
    MemberDiagnosis,
    MemberVerdict,
    parameters_reason,
    residual_reason,
)


def diagnoses_in_loop(
    loop: LoopDiagnosis, alone: Mapping[str, MemberDiagnosis]
) -> dict[str, MemberDiagnosis]:
    """Return the diagnoses of all members of a loop.

    Parameters
    ----------
    loop : LoopDiagnosis
    alone : Mapping of str to MemberDiagnosis
        Of the same members by themselves.

    Returns
    -------
    dict of str to MemberDiagnosis
        By member. Effects were searched in one of them; the others have their parameters.
    """
    return {name: _member_diagnosis(loop, name, alone[name]) for name in loop.members}


def _member_diagnosis(loop: LoopDiagnosis, name: str, alone: MemberDiagnosis) -> MemberDiagnosis:
    diagnosis = loop.diagnosis
    before = _assessments(loop, name, loop.before)
    after = _assessments(loop, name, loop.after)
    parameters = _parameters(loop, name)
    verdict, reason = _parameter_verdict(parameters)
    causes: list[str] = []
    alternatives: list[str] = []
    if name == loop.member:
        causes = diagnosis.causes
        alternatives = diagnosis.alternatives
        verdict, reason = _verdict(diagnosis, parameters, after)
    return replace(
        alone,
        verdict=verdict,
        reasons=[reason],
        before=before,
        after=after,
        parameters=parameters,
        causes=causes,
        alternatives=alternatives,
        in_loop=True,
    )


def _verdict(
    diagnosis: Diagnosis,
    parameters: Mapping[str, AdjustedParameter],
    final: Mapping[str, OutputAssessment],
) -> tuple[MemberVerdict, Reason]:
    """Return the verdict on the member whose effects were searched."""
    if diagnosis.inconclusive:
        return MemberVerdict.CANNOT_BE_JUDGED, Reason(ReasonCode.NOT_EXCITED)
    if diagnosis.causes:
        known = {p for step in diagnosis.selection.steps for p in step.chosen.effect.declared}
        facts = {
            "causes": diagnosis.causes,
            "alternatives": diagnosis.alternatives,
            "parameters": {n: p for n, p in parameters.items() if n in known},
        }
        return MemberVerdict.WRONG, Reason(ReasonCode.CAUSE_NAMED, facts)
    if diagnosis.verdict in (Verdict.UNEXPLAINED, Verdict.AMBIGUOUS):
        return MemberVerdict.WRONG, residual_reason(final, [*final], adjusted=True)
    return _parameter_verdict(parameters)


def _parameter_verdict(
    parameters: Mapping[str, AdjustedParameter],
) -> tuple[MemberVerdict, Reason]:
    changed = {name: parameter for name, parameter in parameters.items() if parameter.differs}
    if changed:
        return MemberVerdict.RECALIBRATE, parameters_reason(changed)
    return MemberVerdict.CONSISTENT, Reason(ReasonCode.RESIDUAL_IS_NOISE)


def _parameters(loop: LoopDiagnosis, name: str) -> dict[str, AdjustedParameter]:
    """Return the fitted parameters of a member, and the shifts of its clocks."""
    diagnosis = loop.diagnosis
    codes = (NoteCode.UNDETERMINED, NoteCode.DETERMINED_TOGETHER)
    open_names = {n for note in diagnosis.notes if note.code in codes for n in note.facts["names"]}
    starts = diagnosis.final.candidate.cls.layout.start_parameters
    parameters = {}
    for full, estimate in diagnosis.estimates.items():
        own = loop.own_name(name, full)
        if own is None or full in starts:
            continue
        determined = full not in open_names and bool(np.isfinite(estimate.interval).all())
        parameters[own] = AdjustedParameter(
            estimate.value,
            estimate.nominal,
            estimate.unit,
            full in diagnosis.changed,
            estimate.interval if determined else None,
        )
    for full, seconds in loop.shifts.items():
        own = loop.own_name(name, full)
        if own is not None:
            parameters[own] = AdjustedParameter(seconds, 0.0, "s", False)
    return parameters


def _assessments(
    loop: LoopDiagnosis, name: str, simulated: Mapping[str, Array]
) -> dict[str, OutputAssessment]:
    """Assess the outputs of a member; nothing between samples is unknown in a closed loop."""
    isolated = loop.members[name]
    own = {o: simulated[loop.full_name(name, o)] for o in isolated.outputs}
    return assessed(isolated, loop.time, own, dict.fromkeys(own, 0.0))
