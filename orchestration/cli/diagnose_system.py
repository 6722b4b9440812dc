"""What ``ppy diagnose RECORD --system S.ssp`` reads, shows and writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.kit.errors import UserError
from orchestration.cli.outputs import JSON, Outputs, write_json
from orchestration.discrepancy.report.system_summary import summary
from orchestration.discrepancy.report.system_terminal import overview
from orchestration.discrepancy.systems.diagnose import diagnose_system
from orchestration.reporting.console import out, progress, tell_repairs


def run(
    record: Path,
    system: Path,
    mapping: Sequence[str],
    settings: Sequence[str],
    result: Path | None,
    others: Mapping[str, object],
) -> None:
    """Do ``ppy diagnose --system``.

    Raises
    ------
    UserError
        If the record or the system cannot be used, or an option is given that is of one model only.
    """
    unfit = [option for option, value in others.items() if value is not None]
    if unfit:
        raise UserError(
            f"{unfit[0]} is about one model; --system tells which member to name with --model"
        )
    Outputs(
        {"the record": record, "the system": system}, {"--json": result}, {"--json": JSON}
    ).check()
    with progress() as tell:
        diagnosis = diagnose_system(record, system, mapping, settings, tell)
    tell_repairs(diagnosis.record.repairs)
    out.print(overview(diagnosis))
    write_json(result, summary(diagnosis))
