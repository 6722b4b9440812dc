"""Corrections of a model's laws on a terminal: a sentence, and tables of errors and parameters."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from orchestration.discrepancy.laws import Correction
from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.law_report import (
    LawReport,
    describe_signal,
    shape_estimates,
)
from orchestration.discrepancy.report.wording import format_interval, message
from orchestration.reporting import plain_table


def overview(law_report: LawReport) -> Group:
    """Return what ``ppy laws`` prints."""
    parts: list[RenderableType] = [Text(wording.sentence(law_report), "bold")]
    parts += [Text(message(note)) for note in law_report.result.notes]
    for each in law_report.rounds:
        if each.best is not None:
            parts += [Text(), corrections(each)]
            if each.best.errors[0]:
                parts += [Text(), _errors(each.best)]
            parts += [Text(), _parameters(each, each.best)]
    parts += [Text(), *(Text(step) for step in wording.next_steps(law_report))]
    return Group(*parts)


def corrections(law_report: LawReport) -> RenderableType:
    """Return a table of the corrections that were fitted, the best first."""
    titles = " and ".join(law_report.cause_titles)
    beside = f" beside {titles}" if titles else ""
    head = ["effect", "law", "signal", "fall of BIC", "shape", "unseen data", "alike"]
    table = plain_table(f"corrections{beside}", *head)
    for correction in law_report.corrections:
        entry = correction.entry
        factor = " (factor)" if entry.kind == "multiply" else ""
        table.add_row(
            law_report.effect_name(correction),
            f"{law_report.law_title(correction)}{factor}",
            describe_signal(entry.signal),
            f"{correction.gain:.1f}",
            correction.shape or "a curve",
            wording.unseen_data_outcome(correction),
            _abbreviate(law_report.indistinguishable(correction)),
        )
    return table


def _abbreviate(labels: list[str]) -> str:
    """Return the first of several labels, and how many more there are."""
    more = f" and {len(labels) - 1} more" if len(labels) > 1 else ""
    return "".join(labels[:1]) + more


def _errors(best: Correction) -> RenderableType:
    title = "error on data that no fit has seen, rms over the spread of the signal"
    table = plain_table(title, "output", "without", "with it")
    for row in wording.error_rows(best):
        table.add_row(*row)
    return table


def _parameters(law_report: LawReport, best: Correction) -> RenderableType:
    table = plain_table("parameters of the correction", "name", "value", "95 % interval", "unit")
    for name, e in shape_estimates(best).items():
        interval = format_interval(e.interval, "{:.4g}".format)
        unit = wording.parameter_unit(law_report, best, e)
        table.add_row(name, f"{e.value:.4g}", interval, unit)
    return table
