"""Study of records with two hidden effects at once: `python -m studies.judging.hidden --two 60`.

They are drawn, judged and left out as those of one are (`studies.judging.hidden`). Each of the two
must count by itself and must leave enough beside the other, and no effect of the list may make the
record alone. That a wrong pair makes it as well is not computed: every two of a list would have to
be fitted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import asdict

import numpy as np

from benchmarks.tables import Table, Topic
from orchestration.fmu import find_model
from studies.hidden import HiddenCase, draw_hidden, left, left_beside
from studies.judging.answers import (
    LEAST,
    alike,
    excluded,
    held_out,
    related,
    right_names,
)
from studies.judging.clean import diagnosed, settings_of
from studies.judging.floor import fitted_alone, listed
from studies.judging.study import Row, counted, share, title

_KINDS = "both", "one", "none", "refused"


def judge(case: HiddenCase) -> Row:
    """Draw a record, leave it if it does not count, and diagnose it."""
    drawn = draw_hidden(case)
    alone = {one.variation: draw_hidden(one) for one in case.alone()}
    pair = " + ".join(sorted(variation.family for variation in alone))
    row = asdict(case) | {
        "pair": pair,
        "widths": min(*left_beside(drawn), *map(left, alone.values())),
        "seconds": 0.0,
    }
    if left_out(row):
        return row
    settings = settings_of(drawn)
    model = find_model(drawn.plant.model)
    assert model.cls is not None
    effects = listed(model.cls, drawn, settings)
    right = [right_names(effects, variation.right) for variation in alone]
    floors = [fitted_alone(model.cls, one, effects, settings)[0] for one in alone.values()]
    row["alike"] = sorted(
        {name for floor, names in zip(floors, right, strict=True) for name in alike(floor, names)}
    )
    row["alone"] = (
        [] if left_out(row) else alike(fitted_alone(model.cls, drawn, effects, settings)[0], set())
    )
    if left_out(row):
        return row
    result, said = diagnosed(drawn, ["families"])
    near = set[str]().union(*(related(effects, names) for names in right))
    row |= said | {"right": [sorted(names) for names in right], "related": sorted(near)}
    return row | (held_out(result, drawn) if result is not None else {})


def left_out(row: Row) -> str:
    """Return why a record does not count; empty if it does."""
    return excluded(row) or ("one alone" if row.get("alone") else "")


def steps_of(row: Row, right: Collection[str]) -> set[int]:
    """Return numbers of the causes that are, or cannot be told from, one of these effects."""
    said = [
        group if row["verdict"] == "ambiguous" else group[:1] for group in row.get("groups", [])
    ]
    return {k for k, names in enumerate(said) if {*names} & {*right}}


def named(row: Row) -> str:
    """Return which hidden effects were named, one of `_KINDS`; no cause stands for both."""
    if row["verdict"] == "refused":
        return "refused"
    first, second = (steps_of(row, right) for right in row["right"])
    if any(k != other for k in first for other in second):
        return "both"
    return "one" if first or second else "none"


def false_causes(row: Row) -> list[str]:
    """Return causes that are neither hidden nor of the law and signal of a hidden one."""
    known = set[int]().union(*(steps_of(row, right) for right in row["right"]))
    causes = [group[0] for k, group in enumerate(row.get("groups", [])) if k not in known]
    return [cause for cause in causes if cause not in row["related"]]


def answer_line(row: Row) -> str:
    """Return the answer to a record as a line of text."""
    if why := left_out(row):
        names = ", ".join((row.get("alike") or row.get("alone") or [])[:3])
        return f"not counted, {why}{names and ': '}{names} ({row['widths']:.1f} widths)"
    causes = " + ".join(" | ".join(group) for group in row.get("groups", [])) or "nothing named"
    false = f"; false {', '.join(false_causes(row))}" if false_causes(row) else ""
    return (
        f"{named(row)}: {row['verdict']}, {causes}{false} ({row['widths']:.1f} widths,"
        f" {row['seconds']:.0f} s)"
    )


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of the answers."""
    why = Counter(left_out(row) for row in rows)
    those = [row for row in rows if not left_out(row)]
    kinds = Counter(named(row) for row in those)
    count = len(those)
    parts: list[str | Table] = [
        (
            "Two effects of different families, places and laws in one record. Each must leave"
            f" {LEAST:g} noise widths alone after a refit of the base, and beside the other, which"
            " is known, after what parameters can do about it to first order; no other effect may"
            " make the record in which it is alone, and no effect the one with both. A hidden"
            " effect is named by a cause of its own, or by one that the verdict cannot tell from"
            " it. A false cause is neither of the two, nor of the law and signal of one."
        ),
        (
            f"{len(rows)} records: {share(why['too little'], len(rows))} leave too little,"
            f" {share(why['alike'], len(rows))} hold one that could be another,"
            f" {share(why['one alone'], len(rows))} could be of one effect; {count} count."
        ),
        (
            f"Both are named in {share(kinds['both'], count)}, one in {share(kinds['one'], count)},"
            f" none in {share(kinds['none'], count)}; false causes in"
            f" {share(sum(bool(false_causes(r)) for r in those), count)}."
        ),
    ]
    for axis in ("plant", "pair", "strength", "stimulus", "noise", "timing"):
        parts.append(counted(those, axis, _KINDS, named, false_causes=false_causes))
    if count:
        seconds = [row["seconds"] for row in those]
        parts.append(
            f"Processor time of a diagnosis: median {np.median(seconds):.1f} s, 90 %"
            f" {np.quantile(seconds, 0.9):.1f} s."
        )
    wrong = [row for row in those if named(row) != "both" or false_causes(row)]
    parts += [
        "What was said of the others:",
        Table(["record", "said"], [[title(row, HiddenCase), answer_line(row)] for row in wrong]),
    ]
    return Topic("Two at once", parts)
