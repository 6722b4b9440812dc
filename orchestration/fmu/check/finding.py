"""Findings of the check of an FMU, and their presentation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

from orchestration.reporting import Displayable, one_line, plain_table

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
_MOST_LISTED = 8


class Rule(NamedTuple):
    """Meaning of a code: a line of the FMU contract, and the severity of breaking it.

    Attributes
    ----------
    line : int
        Line of the FMU contract, 1 to 11.
    severity : {"error", "warning", "note"}
        An error violates FMI or keeps hosts from loading the FMU; a warning violates the contract
        only; a note is a remark.
    """

    line: int
    severity: Severity


_CODES: Mapping[tuple[int, Severity], str] = {
    (1, "error"): "model-description no-interface model-identifier terminals",
    (1, "warning"): "no-dependencies model-exchange-only",
    (1, "note"): "scheduled-execution idle-clock binary-variable structural-parameter",
    (2, "error"): "base-unit unit-factor unit-offset range nominal start-value",
    (2, "warning"): "no-unit-definitions no-unit no-base-unit no-model-description no-description",
    (2, "note"): "no-range",
    (3, "error"): "no-guid",
    (3, "warning"): "guid-not-from-contents generation-date entry-times",
    (3, "note"): "guid-form",
    (4, "error"): "missing-functions",
    (4, "warning"): "unsupplied-symbols",
    (4, "note"): "no-log-categories",
    (5, "warning"): "no-state",
    (6, "warning"): "one-instance",
    (6, "note"): "exported-symbols",
    (8, "warning"): "fixed-step",
    (10, "error"): "default-experiment path-outside duplicate-entry symbolic-link setuid"
    " damaged-entry missing-source build-description no-binaries missing-binary binary-format",
    (10, "warning"): "compression no-documentation no-licence no-external-dependencies"
    " external-dependencies unlisted-sources sources-only foreign-libraries",
    (10, "note"): "no-default-experiment no-icon no-reference-result missing-platform"
    " unknown-platform system-libraries",
    (11, "note"): "no-derivatives",
}
RULES = {code: Rule(*rule) for rule, codes in _CODES.items() for code in codes.split()}
"""Rules by the code of a finding, which stays the same over versions."""


@dataclass(frozen=True)
class Finding:
    """One fault of an FMU, or a remark on it.

    Attributes
    ----------
    code : str
        Name of the rule that is broken, a key of `RULES`.
    message : str
        The fault, its place and the expected value, in one line.
    variables : sequence of str
        Names of the variables that it is about; empty if it is about the FMU as a whole.
    """

    code: str
    message: str
    variables: Sequence[str] = ()

    @property
    def line(self) -> int:
        """Line of the FMU contract to which it refers, 1 to 11."""
        return RULES[self.code].line

    @property
    def severity(self) -> Severity:
        """Severity of its rule: an error, a warning or a note."""
        return RULES[self.code].severity


class Findings(Displayable, list[Finding]):
    """The findings of the check of an FMU: a list that prints as a table.

    Each has a ``code``, which stays the same over versions, ``line`` (of the FMU contract, 1 to
    11), ``severity`` (an ``error`` violates FMI or keeps hosts from loading the FMU, a ``warning``
    violates the contract only, a ``note`` is a remark), ``message`` and ``variables``.
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
            rows = [(str(one.line), one.severity, one.code, one.message) for one in self]
            yield plain_table(None, "line", "severity", "code", "message", rows=rows)

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each finding.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        rows = [(one.line, one.severity, one.code, one.message) for one in self]
        return pandas.DataFrame(rows, columns=["line", "severity", "code", "message"])


def listed(names: Iterable[str]) -> str:
    """Return names in one line, the first eight and the number of the others."""
    each = list(names)
    more = len(each) - _MOST_LISTED
    return ", ".join(each[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
