"""``ppy check``: FMUs checked against the static part of the contract."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from orchestration.cli.command import command
from orchestration.cli.commands.options import CheckCommand
from orchestration.cli.outputs import JSON, Outputs, standard_output_for, write_json

if TYPE_CHECKING:
    from orchestration.fmu.check import Finding


@command(CheckCommand)
def check(options: CheckCommand) -> None:
    """Check FMUs against the static part of the contract."""
    from dataclasses import asdict

    from orchestration.fmu.check import check_fmu

    fmus = options["fmus"]
    path = options["json"]
    Outputs({f"the FMU {fmu}": fmu for fmu in fmus}, {"--json": path}, {"--json": JSON}).check()
    findings = {fmu: check_fmu(fmu) for fmu in fmus}
    figures = [
        {
            "file": str(fmu),
            "errors": _count(among, "error"),
            "warnings": _count(among, "warning"),
            "findings": [asdict(finding) for finding in among],
        }
        for fmu, among in findings.items()
    ]
    with standard_output_for(path):
        for fmu, among in findings.items():
            _show(fmu, among)
        write_json(path, figures)
    if any(_count(among, "error") for among in findings.values()):
        raise typer.Exit(1)


def _count(findings: Sequence[Finding], severity: str) -> int:
    return sum(finding.severity == severity for finding in findings)


def _show(fmu: Path, findings: Sequence[Finding]) -> None:
    """Print the findings about an FMU, and their number."""
    from rich.text import Text

    from orchestration.reporting.console import out

    for finding in findings:
        style = {"error": "red", "warning": "yellow"}.get(finding.severity, "dim")
        line = f" (contract line {finding.line}) {finding.message}"
        out.print(Text.assemble(f"{fmu}: ", (finding.severity, style), line))
    errors = _count(findings, "error")
    warnings = _count(findings, "warning")
    out.print(f"{fmu}: {errors or 'no'} errors, {warnings} warnings")
