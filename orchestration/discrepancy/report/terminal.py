"""A diagnosis on a terminal: the verdict, its notes, and tables of errors, evidence and parameters."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fmus.kit.units import shown
from orchestration.discrepancy.changes import Change
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.changes import HEAD, plain_rows
from orchestration.discrepancy.report.errors import RunError, error_rows, run_errors
from orchestration.discrepancy.report.evidence_table import every_tried
from orchestration.discrepancy.report.laws import terminal as law_tables
from orchestration.discrepancy.report.laws.asked import Asked
from orchestration.discrepancy.report.laws.headline import headline
from orchestration.records.joined import shown_name
from orchestration.reporting.console import plain_table

_REJECTED = 5  # effects that were tried in vain, of which the evidence is shown


def overview(result: Result) -> Group:
    """Return what ``ppy diagnose`` prints."""
    diagnosis = result.diagnosis
    parts: list[RenderableType] = [*_said(result), Text()]
    parts += [_errors(diagnosis), Text()]
    if runs := run_errors(result):
        parts += [_runs(runs), Text()]
    if diagnosis.selection.steps or diagnosis.selection.rejected:
        parts += [_evidence(diagnosis), Text()]
    for asked in Asked(result, result.laws).rounds:
        parts += [law_tables.corrections(asked), Text()] if asked.best else []
    parts.append(_parameters(diagnosis))
    if result.experiment:
        parts.append(Text(wording.experiment(result.experiment)))
    return Group(*parts)


def _said(result: Result) -> list[Text]:
    """The verdict with its notes, and by how much parameters differ from nominal."""
    return [
        Text.assemble((result.diagnosis.verdict, "bold"), "  ", headline(result)),
        *(
            Text(wording.message(note))
            for note in result.notes
            if note.code not in wording.IN_HEADLINE
        ),
        *(Text(line) for line in _changes(result.diagnosis)),
    ]


def _errors(diagnosis: Diagnosis) -> Table:
    """Errors of the model as it came, of what least squares makes of it, and of what was made of it here."""
    head, rows = error_rows(diagnosis)
    table = plain_table("error of the free run, rms over the spread of the signal", *head)
    for row in rows:
        table.add_row(*row)
    return table


def _runs(runs: Sequence[RunError]) -> Table:
    """How far off the best model is in every record."""
    rows = plain_table(
        "error by record, rms over the spread of the signal", "record", "", "output", "error"
    )
    for run in runs:
        for output, error in run.nrmse.items():
            rows.add_row(
                run.label, "held out" if run.held_out else "fitted", output, f"{error:.4g}"
            )
    return rows


def comparison(found: Sequence[Change], later: Result) -> Group:
    """Return what ``ppy diagnose --compare`` prints beside: what changed, and what is wrong in the later record."""
    table = plain_table("before and after", *HEAD)
    for row in plain_rows(found):
        table.add_row(*row)
    alone = [Text(), Text(f"{later.files} by itself:"), *_said(later)]
    return Group(Text(), Text(wording.comparison(found)), table, *alone)


def _changes(diagnosis: Diagnosis) -> list[str]:
    """By how much parameters differ from nominal."""
    declared, lines = diagnosis.final.problem.declared, []
    for name in diagnosis.changed:
        e, p = diagnosis.estimates[name], declared[name]
        times = f", times {e.value / e.nominal:.3g}" if e.nominal else ""
        lines.append(f"{name} differs: {shown(e.value, p)} instead of {shown(e.nominal, p)}{times}")
    return lines


def _evidence(diagnosis: Diagnosis) -> Table:
    rows = plain_table("evidence", "effect", "fall of BIC", "verdict", "")
    tried = every_tried(diagnosis)
    rejected = [row for row in tried if row.verdict == "rejected"]
    for row in [*(row for row in tried if row not in rejected), *rejected[:_REJECTED]]:
        rows.add_row(row.candidate.effect_name, f"{row.gain:.1f}", row.verdict, row.why)
    return rows


def _parameters(diagnosis: Diagnosis) -> Table:
    declared = diagnosis.final.problem.declared
    rows = plain_table("parameters", "name", "value", "95 % interval", "nominal")
    for name, e in diagnosis.estimates.items():
        p = declared[name]
        interval = " … ".join(shown(end, p) for end in e.interval)
        rows.add_row(shown_name(name), shown(e.value, p), interval, shown(e.nominal, p))
    return rows
