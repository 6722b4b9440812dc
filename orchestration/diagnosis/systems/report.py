"""The diagnosis of a system in sentences, on a terminal, and as figures for JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.text import Text

from fmus.kit import quoting, registry
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.report import view_of as diagnosis_view_of
from orchestration.diagnosis.report import wording
from orchestration.diagnosis.systems.diagnosis import (
    MemberDiagnosis,
    MemberOutput,
    MemberParameter,
    MemberVerdict,
    SystemDiagnosis,
)
from orchestration.diagnosis.systems.parts import InputOrigin, InputSource
from orchestration.diagnosis.term_names import shape_text
from orchestration.diagnosis.terms import Term
from orchestration.diagnosis.view import DiagnosisView, Rows, View
from orchestration.reporting import flag, plain_table
from orchestration.reporting.html import facts_about

MEMBER_HEAD = ("member", "verdict", "judged", "why")
OUTPUT_HEAD = ("output", "error", "noise widths", "pace")
_VERDICTS = {
    MemberVerdict.WRONG: "The laws of {members} are wrong.",
    MemberVerdict.RECALIBRATE: (
        "The laws of all that could be judged hold; parameters of {members} differ."
    ),
    MemberVerdict.CONSISTENT: "All that could be judged is consistent with the record.",
    MemberVerdict.CANNOT_BE_JUDGED: "Nothing can be judged from this record.",
}


def sentence(diagnosis: SystemDiagnosis) -> str:
    """Return the verdict on a system in one sentence, with the first suspect first."""
    of_verdict = [m for m in diagnosis.members if m.verdict is diagnosis.verdict]
    members = ", ".join(m.name for m in (diagnosis.wrong or of_verdict))
    return _VERDICTS[diagnosis.verdict].format(members=members)


def reason(member: MemberDiagnosis) -> str:
    """Return why a member has its verdict."""
    if member.judgement.reason:
        return member.judgement.reason
    if member.verdict is MemberVerdict.WRONG and not member.causes:
        return "something is missing, and nothing that was tried explains it"
    diagnosis = member.judgement.diagnosis
    causes = "; ".join(_cause_text(diagnosis, name, cause) for name, cause in member.causes)
    sure = diagnosis is not None and diagnosis.is_named
    if member.verdict is MemberVerdict.WRONG:
        return causes if sure else f"no cause is sure; best guesses: {causes}"
    if causes:
        return f"it may be this instead of another member: {causes}"
    changed = {n: p for n, p in member.parameters.items() if p.differs}
    if changed:
        return ", ".join(_change_text(name, one) for name, one in changed.items())
    return "nothing is left that noise cannot account for"


def _cause_text(diagnosis: Diagnosis | None, name: str, cause: Cause) -> str:
    """Return a cause by its name, with how large it is, or its shape."""
    lead = cause.parts[0]
    texts = [] if diagnosis is None else [size.text for size in wording.sizes(diagnosis, cause)]
    if not texts and isinstance(lead, Term):
        texts = [shape_text(lead)]
    return ", ".join([f"{wording.percent(cause.probability)} {name}", *texts])


def _change_text(name: str, parameter: MemberParameter) -> str:
    one = parameter.estimate
    low, high = one.interval
    return (
        f"{name} is {one.value:.4g} {one.unit} instead of {one.nominal:.4g}"
        f" ({low:.4g} to {high:.4g})"
    )


def source_text(source: InputSource) -> str:
    """Return where an input of a member comes from."""
    if source.value is not None:
        return f"{source.value:g} ({source.origin})"
    if source.origin is InputOrigin.MEASURED:
        return str(source.origin)
    if source.origin is InputOrigin.LOOP:
        return f"{source.signal}, {source.origin}"
    return str(source.signal)


class PartView(View):
    """The diagnosis of a part of a system."""

    label: str
    shown: DiagnosisView


class SystemView(View):
    """The diagnosis of a system as people are shown it.

    Attributes
    ----------
    system, verdict, sentence : str
    reason : str
        Why the first suspect is one; empty without any.
    members, outputs : tuple of tuple of str
        See `MEMBER_HEAD` and `OUTPUT_HEAD`.
    notes : tuple of str
    parts : tuple of PartView
    file, command : str
    facts : Mapping of str to str
        Versions, and the digest of the file.
    """

    system: str
    verdict: str
    sentence: str
    reason: str
    members: Rows
    outputs: Rows
    notes: tuple[str, ...]
    parts: tuple[PartView, ...]
    file: str
    command: str
    facts: Mapping[str, str]


def view_of(diagnosis: SystemDiagnosis, command: str = "") -> SystemView:
    """Return the diagnosis of a system as people are shown it.

    Parameters
    ----------
    diagnosis : SystemDiagnosis
    command : str
        That made it; unless given, one that makes the same.
    """
    source = diagnosis.record.source
    rows = tuple(_member_rows(diagnosis))
    first = next(iter(diagnosis.wrong), None)
    reasons = {name: why for name, *_, why in rows}
    again: list[str | Path] = ["ppy", "diagnose", source, flag("system"), diagnosis.system]
    return SystemView(
        system=diagnosis.system,
        verdict=str(diagnosis.verdict),
        sentence=sentence(diagnosis),
        reason="" if first is None else f"{first.name}: {reasons[first.name]}.",
        members=rows,
        outputs=tuple(row for member in diagnosis.members for row in _output_rows(member)),
        notes=tuple(remarks(diagnosis)),
        parts=tuple(
            PartView(label=part.part.label, shown=diagnosis_view_of(part.diagnosis))
            for part in diagnosis.parts
            if part.diagnosis is not None
        ),
        file=source.name,
        command=command or quoting.shell(again),
        facts=facts_about([source]),
    )


def overview(shown: SystemView) -> Group:
    """Return what ``ppy diagnose --system`` prints."""
    return Group(
        Text(shown.sentence, "bold"),
        plain_table(None, *MEMBER_HEAD, rows=shown.members),
        *(Text(f"  {text}") for text in shown.notes),
        plain_table("outputs", *OUTPUT_HEAD, rows=shown.outputs),
    )


def _member_rows(diagnosis: SystemDiagnosis) -> Iterator[tuple[str, ...]]:
    """Yield a row for each member; see `MEMBER_HEAD`."""
    for member in diagnosis.members:
        yield member.name, str(member.verdict), _judged_text(member), reason(member)


def _judged_text(member: MemberDiagnosis) -> str:
    if member.judgement.diagnosis is None:
        return ""
    return f"with {', '.join(member.partners)}" if member.partners else "cut at its ports"


def _output_rows(member: MemberDiagnosis) -> Iterator[tuple[str, ...]]:
    """Yield a row for each output that was judged; see `OUTPUT_HEAD`."""
    for name, output in member.outputs.items():
        error = wording.error_text(output.after)
        if output.before is not None and output.before != output.after:
            error = f"{wording.error_text(output.before)} → {error}"
        widths = wording.noise_widths(output.remainder)
        yield f"{member.name}.{name}", error, widths, output.remainder.pace


def remarks(diagnosis: SystemDiagnosis) -> list[str]:
    """Return remarks on the data of all parts, each once."""
    judged = (m.judgement.diagnosis for m in diagnosis.members)
    return list(dict.fromkeys(text for one in judged if one for _, _, text in one.notes))


def summary(diagnosis: SystemDiagnosis) -> dict[str, Any]:
    """Return the figures of the diagnosis of a system, ready for JSON.

    Amounts are in the units of the FMUs; None is a figure that there is none of.
    """
    return {
        "system": diagnosis.system,
        "verdict": str(diagnosis.verdict),
        "suspects": [member.name for member in diagnosis.wrong],
        "members": [_member_summary(member) for member in diagnosis.members],
        "notes": remarks(diagnosis),
    }


def _member_summary(member: MemberDiagnosis) -> dict[str, Any]:
    judged = member.judgement.diagnosis
    named = [name for name, _ in member.causes] if judged and judged.is_named else []
    is_wrong = member.verdict is MemberVerdict.WRONG
    return {
        "member": member.name,
        "fmu": member.fmu,
        "model": member.model,
        "ours": member.model in registry.components(),
        "verdict": str(member.verdict),
        "why": reason(member),
        "partners": member.partners if judged else [],
        "fed": {name: source_text(source) for name, source in member.inputs.items()},
        "outputs": {name: _output_summary(one) for name, one in member.outputs.items()},
        "causes": named[:1] if is_wrong else [],
        "alternatives": named[1:] if is_wrong else named,
        "group": [
            {"effect": name, "probability": float(cause.probability)}
            for name, cause in member.causes
        ],
        "parameters": {
            name: one.estimate.to_dict() | {"differs": one.differs}
            for name, one in member.parameters.items()
        },
    }


def _output_summary(output: MemberOutput) -> dict[str, Any]:
    return {
        "fit_percent_before": wording.fit_percent(output.before),
        "fit_percent": wording.fit_percent(output.after),
        "noise_widths": output.remainder.noise_widths,
        **output.remainder.tests,
    }
