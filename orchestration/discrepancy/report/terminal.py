"""A diagnosis on a terminal: the verdict, its notes, and tables of errors, evidence, parameters."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fmus.kit.units import format_value
from orchestration.discrepancy.changes import Change
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.laws import LawReport, headline
from orchestration.discrepancy.report.laws import terminal as law_terminal
from orchestration.discrepancy.report.tables import (
    CHANGE_HEAD,
    RunError,
    change_rows,
    error_table,
    run_errors,
    tried_effects,
)
from orchestration.records import shown_name
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
    for law_report in LawReport(result, result.laws).rounds:
        if law_report.best:
            parts += [law_terminal.corrections(law_report), Text()]
    parts.append(_parameters(diagnosis))
    if result.experiment:
        parts.append(Text(wording.describe_experiment(result.experiment)))
    return Group(*parts)


def comparison(changes: Sequence[Change], later: Result) -> Group:
    """Return what ``ppy diagnose --compare`` prints beside that.

    Parameters
    ----------
    changes : sequence of Change
        Differences between the record and a later one.
    later : Result
        Diagnosis of the later record.
    """
    table = plain_table("before and after", *CHANGE_HEAD)
    for row in change_rows(changes):
        table.add_row(*row)
    sentence = Text(wording.describe_changes(changes))
    by_itself = Text(f"{later.files} by itself:")
    return Group(Text(), sentence, table, Text(), by_itself, *_verdict(later))


def _verdict(result: Result) -> list[Text]:
    """Return the verdict with its notes, and by how much parameters differ from nominal."""
    verdict = Text.assemble((result.diagnosis.verdict, "bold"), "  ", headline(result))
    notes = [note for note in result.notes if note.code not in wording.IN_HEADLINE]
    return [
        verdict,
        *(Text(wording.message(note)) for note in notes),
        *(Text(line) for line in _changed_parameters(result.diagnosis)),
    ]


def _changed_parameters(diagnosis: Diagnosis) -> list[str]:
    """Return by how much parameters differ from nominal, a line each."""
    lines = []
    for name in diagnosis.changed:
        e = diagnosis.estimates[name]
        declared = diagnosis.final.problem.declared[name]
        times = f", times {e.value / e.nominal:.3g}" if e.nominal else ""
        value = format_value(e.value, declared)
        nominal = format_value(e.nominal, declared)
        lines.append(f"{name} differs: {value} instead of {nominal}{times}")
    return lines


def _errors(diagnosis: Diagnosis) -> Table:
    """Return the errors of the model untouched, fitted by least squares, refitted and extended."""
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
    table = plain_table("evidence", "effect", "fall of BIC", "verdict", "")
    tried = tried_effects(diagnosis)
    rejected = [row for row in tried if row.verdict == "rejected"]
    others = [row for row in tried if row.verdict != "rejected"]
    for row in others + rejected[:_REJECTED]:
        table.add_row(row.candidate.effect_name, f"{row.gain:.1f}", row.verdict, row.reason)
    return table


def _parameters(diagnosis: Diagnosis) -> Table:
    table = plain_table("parameters", "name", "value", "95 % interval", "nominal")
    for name, e in diagnosis.estimates.items():
        declared = diagnosis.final.problem.declared[name]
        interval = wording.format_interval(e.interval, partial(format_value, variable=declared))
        value = format_value(e.value, declared)
        table.add_row(shown_name(name), value, interval, format_value(e.nominal, declared))
    return table
