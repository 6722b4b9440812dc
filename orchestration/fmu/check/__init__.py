"""Check of any FMU against the static part of the FMU contract, without running it."""

from __future__ import annotations

from pathlib import Path

from orchestration.fmu.archive import Archive
from orchestration.fmu.check.archive import check_archive
from orchestration.fmu.check.binaries import check_binaries
from orchestration.fmu.check.description import check_description
from orchestration.fmu.check.finding import RULES, SEVERITIES, Finding, Findings
from orchestration.fmu.check.terminals import check_terminals

__all__ = ["RULES", "SEVERITIES", "Finding", "Findings", "check_fmu"]


def check_fmu(path: Path) -> Findings:
    """Check any FMU against the static part of the FMU contract.

    Parameters
    ----------
    path : Path
        The ``.fmu`` file.

    Returns
    -------
    Findings
        Errors first, then warnings, then notes, each by line of the contract.

    Raises
    ------
    UserError
        If the file is missing, no zip archive, or no FMU of FMI 2.0 or 3.0.
    """
    with Archive(Path(path)) as archive:
        findings = [
            *check_description(archive),
            *check_archive(archive),
            *check_terminals(archive),
            *check_binaries(archive),
        ]
    return Findings(
        sorted(findings, key=lambda finding: (SEVERITIES.index(finding.severity), finding.line))
    )
