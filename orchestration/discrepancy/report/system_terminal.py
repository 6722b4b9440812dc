"""The diagnosis of a system on a terminal: which members are wrong, judged by what, and where the wrong ones fail."""

from __future__ import annotations

import shlex
from collections.abc import Iterator

from rich.console import Group
from rich.table import Table
from rich.text import Text

from orchestration.discrepancy.report.system_wording import sentence, why
from orchestration.discrepancy.report.wording import most_telling
from orchestration.discrepancy.systems.cut import InputOrigin
from orchestration.discrepancy.systems.verdict import (
    MemberDiagnosis,
    MemberVerdict,
    SystemDiagnosis,
)
from orchestration.reporting.console import plain_table

_REGIONS = 3  # that are shown of every output of a wrong member


def overview(diagnosis: SystemDiagnosis) -> Group:
    """Return what ``ppy diagnose --system`` prints."""
    lines = [Text(line) for member in diagnosis.members for line in _hints(member, diagnosis)]
    return Group(
        Text(sentence(diagnosis), "bold"), _members(diagnosis), _outputs(diagnosis), *lines
    )


def _members(diagnosis: SystemDiagnosis) -> Table:
    table = plain_table(None, "member", "verdict", "why")
    for member in diagnosis.members:
        table.add_row(member.name, member.verdict, why(member))
    return table


def _outputs(diagnosis: SystemDiagnosis) -> Table:
    table = plain_table(
        "outputs", "output", "fit", "RMS error", "noise", "in doubt", "explained by its signals"
    )
    for member in diagnosis.members:
        for output, final in member.final.items():
            before = member.before[output].fit_percent
            fit = (
                f"{before:.1f} % → {final.fit_percent:.1f} %" if member.after else f"{before:.1f} %"
            )
            sizes = (
                f"{size:.3g} {final.unit}"
                for size in (final.rms, final.noise_std, final.input_uncertainty)
            )
            explained = (
                f"{final.regression.rms:.3g} {final.unit}"
                if final.regression.significant
                else "nothing"
            )
            table.add_row(f"{member.name}.{output}", fit, *sizes, explained)
    return table


def _hints(member: MemberDiagnosis, diagnosis: SystemDiagnosis) -> Iterator[str]:
    """Where a wrong member fails, and what to run next."""
    if member.verdict is MemberVerdict.WRONG:
        for assessment in member.final.values():
            yield from (
                f"{member.name}: {line}" for line in most_telling(assessment.regions)[:_REGIONS]
            )
    if (
        member.verdict in (MemberVerdict.WRONG, MemberVerdict.RECALIBRATE)
        and member.equations_known
    ):
        yield f"to name the cause: {shlex.join(next_command(member, diagnosis))}"


def next_command(member: MemberDiagnosis, diagnosis: SystemDiagnosis) -> list[str]:
    """Return what to run to name what is wrong with a member of ours: its columns, and its settings in the system."""
    settings = dict(member.settings)
    settings |= {
        n: s.value
        for n, s in member.inputs.items()
        if s.origin is InputOrigin.SETTING and s.value is not None
    }
    command = ["ppy", "diagnose", str(diagnosis.record.source), "--model", member.model]
    for variable, port in member.measured.items():
        column, unit = diagnosis.columns[port]
        command += ["--map", f"{column}={variable}{unit}"]
    for name, value in settings.items():
        command += ["--set", f"{name}={value}"]
    return command
