"""The diagnosis of a system, told in sentences, on a terminal and as a dictionary for JSON."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from orchestration.discrepancy.report.wording import (
    describe_worst_regions,
)
from orchestration.discrepancy.residuals import CrossCorrelation, OperatingRegion
from orchestration.discrepancy.systems import (
    AdjustedParameter,
    InputOrigin,
    InputSource,
    MemberDiagnosis,
    MemberVerdict,
    Reason,
    ReasonCode,
    SystemDiagnosis,
)
from orchestration.identify import finite_or_none
from orchestration.reporting import plain_table

_VERDICTS = {
    MemberVerdict.WRONG: "The structure of {members} is wrong.",
    MemberVerdict.RECALIBRATE: (
        "The structure of all that could be judged is fine; parameters of {members} differ."
    ),
    MemberVerdict.CONSISTENT: "All that could be judged is consistent with the record.",
    MemberVerdict.CANNOT_BE_JUDGED: "Nothing can be judged from this record.",
}
_REASONS = {
    ReasonCode.INPUT_NOT_MEASURED: "{input} is not measured (measure {signal})",
    ReasonCode.INPUT_WITH_GAPS: "{input} is not measured (measure {signal} without holes)",
    ReasonCode.NO_OUTPUT_MEASURED: "none of its outputs is measured",
    ReasonCode.SIMULATION_FAILED: "{message}",
    ReasonCode.LOOP_SIMULATION_FAILED: "in its loop: {message}",
    ReasonCode.TOO_UNCERTAIN: (
        "{outputs} says nothing: what its inputs do between samples, or their noise, moves it"
        " too far"
    ),
    ReasonCode.RESIDUAL_BEYOND_NOISE: (
        "{output} is off by {rms:.3g} {unit} rms, {noise_ratio:.1f} noise"
        " widths{adjusted}{complete}{most_telling}"
    ),
    ReasonCode.PARAMETERS_CHANGED: "{parameters}",
    ReasonCode.CAUSE_NAMED: "{causes} is missing{alternatives}: {parameters}",
    ReasonCode.NOT_EXCITED: "its loop does not move in this record by more than noise",
    ReasonCode.RESIDUAL_IS_NOISE: "nothing is left that noise cannot account for",
    ReasonCode.OUTPUTS_UNMOVED: "{outputs} does not move in this record, which says little of it",
}
_REGIONS = 3  # of every output of a wrong member that are printed
_LISTED = 5  # correlations, and regions, of an output, in JSON


def system_sentence(diagnosis: SystemDiagnosis) -> str:
    """Return the verdict on a system in one sentence."""
    members = ", ".join(m.name for m in diagnosis.members if m.verdict is diagnosis.verdict)
    return _VERDICTS[diagnosis.verdict].format(members=members)


def describe_reasons(member: MemberDiagnosis) -> str:
    """Return the reasons for the verdict on a member, in one line."""
    return "; ".join(map(describe_reason, member.reasons))


def describe_reason(reason: Reason) -> str:
    """Return one reason for a verdict in words."""
    facts = {name: _format_fact(name, value) for name, value in reason.facts.items()}
    return _REASONS[reason.code].format(**facts)


def _format_fact(name: str, value: Any) -> Any:
    """Return a fact of a reason as its sentence takes it."""
    if name == "outputs":
        return ", ".join(value)
    if name == "causes":
        return " and ".join(value)
    if name == "alternatives":
        return f" (or {', '.join(value)}, which this record cannot tell apart)" if value else ""
    if name == "parameters":
        return ", ".join(_describe_change(name, adjusted) for name, adjusted in value.items())
    if name == "adjusted":
        return ", whatever its parameters" if value else ""
    if name == "complete":
        return "" if value else " (the search for parameters was cut short)"
    if name == "most_telling":
        return f"; {value.describe(value.output)}" if value else ""
    return value


def _describe_change(name: str, parameter: AdjustedParameter) -> str:
    changed = f"{name} is {parameter.value:.4g} {parameter.unit} instead of {parameter.nominal:.4g}"
    if parameter.interval is None:
        return f"{changed} (not determined closely)"
    low, high = parameter.interval
    return f"{changed} ({low:.4g} to {high:.4g})"


def describe_source(source: InputSource, linear: bool) -> str:
    """Return where an input of a member comes from, and its course between samples.

    Parameters
    ----------
    source : InputSource
    linear : bool
        Whether a measured input changes linearly between samples; else it is held.
    """
    if source.value is not None:
        return f"{source.value:g} ({source.origin})"
    is_upstream = source.origin is InputOrigin.UPSTREAM
    place = str(source.signal) if is_upstream else str(source.origin)
    return f"{place}, {'linear' if linear else 'held'} between samples"


def system_overview(diagnosis: SystemDiagnosis) -> Group:
    """Return what ``ppy diagnose --system`` prints."""
    hints = [Text(hint) for member in diagnosis.members for hint in _hints(member, diagnosis)]
    verdict = Text(system_sentence(diagnosis), "bold")
    return Group(verdict, _member_table(diagnosis), _output_table(diagnosis), *hints)


def _member_table(diagnosis: SystemDiagnosis) -> Table:
    table = plain_table(None, "member", "verdict", "why")
    for member in diagnosis.members:
        table.add_row(member.name, member.verdict, describe_reasons(member))
    return table


def _output_table(diagnosis: SystemDiagnosis) -> Table:
    table = plain_table(
        "outputs", "output", "fit", "RMS error", "noise", "in doubt", "explained by its signals"
    )
    for member in diagnosis.members:
        for output in member.final:
            table.add_row(f"{member.name}.{output}", *_output_cells(member, output))
    return table


def _output_cells(member: MemberDiagnosis, output: str) -> list[str]:
    final = member.final[output]
    fit = f"{member.before[output].fit_percent:.1f} %"
    if member.after:
        fit = f"{fit} → {final.fit_percent:.1f} %"
    explained = "nothing"
    if final.regression.significant:
        explained = f"{final.regression.rms:.3g} {final.unit}"
    return [
        fit,
        f"{final.rms:.3g} {final.unit}",
        f"{final.noise_std:.3g} {final.unit}",
        f"{final.input_uncertainty:.3g} {final.unit}",
        explained,
    ]


def _hints(member: MemberDiagnosis, diagnosis: SystemDiagnosis) -> list[str]:
    """Return where a wrong member fails, and which command to run next."""
    hints = []
    if member.verdict is MemberVerdict.WRONG:
        for assessment in member.final.values():
            regions = describe_worst_regions(assessment.regions)[:_REGIONS]
            hints += [f"{member.name}: {region}" for region in regions]
    needs_cause = member.verdict in (MemberVerdict.WRONG, MemberVerdict.RECALIBRATE)
    if needs_cause and member.is_component and not member.in_loop:
        command = shlex.join(command_for_member(member, diagnosis))
        hints.append(f"to name the cause: {command}")
    return hints


def command_for_member(member: MemberDiagnosis, diagnosis: SystemDiagnosis) -> list[str]:
    """Return the command that diagnoses one member alone, with its columns and its settings."""
    settings = dict(member.settings)
    for name, source in member.inputs.items():
        if source.origin is InputOrigin.SETTING and source.value is not None:
            settings[name] = source.value
    command = ["ppy", "diagnose", str(diagnosis.record.source), "--model", member.model]
    for variable, port in member.measured.items():
        column, unit = diagnosis.columns[port]
        command += ["--map", f"{column}={variable}{unit}"]
    for name, value in settings.items():
        command += ["--set", f"{name}={value}"]
    return command


def system_diagnosis_summary(diagnosis: SystemDiagnosis) -> dict[str, Any]:
    """Return the figures of the diagnosis of a system, ready for JSON.

    Parameters
    ----------
    diagnosis : SystemDiagnosis

    Returns
    -------
    dict
        Amounts in the units of the FMUs, no NaN nor infinity (null instead);
        `docs/reference/diagnosis.md` has every field.
    """
    members = [_member_summary(member) for member in diagnosis.members]
    return {"system": diagnosis.system, "verdict": str(diagnosis.verdict), "members": members}


def _member_summary(member: MemberDiagnosis) -> dict[str, Any]:
    reasons = [
        {"code": str(reason.code), "message": describe_reason(reason)} for reason in member.reasons
    ]
    sources = {
        name: describe_source(source, name in member.linear)
        for name, source in member.inputs.items()
    }
    return {
        "member": member.name,
        "fmu": member.fmu,
        "model": member.model,
        "ours": member.is_component,
        "verdict": str(member.verdict),
        "why": describe_reasons(member),
        "reasons": reasons,
        "fed": sources,
        "outputs": {output: _output_summary(member, output) for output in member.final},
        "causes": member.causes,
        "alternatives": member.alternatives,
        "parameters": {
            name: _parameter_summary(parameter) for name, parameter in member.parameters.items()
        },
        "simulations": member.simulations,
    }


def _parameter_summary(parameter: AdjustedParameter) -> dict[str, Any]:
    figures = asdict(parameter)
    figures["ci95"] = list(figures.pop("interval") or (None, None))
    return figures


def _output_summary(member: MemberDiagnosis, output: str) -> dict[str, Any]:
    final = member.final[output]
    return {
        "fit_percent_before": finite_or_none(member.before[output].fit_percent),
        "fit_percent": finite_or_none(final.fit_percent),
        "rms": finite_or_none(final.rms),
        "unit": final.unit,
        "noise": final.noise_std,
        "doubt": final.input_uncertainty,
        "white": final.whiteness.is_white if final.whiteness else None,
        "explained": {"rms": final.regression.rms, "p_value": final.regression.p_value},
        "slow": {"rms": final.random_walk.rms, "p_value": final.random_walk.p_value},
        "associations": _describe_significant(final.correlations),
        "regions": _describe_significant(final.regions),
    }


def _describe_significant(items: Sequence[CrossCorrelation | OperatingRegion]) -> list[str]:
    return [item.describe(item.output) for item in items if item.significant][:_LISTED]
