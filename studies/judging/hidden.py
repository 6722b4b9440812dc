"""Study of records with one hidden effect, in models other than the actuator.

`python -m studies.judging.hidden --records 120 --seed 1` draws plants, families, shapes, strengths,
stimuli and kinds of noise with generators that share no code with what they judge
(`studies/hidden`). What is not counted is computed: records in which the effect leaves too
little after a refit of the base, and those that another effect could have made. The floor
(`studies.judging.floor`) is held beside it. `--two 60` judges records with two effects
at once as well (`studies.judging.hidden_two`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial

import numpy as np

from benchmarks.tables import Table, Topic
from orchestration.fmu import find_model
from studies.hidden import OUTSIDE, USUAL, HiddenCase, cases, cases_of_two, draw_hidden, left
from studies.judging import hidden_two
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
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import (
    Chosen,
    Part,
    Row,
    Study,
    among,
    counted,
    grouped,
    share,
    title,
)
from studies.plants import ON_REQUEST

_GOOD = "first", "in the group"
_KINDS = "first", "in the group", "another", "none", "refused"


def judge(case: HiddenCase, with_floor: bool = True) -> Row:
    """Draw a record, leave it if it does not count, fit the floor, and diagnose it.

    Parameters
    ----------
    case : HiddenCase
    with_floor : bool
        Without it nothing tells whether another effect could have made the record.
    """
    drawn = draw_hidden(case)
    row = asdict(case) | {
        "family": case.variation.family,
        "shape": case.variation.shape,
        "widths": left(drawn),
    }
    if excluded(row):
        return row | {"seconds": 0.0}
    settings = settings_of(drawn)
    model = find_model(drawn.plant.model)
    assert model.cls is not None
    effects = listed(model.cls, drawn, settings)
    right = right_names(effects, case.variation.right)
    if with_floor:
        floor, took = fitted_alone(model.cls, drawn, effects, settings)
        ranked = sorted(floor, key=lambda name: floor[name].bic)
        closest = min(floor, key=lambda name: floor[name].evidence)
        row |= {
            "alike": alike(floor, right),
            "floor": ranked[:4],
            "floor_seconds": took,
            "closest": closest in right,
            "evidence": floor[closest].evidence,
        }
    if excluded(row):
        return row | {"seconds": 0.0}
    result, said = diagnosed(drawn, ["families"])
    row |= said | {"right": sorted(right), "related": sorted(related(effects, right))}
    return row | (held_out(result, drawn) if result is not None else {})


def named(row: Row) -> str:
    """Return what was answered about the hidden effect, one of `_KINDS`."""
    if row["verdict"] == "refused":
        return "refused"
    if row["family"] == OUTSIDE:
        return "first" if row["verdict"] == "unexplained" and not row["causes"] else "another"
    if not row["causes"]:
        return "none"
    if row["causes"][0] in row["right"]:
        return "first"
    return (
        "in the group"
        if row["verdict"] == "ambiguous" and {*row["groups"][0]} & {*row["right"]}
        else "another"
    )


def floor_is_right(row: Row) -> bool:
    """Return whether the best of all effects by BIC is right; outside every family it never is."""
    return row["family"] != OUTSIDE and row["floor"][0] in row["right"]


def false_secondary(row: Row) -> list[str]:
    """Return causes beside the first one without the law and signal of a right one."""
    return [cause for cause in row.get("causes", [])[1:] if cause not in row["related"]]


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of the answers."""
    why = Counter(excluded(row) for row in rows)
    those = [row for row in rows if not excluded(row)]
    inside = [row for row in those if row["family"] != OUTSIDE]
    good = sum(named(row) in _GOOD for row in inside)
    parts: list[str | Table] = [
        (
            f"{len(rows)} records: {share(why['too little'], len(rows))} leave less than {LEAST:g}"
            f" noise widths, {share(why['alike'], len(rows))} could be of another effect;"
            f" {len(those)} count."
        ),
        (
            f"Of {len(inside)} with an effect of a family, it is named first or in the ambiguous"
            f" group in {share(good, len(inside))}, first in"
            f" {share(sum(named(r) == 'first' for r in inside), len(inside))}; false secondary"
            f" causes in {share(sum(bool(false_secondary(r)) for r in inside), len(inside))}."
        ),
        *_beside_floor(inside),
    ]
    for axis in ("family", "plant", "strength", "stimulus", "noise", "timing"):
        parts.append(counted(those, axis, _KINDS, named, false_secondary=false_secondary))
    return Topic(
        "Hidden effects", [*parts, *_quality(inside), *_excluded(rows), *_confusion(those)]
    )


def _beside_floor(rows: Sequence[Row]) -> list[str]:
    both = [row for row in rows if "floor" in row]
    if not both:
        return []
    ours, floor = (
        [row for row in both if is_right(row)]
        for is_right in (lambda r: named(r) in _GOOD, floor_is_right)
    )
    closest = sum(row["closest"] for row in both)
    only = sum(row not in ours for row in floor)
    return [
        f"Floor, on the same {len(both)}: right in {share(len(floor), len(both))}, against"
        f" {share(len(ours), len(both))} here; right there only in {only}. In"
        f" {share(closest, len(both))} what comes closest to the outputs without noise is a right"
        " one."
    ]


def _quality(rows: Sequence[Row]) -> list[str | Table]:
    """Return errors on held-out data, coverage, and time."""
    hits = [row for row in rows if named(row) == "first"]
    table = []
    for name, these in grouped(rows, "noise").items():
        ratios = [row["ratio"] for row in these if "ratio" in row and np.isfinite(row["ratio"])]
        covered = [hit for row in these if row in hits for hit in row["inside"].values()]
        cover = f"{100.0 * np.mean(covered):.1f} %" if covered else ""
        table.append(
            [
                str(name),
                len(ratios),
                float(np.median(ratios)) if ratios else float("nan"),
                len(covered),
                cover,
            ]
        )
    seconds = [row["seconds"] for row in rows if row["seconds"]]
    if not seconds:
        return []
    floor = float(np.median([row.get("floor_seconds", 0.0) for row in rows]))
    ratios = [row["ratio"] for row in rows if "ratio" in row and np.isfinite(row["ratio"])]
    return [
        (
            f"Held-out error over that of the truth: median {np.median(ratios):.3f}. Processor time"
            f" of a diagnosis: median {np.median(seconds):.1f} s, 90 %"
            f" {np.quantile(seconds, 0.9):.1f} s; of the floor: median {floor:.1f} s."
        ),
        Table(
            [
                "noise",
                "records",
                "held out / truth, median",
                "intervals where named first",
                "cover",
            ],
            table,
        ),
    ]


def _excluded(rows: Sequence[Row]) -> list[str | Table]:
    table = [
        [
            name,
            len(these),
            sum(excluded(r) == "too little" for r in these),
            sum(excluded(r) == "alike" for r in these),
        ]
        for name, these in grouped(rows, "family").items()
    ]
    return ["Not counted, by family:", Table(["family", "records", "too little", "alike"], table)]


def _confusion(rows: Sequence[Row]) -> list[str | Table]:
    wrong = [row for row in rows if named(row) not in _GOOD or false_secondary(row)]
    return [
        "What was said of the others:",
        Table(["record", "said"], [[title(row, HiddenCase), answer_line(row)] for row in wrong]),
    ]


def answer_line(row: Row) -> str:
    """Return the answer to a record as a line of text."""
    if excluded(row):
        of = f": {', '.join(row['alike'][:3])}" if row.get("alike") else ""
        return f"not counted, {excluded(row)}{of} ({row['widths']:.1f} widths)"
    causes = " + ".join(" | ".join(group) for group in row.get("groups", [])) or "nothing named"
    floor = f"; floor {row['floor'][0] or 'nothing'}" if "floor" in row else ""
    more = f"; also {', '.join(false_secondary(row))}" if false_secondary(row) else ""
    return (
        f"{named(row)}: {row['verdict']}, {causes}{more}{floor} ({row['widths']:.1f} widths,"
        f" {row['seconds']:.0f} s)"
    )


def part(wanted: Sequence[HiddenCase], with_floor: bool = True) -> Part:
    """Return records with one hidden effect as a part of a study."""
    return Part(wanted, partial(judge, with_floor=with_floor), answer_line, report)


NO_FLOOR = {"--no-floor": "do not fit every effect alone, which takes longest"}


def _parts(chosen: Chosen) -> Iterator[Part]:
    plants = [name for name in ON_REQUEST if name in chosen.only] or USUAL
    yield part(among(cases(chosen.records, chosen.seed, plants), chosen), not chosen.no_floor)
    pairs = among(cases_of_two(chosen.two, chosen.seed, plants), chosen)
    yield Part(pairs, hidden_two.judge, hidden_two.answer_line, hidden_two.report, "two")


STUDY = Study(
    name="hidden",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (120, "records with one hidden effect"),
        "--two": (0, "records with two at once, kept in SEED-two.jsonl"),
    },
    switches=NO_FLOOR,
    page="hidden-records.md",
    head=f"""# How often hidden effects are named, in models that nobody here prepared

Drawn by `python -m studies.judging.hidden {{options}}`, a seed that was not looked at before.
Every family has several shapes, none of them the catalogue's formula, and the generators share no
code with what they judge. Not counted are records in which the effect leaves less than {LEAST:g}
noise widths after a refit of the base, and those that another effect makes as well: both are
computed. What is called right is in `studies/hidden/variations.py`; the floor fits every effect
alone from nominal values and takes the best ([why](decisions/0028-one-noise-for-all.md)).
[Ten models by the book](book-records.md) are judged likewise.

{{stamp}}

""",
    code=(
        *DIAGNOSIS,
        "fmus/galvanostat",
        "fmus/voice_coil_dma",
        "orchestration/fmu/model/effects.py",
        "studies/hidden",
        "studies/clean",
        "studies/judging/hidden.py",
        "studies/judging/hidden_two.py",
        "studies/judging/answers.py",
        "studies/judging/floor.py",
    ),
)


if __name__ == "__main__":
    STUDY.main()
