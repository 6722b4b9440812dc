"""Findings of ``ppy check`` that a file accepts, each for a reason and perhaps until a day."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field

from fmus.kit.errors import UserError, suggestion
from orchestration.experiment.values import ValueTable, checked, read_toml
from orchestration.fmu.check import RULES, Finding


class Acceptance(ValueTable):
    """An entry of the file: which finding is accepted, why, and until when.

    Attributes
    ----------
    code : str
        That of the finding.
    why : str
    variable : str, optional
        The only variable for which it is accepted.
    fmu : str, optional
        Name of the only FMU file for which it is accepted.
    until : date, optional
        Last day on which it is accepted.
    """

    code: str
    why: Annotated[str, Field(min_length=1)]
    variable: str | None = None
    fmu: str | None = None
    until: date | None = None

    def __str__(self) -> str:
        return ", ".join(filter(None, (self.code, self.variable, self.fmu)))

    def concerns(self, finding: Finding, fmu: Path) -> bool:
        """Return whether the entry is about a finding of an FMU."""
        return (
            self.code == finding.code
            and (self.fmu is None or self.fmu == fmu.name)
            and (self.variable is None or self.variable in finding.variables)
        )


class _File(ValueTable):
    accept: list[Acceptance]


class Judged(NamedTuple):
    """A finding, and why it is accepted; an empty text if it is not."""

    finding: Finding
    accepted: str = ""


def read_acceptances(path: Path) -> list[Acceptance]:
    """Read the tables ``[[accept]]`` of a file.

    Raises
    ------
    UserError
        If the file cannot be read, a key or a code is unknown, or a reason is missing.
    """
    entries = checked(_File, read_toml(path), str(path)).accept
    for entry in entries:
        if entry.code not in RULES:
            raise UserError(
                f"{path}: no finding has the code {entry.code!r}{suggestion(entry.code, RULES)}"
            )
    return entries


def judge(
    findings: Iterable[Finding], entries: Sequence[Acceptance], fmu: Path, today: date
) -> Iterator[Judged]:
    """Yield the findings of an FMU with the reasons for which entries accept them.

    A finding about several variables is accepted if it is for each of them. The message of one that
    is not tells what entries lack.
    """
    for finding in findings:
        concerned = [entry for entry in entries if entry.concerns(finding, fmu)]
        valid = [entry for entry in concerned if today <= (entry.until or today)]
        named = {entry.variable for entry in valid}
        rest = [] if None in named else [n for n in finding.variables if n not in named]
        if valid and not rest:
            yield Judged(finding, "; ".join(dict.fromkeys(entry.why for entry in valid)))
            continue
        lacks = [f"; not accepted for {', '.join(rest)}"] if valid else []
        lacks += [f"; accepted until {entry.until} only" for entry in concerned if entry.until]
        yield Judged(replace(finding, message=finding.message + "".join(lacks)))
