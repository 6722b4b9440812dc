"""A diagnosis on a terminal: the verdict, the group, the ladder, what is left, and parameters."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.report import wording
from orchestration.diagnosis.term_names import memory_text, shape_text
from orchestration.diagnosis.terms import Term
from orchestration.reporting import plain_table

Rows = Sequence[tuple[str, ...]]
GROUP_HEAD = ("probability", "cause", "shape", "memory", "with", "error")
LADDER_HEAD = ("model", "term added", "error")
REMAINDER_HEAD = ("output", "of its spread", "noise widths", "pace", "correlation")
PARAMETER_HEAD = ("parameter", "value", "95 % interval", "nominal")


def overview(diagnosis: Diagnosis) -> Group:
    """Return what ``ppy diagnose`` prints."""
    first = Text.assemble((diagnosis.verdict, "bold"), "  ", (wording.headline(diagnosis), "bold"))
    parts: list[RenderableType] = [first, Text(wording.support(diagnosis))]
    parts.append(Text(f"Next: {wording.next_step(diagnosis)}"))
    parts += [Text(f"  {message}") for _, _, message in diagnosis.notes]
    if diagnosis.causes:
        named = "causes" if diagnosis.is_named else "best guesses"
        parts += [Text(), _table(named, GROUP_HEAD, group_rows(diagnosis), (0, 5))]
        parts += [Text(), _table("error by terms", LADDER_HEAD, ladder_rows(diagnosis), (2,))]
    parts += [Text(), _table("what is left", REMAINDER_HEAD, remainder_rows(diagnosis), (1, 2, 4))]
    parts += [Text(), _table("parameters", PARAMETER_HEAD, parameter_rows(diagnosis), (1, 3))]
    return Group(*parts)


def _table(title: str, head: Sequence[str], rows: Rows, right: Sequence[int]) -> Table:
    table = plain_table(title, *head, right=[head[k] for k in right])
    for row in rows:
        table.add_row(*row)
    return table


def group_rows(diagnosis: Diagnosis) -> Rows:
    """Return a row for each cause of the group."""
    rows = []
    for cause in diagnosis.causes:
        first, *others = cause.parts
        term = first if isinstance(first, Term) else None
        rows.append(
            (
                wording.percent(cause.probability),
                wording.cause_text(diagnosis, cause),
                shape_text(term) if term else "",
                memory_text(term) if term else "",
                "; ".join(wording.part_text(diagnosis, part) for part in others),
                wording.error_text(diagnosis.error(cause.judged)),
            )
        )
    return rows


def ladder_rows(diagnosis: Diagnosis) -> Rows:
    """Return a row for each number of terms."""
    rows = []
    for rung in diagnosis.ladder:
        last = rung.parts[-1] if rung.parts else None
        added = "parameters refitted" if last is None else wording.part_text(diagnosis, last)
        count = wording.number_of_terms(len(rung.terms))
        rows.append((count, added, wording.error_text(rung.error)))
    return rows


def remainder_rows(diagnosis: Diagnosis) -> Rows:
    """Return a row for each output."""
    return [
        (
            one.output,
            wording.error_text(one.share),
            wording.noise_widths(one),
            "slow" if one.is_slow else "fast",
            f"{one.correlation:.2f}",
        )
        for one in diagnosis.remainders
    ]


def parameter_rows(diagnosis: Diagnosis) -> Rows:
    """Return a row for each parameter; those that differ from nominal are marked."""
    of_terms = {name for name in diagnosis.parameters if name.startswith(tuple(diagnosis.terms))}
    rows = []
    for name, estimate in diagnosis.parameters.items():
        rows.append(
            (
                f"{name} *" if name in diagnosis.changed else name,
                wording.quantity(diagnosis, name, estimate.value),
                wording.interval(diagnosis, name, estimate),
                "" if name in of_terms else wording.quantity(diagnosis, name, estimate.nominal),
            )
        )
    return rows
