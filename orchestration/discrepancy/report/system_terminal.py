"""The diagnosis of a system on a terminal: which members are wrong, judged by what, and where the wrong ones fail."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Group
from rich.table import Table
from rich.text import Text

from orchestration.discrepancy.report.system_wording import sentence, why
from orchestration.discrepancy.report.wording import most_telling
from orchestration.discrepancy.systems.verdict import MemberDiagnosis, MemberVerdict, SystemDiagnosis
from orchestration.reporting.console import plain_table

_REGIONS = 3  # that are shown of every output of a wrong member


def overview(diagnosis: SystemDiagnosis) -> Group:
    """Return what ``ppy diagnose --system`` prints."""
    lines = [Text(line) for member in diagnosis.members for line in _hints(member, diagnosis.record.source.name)]
    return Group(Text(sentence(diagnosis), "bold"), _members(diagnosis), _outputs(diagnosis), *lines)


def _members(diagnosis: SystemDiagnosis) -> Table:
    table = plain_table(None, "member", "verdict", "why")
    for member in diagnosis.members:
        table.add_row(member.name, member.verdict, why(member))
    return table


def _outputs(diagnosis: SystemDiagnosis) -> Table:
    table = plain_table("outputs", "output", "fit", "RMS error", "noise", "in doubt", "explained by its signals")
    for member in diagnosis.members:
        for output, final in member.final.items():
            before = member.before[output].fit_percent
            fit = f"{before:.1f} % → {final.fit_percent:.1f} %" if member.after else f"{before:.1f} %"
            sizes = (f"{size:.3g} {final.unit}" for size in (final.rms, final.noise_std, final.input_uncertainty))
            explained = f"{final.regression.rms:.3g} {final.unit}" if final.regression.significant else "nothing"
            table.add_row(f"{member.name}.{output}", fit, *sizes, explained)
    return table


def _hints(member: MemberDiagnosis, record: str) -> Iterator[str]:
    """Where a wrong member fails, and what to run next."""
    if member.verdict is MemberVerdict.WRONG:
        for assessment in member.final.values():
            yield from (f"{member.name}: {line}" for line in most_telling(assessment.regions)[:_REGIONS])
    if member.verdict in (MemberVerdict.WRONG, MemberVerdict.RECALIBRATE) and member.equations_known:
        columns = " ".join(f"--map {name}={signal}" for signal, name in member.columns.items())
        yield f"to name the cause: ppy diagnose {record} --model {member.model} {columns}"
