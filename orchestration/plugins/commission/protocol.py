"""The protocol of a commissioning: its lines, their verdicts and what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

PASS = "pass"
FAILED = "FAILED"
NOT_CONFIRMED = "not confirmed"
NOT_APPLICABLE = "not applicable"
INTERRUPTED = "interrupted by the operator"


class Row(NamedTuple):
    """The inputs of a rig at one time, each by name in SI.

    Attributes
    ----------
    time : float
        Clock of the rig, s.
    state : str
        State of the rig, such as ``running``.
    commanded : Mapping of str to float
        Values that the client asks for.
    applied : Mapping of str to float or None
        Values that the server wrote; None for one that it does not know.
    read_back : Mapping of str to float
        Values that the device reports, of those inputs that it reports.
    """

    time: float
    state: str
    commanded: Mapping[str, float]
    applied: Mapping[str, float | None]
    read_back: Mapping[str, float]


class Finding(NamedTuple):
    """The outcome of a check.

    Attributes
    ----------
    verdict : {"pass", "FAILED", "not confirmed", "not applicable"}
    measured : str
        What was measured, or why nothing was.
    marks : tuple of (float, str)
        Times of the rig's clock, s, each with its text: the fault, and the end of the bound.
    """

    verdict: str
    measured: str
    marks: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class Line:
    """One check: what was done, what must hold, and what was found.

    Attributes
    ----------
    title, action, requirement : str
    finding : Finding
    rows : tuple of Row
        Inputs of the rig meanwhile.
    """

    title: str
    action: str
    requirement: str
    finding: Finding
    rows: tuple[Row, ...] = ()

    @property
    def verdict(self) -> str:
        """Verdict of the check."""
        return self.finding.verdict


@dataclass(frozen=True)
class Protocol:
    """The protocol of a commissioning.

    Attributes
    ----------
    facts : Mapping of str to str
        Date, version, backend, options and digests of its files, by what they are of.
    units : Mapping of str to str
        Units of the inputs.
    lines : tuple of Line
    log : tuple of str
        Lines of the server.
    interrupted : str
        Why the procedure ended early; empty if it did not.
    """

    facts: Mapping[str, str]
    units: Mapping[str, str]
    lines: tuple[Line, ...]
    log: tuple[str, ...] = ()
    interrupted: str = ""

    @property
    def has_failed(self) -> bool:
        """True if a protection failed."""
        return any(line.verdict == FAILED for line in self.lines)

    @property
    def conclusion(self) -> str:
        """The result of the whole, in a few words."""
        if self.has_failed:
            return "a protection FAILED"
        return "not finished" if self.interrupted else "no protection failed"

    @property
    def summary(self) -> str:
        """The number of lines of each verdict, in one sentence."""
        verdicts = [line.verdict for line in self.lines]
        counts = (
            f"{verdicts.count(verdict)} {verdict}"
            for verdict in (PASS, FAILED, NOT_CONFIRMED, NOT_APPLICABLE)
            if verdict in verdicts
        )
        early = f"ended early: {self.interrupted}; " if self.interrupted else ""
        return f"{early}{', '.join(counts) or 'nothing was tried'}"

    def to_json(self) -> dict[str, Any]:
        """Return the protocol for a file of JSON."""
        return asdict(self)
