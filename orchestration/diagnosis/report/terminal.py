"""A diagnosis on a terminal: the verdict, the group, the ladder, what is left, and parameters."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fmus.kit.titles import in_words
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.law_map import LawMap
from orchestration.diagnosis.remainder import TESTS
from orchestration.diagnosis.report import wording
from orchestration.diagnosis.term_names import memory_text, sentence, shape_text
from orchestration.diagnosis.terms import Term
from orchestration.identify.changes import CHANGE_HEAD, change_rows, describe_changes
from orchestration.reporting import plain_table

Rows = Sequence[Sequence[str]]
GROUP_HEAD = ("probability", "cause", "error", "shape", "memory", "together with")
LADDER_HEAD = ("model", "error")
REMAINDER_HEAD = ("output", "error", "noise widths", "pace", *map(in_words, TESTS))
PARAMETER_HEAD = ("parameter", "value", "95 % interval", "nominal")
LAW_HEAD = ("law over signal", "gain", "shape", "memory")
_ROWS = 10  # of the map of laws
_FIGURES = ("gain", "probability", "error", "value", "nominal", "noise widths", *REMAINDER_HEAD[4:])


def overview(diagnosis: Diagnosis) -> Group:
    """Return what ``ppy diagnose`` prints."""
    first = Text.assemble((diagnosis.verdict, "bold"), "  ", (wording.headline(diagnosis), "bold"))
    parts: list[RenderableType] = [first, Text(wording.support(diagnosis))]
    parts.append(Text(f"Next: {wording.next_step(diagnosis)}"))
    parts += [Text(f"  {message}") for _, _, message in diagnosis.notes]
    if diagnosis.causes:
        named = "causes" if diagnosis.is_named else "best guesses"
        parts += [Text(), _table(named, *filled(GROUP_HEAD, group_rows(diagnosis)))]
        parts += [Text(f"  {line}") for line in wording.alias_lines(diagnosis)]
        parts += [Text(), _table("error, part by part", LADDER_HEAD, ladder_rows(diagnosis))]
    parts += [Text(), _table("what is left", REMAINDER_HEAD, remainder_rows(diagnosis))]
    parts += [Text(f"  {wording.error_meaning(diagnosis)}")]
    parts += [Text(), _table("parameters", PARAMETER_HEAD, parameter_rows(diagnosis))]
    return Group(*parts)


def comparison(changed: Changed) -> Group:
    """Return what ``ppy diagnose --compare`` prints beside that."""
    later = changed.later
    return Group(
        Text(),
        Text(describe_changes(changed.changes)),
        _table("before and after", CHANGE_HEAD, change_rows(changed.changes)),
        Text(),
        Text.assemble(
            f"{wording.files(later)} by itself: ",
            (later.verdict, "bold"),
            f"  {wording.by_itself(changed)}",
        ),
        *(Text(f"  {message}") for _, _, message in later.notes),
    )


def laws(law_map: LawMap) -> Group:
    """Return what ``ppy laws`` prints beside that."""
    rows = law_rows(law_map)
    left = len(rows) - _ROWS
    more = [Text(f"  {left} more laws and signals gain less; --json has all of them.")]
    return Group(
        Text(),
        _table("what each law lacks, to first order", LAW_HEAD, rows[:_ROWS]),
        *(more if left > 0 else []),
        Text(f"  {wording.LAW_MAP_MEANING}"),
    )


def law_rows(law_map: LawMap) -> Rows:
    """Return a row for each law over a signal, the largest gain first."""
    cls = law_map.diagnosis.subject.problem.model.cls
    return [
        (sentence(cls, one.term), f"{one.gain:.1f}", shape_text(one.term), memory_text(one.term))
        for one in law_map.entries
    ]


def _table(title: str, head: Sequence[str], rows: Rows) -> Table:
    table = plain_table(title, *head, right=[name for name in head if name in _FIGURES])
    for row in rows:
        table.add_row(*row)
    return table


def filled(head: Sequence[str], rows: Rows) -> tuple[Sequence[str], Rows]:
    """Return a table without its empty columns."""
    kept = [k for k in range(len(head)) if any(row[k] for row in rows)]
    return [head[k] for k in kept], [tuple(row[k] for k in kept) for row in rows]


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
                wording.error_text(diagnosis.error(cause.judged)),
                shape_text(term) if term else "",
                memory_text(term) if term else "",
                "; ".join(wording.part_text(diagnosis, part) for part in others),
            )
        )
    return rows


def ladder_rows(diagnosis: Diagnosis) -> Rows:
    """Return a row for the model with fitted parameters, and for each part that is added."""
    rows = []
    for rung in diagnosis.ladder:
        added = [f"+ {wording.part_text(diagnosis, part)}" for part in rung.parts[-1:]]
        (model,) = added or ["parameters fitted"]
        rows.append((model, wording.error_text(rung.error)))
    return rows


def remainder_rows(diagnosis: Diagnosis) -> Rows:
    """Return a row for each output."""
    return [
        (
            one.output,
            wording.error_text(one.share),
            wording.noise_widths(one),
            "slow" if one.is_slow else "fast",
            *(f"{one.tests[name]:.2f}" for name in TESTS),
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
