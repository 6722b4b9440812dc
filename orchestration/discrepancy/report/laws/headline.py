"""The first lines of a diagnosis: in an engineer's words what a law lacks, and then the verdict."""

from __future__ import annotations

from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import typography, wording
from orchestration.discrepancy.report.laws.asked import Asked
from orchestration.discrepancy.report.laws.wording import sentence
from orchestration.reporting.page import Markup, escaped


def headline(result: Result) -> str:
    """What a law lacks where one was found to lack anything, the verdict, and what must be known to read it."""
    return " ".join(filter(None, (_lacking(result), wording.headline(result))))


def typeset(result: Result) -> Markup:
    """Return the same for a page, quantities of the law as they are printed."""
    return Markup(
        " ".join(
            filter(None, (typography.pretty(_lacking(result)), escaped(wording.headline(result))))
        )
    )


def _lacking(result: Result) -> str:
    """What a law lacks, and which causes that takes the place of; empty where nothing was found, or nothing asked."""
    asked = Asked(result, result.laws)
    if asked.best is None:
        return ""
    gone = [cause for cause in asked.causes if cause not in result.diagnosis.causes]
    return sentence(asked) + (f" It takes the place of {' and '.join(gone)}." if gone else "")
