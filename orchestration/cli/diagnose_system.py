"""What ``ppy diagnose RECORD --system S.ssp`` shows on the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.kit.errors import UserError
from orchestration.cli.outputs import JSON, Outputs, write_json
from orchestration.discrepancy.residuals.operating_regions import told
from orchestration.discrepancy.systems.diagnose import diagnose_system
from orchestration.discrepancy.systems.verdict import SystemDiagnosis
from orchestration.reporting.console import out, plain_table, progress, tell_repairs

_SENTENCES = {
    "wrong": "The structure of {members} is wrong.",
    "recalibrate": "The structure of all that could be judged is fine; parameters of {members} differ.",
    "consistent": "All that could be judged is consistent with the record.",
    "cannot be judged": "Nothing can be judged from this record.",
}


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
        found = diagnose_system(record, system, mapping, settings, tell)
    show(found, record.name)
    write_json(result, found.as_json())


def show(found: SystemDiagnosis, record: str) -> None:
    """Print which members are wrong, what each was judged by, and where the wrong ones fail.

    Parameters
    ----------
    found : SystemDiagnosis
    record : str
        File of the record, for the hint what to run next.
    """
    tell_repairs(found.record.repairs)
    blamed = ", ".join(m.name for m in found.members if m.verdict == found.verdict)
    out.print(_SENTENCES[found.verdict].format(members=blamed), style="bold", markup=False)
    table = plain_table(None, "member", "verdict", "why")
    for m in found.members:
        table.add_row(m.name, m.verdict, m.why)
    out.print(table)
    table = plain_table("outputs", "output", "fit", "RMS error", "noise", "in doubt", "explained by its signals")
    for m in found.members:
        for output, j in m.final.items():
            before = m.before[output].fit_percent
            fit = f"{before:.1f} % → {j.fit_percent:.1f} %" if m.after else f"{before:.1f} %"
            sizes = (f"{size:.3g} {j.unit}" for size in (j.rms, j.noise, j.doubt))
            share = f"{j.explained.rms:.3g} {j.unit}" if j.explained.significant else "nothing"
            table.add_row(f"{m.name}.{output}", fit, *sizes, share)
    out.print(table)
    for m in found.members:
        if m.verdict == "wrong":
            for j in m.final.values():
                for line in told(j.regions)[:3]:
                    out.print(f"{m.name}: {line}")
        if m.verdict in ("wrong", "recalibrate") and m.ours:
            columns = " ".join(f"--map {name}={signal}" for signal, name in m.signals.items())
            out.print(f"to name the cause: ppy diagnose {record} --model {m.model} {columns}")
