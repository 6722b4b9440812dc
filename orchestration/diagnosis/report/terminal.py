"""A diagnosis on a terminal: the verdict, the group, the ladder, what is left, and parameters."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from orchestration.diagnosis.report import wording
from orchestration.diagnosis.view import (
    GROUP_HEAD,
    LADDER_HEAD,
    PARAMETER_HEAD,
    REMAINDER_HEAD,
    Answer,
    ChangesView,
    LawRow,
)
from orchestration.identify.changes import CHANGE_HEAD
from orchestration.reporting import plain_table

Rows = Sequence[Sequence[str]]
LAW_HEAD = ("law over signal", "gain", "shape", "memory")
_ROWS = 10  # of the map of laws
_FIGURES = ("gain", "probability", "error", "value", "nominal", "noise widths", *REMAINDER_HEAD[4:])


def overview(answer: Answer) -> Group:
    """Return what ``ppy diagnose`` prints."""
    first = Text.assemble((answer.verdict, "bold"), "  ", (answer.headline, "bold"))
    parts: list[RenderableType] = [first, Text(answer.support)]
    parts.append(Text(f"Next: {answer.next_step}"))
    parts += [Text(f"  {message}") for message in answer.notes]
    if answer.causes:
        named = "causes" if answer.is_named else "best guesses"
        parts += [Text(), _table(named, *filled(GROUP_HEAD, answer.causes))]
        parts += [Text(f"  {line}") for line in answer.aliases]
        parts += [Text(), _table("error, part by part", LADDER_HEAD, answer.ladder)]
    parts += [Text(), _table("what is left", REMAINDER_HEAD, answer.left)]
    parts += [Text(f"  {answer.error_meaning}")]
    parts += [Text(), _table("parameters", PARAMETER_HEAD, answer.parameters)]
    return Group(*parts)


def comparison(changes: ChangesView) -> Group:
    """Return what ``ppy diagnose --compare`` prints beside that."""
    return Group(
        Text(),
        Text(changes.text),
        _table("before and after", CHANGE_HEAD, changes.rows),
        Text(),
        Text.assemble(
            f"{changes.after} by itself: ", (changes.verdict, "bold"), f"  {changes.by_itself}"
        ),
        *(Text(f"  {message}") for message in changes.notes),
    )


def laws(rows: Sequence[LawRow]) -> Group:
    """Return what ``ppy laws`` prints beside that."""
    left = len(rows) - _ROWS
    more = [Text(f"  {left} more laws and signals gain less; --json has all of them.")]
    told = [(one.text, f"{one.gain:.1f}", one.shape, one.memory) for one in rows[:_ROWS]]
    return Group(
        Text(),
        _table("what each law lacks, to first order", LAW_HEAD, told),
        *(more if left > 0 else []),
        Text(f"  {wording.LAW_MAP_MEANING}"),
    )


def parts(
    answer: Answer, changes: ChangesView | None = None, rows: Sequence[LawRow] | None = None
) -> list[RenderableType]:
    """Return what a command prints, with the changes and the map of laws that there are."""
    shown: list[RenderableType] = [overview(answer)]
    if changes is not None:
        shown.append(comparison(changes))
    if rows is not None:
        shown.append(laws(rows))
    return shown


def _table(title: str, head: Sequence[str], rows: Rows) -> Table:
    right = [name for name in head if name in _FIGURES]
    return plain_table(title, *head, right=right, rows=rows)


def filled(head: Sequence[str], rows: Rows) -> tuple[Sequence[str], Rows]:
    """Return a table without its empty columns."""
    kept = [k for k in range(len(head)) if any(row[k] for row in rows)]
    return [head[k] for k in kept], [tuple(row[k] for k in kept) for row in rows]
