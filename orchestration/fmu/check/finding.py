"""Findings of the check of an FMU, and their presentation."""

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
        Line of the FMU contract to which it refers, 1 to 11.
    severity : {"error", "warning", "note"}
        An error violates FMI or keeps hosts from loading the FMU; a warning violates the contract
        only; a note is a remark.
    message : str
        The fault, its place and the expected value, in one line.
    """

    line: int
    severity: Severity
    message: str


class Findings(Displayable, list[Finding]):
    """The findings of the check of an FMU: a list that prints as a table.

    Each has ``line`` (of the FMU contract, 1 to 11), ``severity`` (an ``error`` violates FMI or
    keeps hosts from loading the FMU, a ``warning`` violates the contract only, a ``note`` is a
    remark) and ``message``.
    """

    def __repr__(self) -> str:
        return one_line(f"Findings {self._counts}")

    @property
    def _counts(self) -> str:
        """Number of findings of each severity, as text."""
        all_severities = [finding.severity for finding in self]
        return ", ".join(f"{all_severities.count(name)} {name}s" for name in SEVERITIES)

    def overview(self) -> Iterator[RenderableType]:
        """Yield the numbers of findings by severity, and a table of the findings."""
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
    """Return names in one line, the first eight and the number of the others."""
    each = list(names)
    more = len(each) - _MOST_LISTED
    return ", ".join(each[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
