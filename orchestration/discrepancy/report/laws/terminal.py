"""What a model's laws lack, on a terminal: a sentence, and tables of corrections, errors and parameters."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.asked import Asked, named, shape_estimates
from orchestration.discrepancy.report.wording import message
from orchestration.reporting.console import plain_table


def overview(asked: Asked) -> Group:
    """Return what ``ppy laws`` prints."""
    parts: list[RenderableType] = [Text(wording.sentence(asked), "bold")]
    parts += [Text(message(note)) for note in asked.result.notes]
    for each in asked.rounds:
        if each.best is not None:
            parts += [Text(), corrections(each)]
            if each.best.errors[0]:
                parts += [Text(), _errors(each)]
            parts += [Text(), _parameters(each)]
    parts += [Text(), *(Text(line) for line in wording.next_steps(asked))]
    return Group(*parts)


def corrections(asked: Asked) -> RenderableType:
    """Table of what was fitted, the best first."""
    beside = f" beside {' and '.join(asked.causes)}" if asked.causes else ""
    table = plain_table(
        f"corrections{beside}",
        "effect",
        "law",
        "signal",
        "fall of BIC",
        "shape",
        "unseen data",
        "alike",
    )
    for one in asked.corrections:
        law = f"{one.entry.law}{' (factor)' if one.entry.kind == 'multiply' else ''}"
        alike = asked.alike(one)
        more = f" and {len(alike) - 1} more" if len(alike) > 1 else ""
        table.add_row(
            asked.effect(one),
            law,
            named(one.entry.signal),
            f"{one.gain:.1f}",
            one.shape or "a curve",
            wording.said_of(one),
            "".join(alike[:1]) + more,
        )
    return table


def _errors(asked: Asked) -> RenderableType:
    table = plain_table(
        "error on data that no fit has seen, rms over the spread of the signal",
        "output",
        "without",
        "with it",
    )
    if asked.best is not None:
        for row in wording.error_rows(asked.best):
            table.add_row(*row)
    return table


def _parameters(asked: Asked) -> RenderableType:
    best = asked.best
    table = plain_table("parameters of the correction", "name", "value", "95 % interval", "unit")
    for name, e in shape_estimates(best).items() if best else ():
        interval = " … ".join(f"{end:.4g}" for end in e.interval)
        table.add_row(
            name, f"{e.value:.4g}", interval, wording.unit_text(asked, best, e) if best else ""
        )
    return table
