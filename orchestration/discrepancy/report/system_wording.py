"""The words of the diagnosis of a system: sentences made of its codes, shared by the terminal and JSON."""

from __future__ import annotations

from typing import Any

from orchestration.discrepancy.report.wording import correlation, region
from orchestration.discrepancy.residuals.correlation import CrossCorrelation
from orchestration.discrepancy.residuals.operating_regions import OperatingRegion
from orchestration.discrepancy.systems.cut import InputOrigin, InputSource
from orchestration.discrepancy.systems.reason import Reason, ReasonCode
from orchestration.discrepancy.systems.verdict import (
    AdjustedParameter,
    MemberDiagnosis,
    MemberVerdict,
    SystemDiagnosis,
)

_VERDICTS = {
    MemberVerdict.WRONG: "The structure of {members} is wrong.",
    MemberVerdict.RECALIBRATE: "The structure of all that could be judged is fine; parameters of {members} differ.",
    MemberVerdict.CONSISTENT: "All that could be judged is consistent with the record.",
    MemberVerdict.CANNOT_BE_JUDGED: "Nothing can be judged from this record.",
}
_REASONS = {
    ReasonCode.INPUT_NOT_MEASURED: "{input} is not measured (measure {signal})",
    ReasonCode.INPUT_WITH_GAPS: "{input} is not measured (measure {signal} without holes)",
    ReasonCode.NO_OUTPUT_MEASURED: "none of its outputs is measured",
    ReasonCode.SIMULATION_FAILED: "{message}",
    ReasonCode.LOOP_SIMULATION_FAILED: "in its loop: {message}",
    ReasonCode.TOO_UNCERTAIN: "{outputs} says nothing: what its inputs do between samples, or their noise, moves it too far",
    ReasonCode.RESIDUAL_BEYOND_NOISE: "{output} is off by {rms:.3g} {unit} rms, {noise_ratio:.1f} noise widths{adjusted}{complete}{most_telling}",
    ReasonCode.PARAMETERS_CHANGED: "{parameters}",
    ReasonCode.RESIDUAL_IS_NOISE: "nothing is left that noise cannot account for",
    ReasonCode.OUTPUTS_UNMOVED: "{outputs} does not move in this record, which says little of it",
}


def sentence(diagnosis: SystemDiagnosis) -> str:
    """The verdict on a system in one sentence."""
    members = ", ".join(m.name for m in diagnosis.members if m.verdict is diagnosis.verdict)
    return _VERDICTS[diagnosis.verdict].format(members=members)


def why(member: MemberDiagnosis) -> str:
    """The reasons for the verdict on a member, in one line."""
    return "; ".join(map(message, member.reasons))


def message(reason: Reason) -> str:
    """A reason in words."""
    return _REASONS[reason.code].format(
        **{name: _fact(name, value) for name, value in reason.facts.items()}
    )


def _fact(name: str, value: Any) -> Any:
    """Return a fact as its sentence takes it."""
    if name == "outputs":
        return ", ".join(value)
    if name == "parameters":
        return ", ".join(_changed(parameter, adjusted) for parameter, adjusted in value.items())
    if name == "adjusted":
        return ", whatever its parameters" if value else ""
    if name == "complete":
        return "" if value else " (the search for parameters was cut short)"
    if name == "most_telling":
        return f"; {structure(value)}" if value else ""
    return value


def _changed(name: str, parameter: AdjustedParameter) -> str:
    return f"{name} is {parameter.value:.4g} {parameter.unit} instead of {parameter.nominal:.4g}"


def structure(item: CrossCorrelation | OperatingRegion) -> str:
    """What a residual depends on, or where it is larger."""
    return region(item) if isinstance(item, OperatingRegion) else correlation(item)


def source(given: InputSource, linear: bool) -> str:
    """Where an input is from, and what it does between samples.

    Parameters
    ----------
    given : InputSource
    linear : bool
        Whether a measured input changes linearly between samples; else it is held.
    """
    if given.value is not None:
        return f"{given.value:g} ({given.origin})"
    place = str(given.signal) if given.origin is InputOrigin.UPSTREAM else str(given.origin)
    return f"{place}, {'linear' if linear else 'held'} between samples"
