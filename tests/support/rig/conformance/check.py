"""Check of a server: every rule in turn, and what was seen where one does not hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from orchestration.rig.endpoint import Endpoint
from tests.support.rig.conformance.probe import BrokenError, NotTriedError, Probe
from tests.support.rig.conformance.rules import RULES


class RuleVerdict(NamedTuple):
    """Verdict on a rule.

    Attributes
    ----------
    rule : str
    holds : bool or None
        None if it was not tried.
    seen : str
        Why it does not hold, or was not tried.
    """

    rule: str
    holds: bool | None
    seen: str

    def __str__(self) -> str:
        if self.holds:
            return f"holds      {self.rule}"
        word = "not tried " if self.holds is None else "BROKEN    "
        return f"{word} {self.rule}: {self.seen}"


def check_server(
    remote: Endpoint, beyond_limits: bool = False, tell: Callable[[RuleVerdict], None] = print
) -> list[RuleVerdict]:
    """Check a server against the rules of the protocol.

    The rig is commanded to zero, stopped and released again and again.

    Parameters
    ----------
    remote : Endpoint
    beyond_limits : bool
        Whether a command beyond a limit may be sent, which a right server refuses.
    tell : callable
        Called with each verdict as soon as there is one.

    Returns
    -------
    list of RuleVerdict

    Raises
    ------
    UserError
        If the server does not answer, or somebody uses it.
    """
    probe = Probe(remote, beyond_limits)
    verdicts = []
    try:
        for rule in RULES:
            holds: bool | None = True
            seen = ""
            try:
                rule.check(probe)
            except NotTriedError as reason:
                holds, seen = None, str(reason)
            except BrokenError as broken:
                holds, seen = False, str(broken)
            verdicts.append(RuleVerdict(rule.text, holds, seen))
            tell(verdicts[-1])
            probe.settle()
    except BrokenError as broken:
        verdicts.append(RuleVerdict("a rig can be stopped and released", False, str(broken)))
        tell(verdicts[-1])
    finally:
        probe.close()
    return verdicts
