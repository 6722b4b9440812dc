"""``ppy check``: FMUs checked against the static part of the contract."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestration.cli.command import command
from orchestration.cli.commands.options import CheckCommand
from orchestration.cli.outputs import check_outputs, write_json

if TYPE_CHECKING:
    from orchestration.cli.acceptance import Judged
    from orchestration.cli.verdicts import Case


@command(CheckCommand)
def check(options: CheckCommand) -> None:
    """Check FMUs against the static part of the contract.

    A file of --accept has a table of the list accept for each finding that does not count, with
    its code, why, and perhaps variable, fmu and until, the last day.
    """
    from datetime import date

    from orchestration.cli.acceptance import judge, read_acceptances
    from orchestration.cli.verdicts import conclude
    from orchestration.fmu.check import check_fmu
    from orchestration.reporting.console import note

    fmus = options["fmus"]
    path = options["json"]
    accept = options["accept"]
    reads = {f"the FMU {fmu}": fmu for fmu in fmus}
    check_outputs(options, {**reads, "the file of --accept": accept})
    entries = [] if accept is None else read_acceptances(accept)
    findings = {fmu: check_fmu(fmu) for fmu in fmus}
    judged = {fmu: [*judge(among, entries, fmu, date.today())] for fmu, among in findings.items()}
    for entry in entries:
        if not any(entry.concerns(one, fmu) for fmu in fmus for one in findings[fmu]):
            note(f"{accept}: {entry}: there is no such finding; the entry can go")
    for fmu, among in judged.items():
        _show(fmu, among)
    write_json(path, [_as_json(fmu, among) for fmu, among in judged.items()])
    cases = [case for fmu in judged for case in _cases(fmu, judged[fmu], options["fail_on"])]
    conclude("ppy check", cases, options["junit"])


def _count(judged: Sequence[Judged], severity: str) -> int:
    return sum(one.finding.severity == severity and not one.accepted for one in judged)


def _as_json(fmu: Path, judged: Sequence[Judged]) -> dict[str, Any]:
    """Gather the findings about an FMU, and the numbers of those that are not accepted."""
    return {
        "file": str(fmu),
        "errors": _count(judged, "error"),
        "warnings": _count(judged, "warning"),
        "findings": [
            {
                "code": finding.code,
                "line": finding.line,
                "severity": finding.severity,
                "message": finding.message,
                "variables": list(finding.variables),
                "accepted": accepted or None,
            }
            for finding, accepted in judged
        ],
    }


def _cases(fmu: Path, judged: Sequence[Judged], fail_on: str) -> list[Case]:
    """Return a case for each rule of an FMU, so that a rule has one over all builds."""
    from orchestration.cli.verdicts import Case
    from orchestration.fmu.check import RULES, SEVERITIES

    failing = SEVERITIES[: SEVERITIES.index(fail_on) + 1]
    cases = []
    for code, rule in RULES.items():
        failures = []
        skipped = []
        for finding, accepted in judged:
            if finding.code != code:
                continue
            if accepted:
                skipped.append(f"{finding.message}: accepted, {accepted}")
            elif rule.severity in failing:
                failures.append(finding.message)
            else:
                skipped.append(f"{finding.message}: {rule.severity} only")
        cases.append(Case(str(fmu), code, "; ".join(failures), "; ".join(skipped)))
    return cases


def _show(fmu: Path, judged: Sequence[Judged]) -> None:
    """Print the findings about an FMU, and their number."""
    from rich.text import Text

    from orchestration.reporting.console import out

    for finding, accepted in judged:
        style = {"error": "red", "warning": "yellow"}.get(finding.severity, "dim")
        word = ("accepted", "dim") if accepted else (finding.severity, style)
        line = f" (contract line {finding.line}, {finding.code}) {finding.message}"
        out.print(Text.assemble(f"{fmu}: ", word, line, f": {accepted}" if accepted else ""))
    errors = _count(judged, "error")
    warnings = _count(judged, "warning")
    number = sum(bool(one.accepted) for one in judged)
    accepted_too = f", {number} accepted" if number else ""
    out.print(f"{fmu}: {errors or 'no'} errors, {warnings} warnings{accepted_too}")
