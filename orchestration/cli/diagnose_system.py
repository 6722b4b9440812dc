"""What ``ppy diagnose RECORD --system S.ssp`` shows on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.kit.errors import UserError
from orchestration.cli.outputs import JSON, Outputs, write_json
from orchestration.discrepancy.report.system_json import as_json
from orchestration.discrepancy.report.system_wording import sentence, why
from orchestration.discrepancy.report.wording import most_telling
from orchestration.discrepancy.systems.diagnose import diagnose_system
from orchestration.discrepancy.systems.verdict import MemberDiagnosis, MemberVerdict, SystemDiagnosis
from orchestration.reporting.console import out, plain_table, progress, tell_repairs

_REGIONS = 3  # that are printed of every output of a wrong member


def run(
    record: Path, system: Path, mapping: Sequence[str], settings: Sequence[str], result: Path | None,
    others: Mapping[str, object],
) -> None:  # fmt: skip
    """Do ``ppy diagnose --system``.

    Raises
    ------
    UserError
        If the record or the system cannot be used, or an option is given that is of one model only.
    """
    unfit = [option for option, value in others.items() if value is not None]
    if unfit:
        raise UserError(f"{unfit[0]} is about one model; --system tells which member to name with --model")
    Outputs({"the record": record, "the system": system}, {"--json": result}, {"--json": JSON}).check()
    with progress() as tell:
        diagnosis = diagnose_system(record, system, mapping, settings, tell)
    show(diagnosis, record.name)
    write_json(result, as_json(diagnosis))


def show(diagnosis: SystemDiagnosis, record: str) -> None:
    """Print which members are wrong, what each was judged by, and where the wrong ones fail.

    Parameters
    ----------
    diagnosis : SystemDiagnosis
    record : str
        File of the record, for the hint what to run next.
    """
    tell_repairs(diagnosis.record.repairs)
    out.print(sentence(diagnosis), style="bold", markup=False)
    table = plain_table(None, "member", "verdict", "why")
    for member in diagnosis.members:
        table.add_row(member.name, member.verdict, why(member))
    out.print(table)
    table = plain_table("outputs", "output", "fit", "RMS error", "noise", "in doubt", "explained by its signals")
    for member in diagnosis.members:
        for output in member.final:
            table.add_row(f"{member.name}.{output}", *_figures(member, output))
    out.print(table)
    for member in diagnosis.members:
        if member.verdict is MemberVerdict.WRONG:
            for assessment in member.final.values():
                for line in most_telling(assessment.regions)[:_REGIONS]:
                    out.print(f"{member.name}: {line}")
        if member.verdict in (MemberVerdict.WRONG, MemberVerdict.RECALIBRATE) and member.equations_known:
            columns = " ".join(f"--map {name}={signal}" for signal, name in member.columns.items())
            out.print(f"to name the cause: ppy diagnose {record} --model {member.model} {columns}")


def _figures(member: MemberDiagnosis, output: str) -> list[str]:
    """Fit, RMS error, noise, input uncertainty and what is explained of an output."""
    before, final = member.before[output].fit_percent, member.final[output]
    fit = f"{before:.1f} % → {final.fit_percent:.1f} %" if member.after else f"{before:.1f} %"
    sizes = (f"{size:.3g} {final.unit}" for size in (final.rms, final.noise_std, final.input_uncertainty))
    explained = f"{final.regression.rms:.3g} {final.unit}" if final.regression.significant else "nothing"
    return [fit, *sizes, explained]
