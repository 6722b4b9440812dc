"""A diagnosis on a terminal: the verdict, its notes, and tables of errors, evidence, parameters."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fmus.kit.titles import effect_title
from fmus.kit.units import format_value
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.note import notes_by_action
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.tables import (
    RunError,
    error_table,
    run_errors,
    tried_effects,
)
from orchestration.discrepancy.report.wording import meanings_of
from orchestration.identify import changes
from orchestration.identify.changes import Change
from orchestration.records.runs import shown_name
from orchestration.reporting import plain_table

_REJECTED = 5  # effects that were tried in vain, of which the evidence is shown


def overview(result: Result) -> Group:
    """Return what ``ppy diagnose`` prints."""
    diagnosis = result.diagnosis
    parts: list[RenderableType] = [*_verdict(result), Text(), _errors(diagnosis), Text()]
    runs = run_errors(result)
    if runs:
        parts += [_errors_by_record(runs), Text()]
    if diagnosis.selection.steps or diagnosis.selection.rejected:
        parts += [_evidence(diagnosis), Text()]
    parts.append(_parameters(diagnosis))
    if result.experiment:
        parts.append(Text(result.experiment.sentence))
    return Group(*parts)


def comparison(found: Sequence[Change], later: Result) -> Group:
    """Return what ``ppy diagnose --compare`` prints beside that.

    Parameters
    ----------
    found : sequence of Change
        Differences between the record and a later one.
    later : Result
        Diagnosis of the later record.
    """
    table = plain_table("before and after", *changes.CHANGE_HEAD)
    for row in changes.change_rows(found):
        table.add_row(*row)
    sentence = Text(changes.describe_changes(found))
    by_itself = Text(f"{later.files} by itself:")
    return Group(Text(), sentence, table, Text(), by_itself, *_verdict(later))


def _verdict(result: Result) -> list[Text]:
    """Return the answer, what supports it, what to do next, and notes by what to do about them."""
    answer = wording.headline(result)
    first = Text.assemble((result.diagnosis.verdict, "bold"), "  ", (answer.first, "bold"))
    lines = [first, *([Text(" ".join(answer.support))] if answer.support else [])]
    notes = [note for note in result.notes if note.code not in wording.IN_HEADLINE]
    for action, group in notes_by_action(notes).items():
        lines += [Text(), Text(f"{action}:"), *(Text(f"  {wording.message(n)}") for n in group)]
    return lines


def _errors(diagnosis: Diagnosis) -> Table:
    """Return the errors of the model as it is, with parameters refitted, and with the effect."""
    head, rows = error_table(diagnosis)
    table = plain_table("error of the free run, rms over the spread of the signal", *head)
    for row in rows:
        table.add_row(*row)
    return table


def _errors_by_record(runs: Sequence[RunError]) -> Table:
    """Return how far off the best model is in every record."""
    table = plain_table(
        "error by record, rms over the spread of the signal", "record", "", "output", "error"
    )
    for run in runs:
        part = "held out" if run.held_out else "fitted"
        for output, error in run.nrmse.items():
            table.add_row(run.label, part, output, wording.format_error(error))
    return table


def _evidence(diagnosis: Diagnosis) -> Table:
    """Return the effects that were tried, of those rejected only the first few."""
    table = plain_table("evidence", "effect", "fall of BIC", "verdict", "", "id")
    table.columns[-1].no_wrap = True
    tried = tried_effects(diagnosis)
    rejected = [row for row in tried if row.verdict == "rejected"]
    others = [row for row in tried if row.verdict != "rejected"]
    for row in others + rejected[:_REJECTED]:
        title = effect_title(row.candidate.effect)
        name = row.candidate.effect_name
        table.add_row(title, f"{row.gain:.1f}", row.verdict, row.reason, name)
    return table


def _parameters(diagnosis: Diagnosis) -> Table:
    owners = {n: e for e in diagnosis.selection.best.candidate.effects for n in e.declared}
    table = plain_table("parameters", "name", "value", "95 % interval", "nominal", "is")
    for name, e in diagnosis.estimates.items():
        declared = diagnosis.final.problem.declared[name]
        interval = wording.format_interval(e.interval, partial(format_value, variable=declared))
        value = format_value(e.value, declared)
        means = [f"{wording.parameter_title(diagnosis, name)}{_mark(diagnosis, name)}"]
        if name in owners:
            means += meanings_of(diagnosis, owners[name], name)
        nominal = format_value(e.nominal, declared)
        table.add_row(shown_name(name), value, interval, nominal, "; ".join(means))
    return table


def _mark(diagnosis: Diagnosis, name: str) -> str:
    """Return by how much a parameter differs from nominal; empty unless it surely does."""
    e = diagnosis.estimates[name]
    if name not in diagnosis.changed:
        return ""
    return f", differs: times {e.value / e.nominal:.3g}" if e.nominal else ", differs"
