"""Findings: what a check of an FMU reports."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from orchestration.reporting import Displayable, one_line, plain_table

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
_MOST_LISTED = 8


@dataclass(frozen=True)
class Finding:
    """One fault of an FMU, or a remark on it.

    Attributes
    ----------
    line : int
        Line of the FMU contract that it is about, 1 to 11.
    severity : {"error", "warning", "note"}
        An error breaks FMI or keeps hosts from loading the FMU; a warning breaks the contract
        only; a note is worth knowing.
    message : str
        The fault, its place, and what is expected instead, in one line.
    """

    line: int
    severity: Severity
    message: str


class Findings(Displayable, list[Finding]):
    """The findings about an FMU: a list, which prints as a table.

    Each has ``line`` (of the FMU contract, 1 to 11), ``severity`` (an ``error`` breaks FMI or
    keeps hosts from loading the FMU, a ``warning`` breaks the contract only, a ``note`` is worth
    knowing) and ``message``.
    """

    def __repr__(self) -> str:
        return one_line(f"Findings {self._counts}")

    @property
    def _counts(self) -> str:
        """Number of findings of each severity."""
        listed = [finding.severity for finding in self]
        return ", ".join(f"{listed.count(severity)} {severity}s" for severity in SEVERITIES)

    def overview(self) -> Iterator[RenderableType]:
        """Yield how many there are, and a table of them."""
        yield self._counts
        if self:
            table = plain_table(None, "line", "severity", "message")
            for finding in self:
                table.add_row(str(finding.line), finding.severity, finding.message)
            yield table

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each finding.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        rows = [(finding.line, finding.severity, finding.message) for finding in self]
        return pandas.DataFrame(rows, columns=["line", "severity", "message"])


def listed(names: Iterable[str]) -> str:
    """Return names in one line; of many only the first few."""
    names = list(names)
    more = len(names) - _MOST_LISTED
    return ", ".join(names[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
