"""Study of records with one hidden effect, in models other than the actuator.

`python -m studies.judging.hidden --records 120 --seed 1` draws plants, families, shapes, strengths,
stimuli and kinds of noise with generators that share no code with what they judge
(`studies/hidden`). What is not counted is computed: records in which the effect leaves too
little after a refit of the base, and those that another effect could have made. The floor
(`studies.judging.floor`) is held beside it. `--two 60` judges records with two effects
at once as well (`studies.judging.hidden_two`).
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks.tables import Table, Topic
from orchestration.fmu import find_model
from studies.hidden import OUTSIDE, USUAL, HiddenCase, cases, cases_of_two, draw_hidden, left
from studies.judging import hidden_two
from studies.judging.answers import (
    LEAST,
    Row,
    alike,
    excluded,
    held_out,
    related,
    right_names,
    title,
)
from studies.judging.clean import ROOT, diagnosed, grouped, settings_of, share
from studies.judging.floor import fitted_alone, listed
from studies.judging.kept import add_options, among, judged
from studies.judging.stamp import DIAGNOSIS, stamp
from studies.plants import ON_REQUEST

PAGE = ROOT / "docs" / "hidden-records.md"
CODE = (
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
)
_HEAD = (
    "# How often hidden effects are named, in models that nobody here prepared\n"
    "\n"
    "Drawn by `python -m studies.judging.hidden {options}`, a seed that was not looked at "
    "before.\n"
    "Every family has several shapes, none of them the catalogue's formula, and the "
    "generators share no code with what they\n"
    "judge. Not counted are records in which the effect leaves less than {least:g} noise "
    "widths after a refit of the base,\n"
    "and those that another effect makes as well: both are computed. What is called right "
    "is in\n"
    "`studies/hidden/variations.py`; the floor fits every effect alone from nominal values "
    "and takes the best\n"
    "([why](decisions/0028-one-noise-for-all.md)). "
    "[Ten models by the book](book-records.md) are judged likewise.\n"
    "\n"
    "{stamp}\n"
    "\n"
)
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
    counted = [row for row in rows if not excluded(row)]
    inside = [row for row in counted if row["family"] != OUTSIDE]
    good = sum(named(row) in _GOOD for row in inside)
    parts: list[str | Table] = [
        (
            f"{len(rows)} records: {share(why['too little'], len(rows))} leave less than {LEAST:g}"
            f" noise widths, {share(why['alike'], len(rows))} could be of another effect;"
            f" {len(counted)} count."
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
        columns = [axis, "records", *_KINDS, "false secondary"]
        parts.append(
            Table(
                columns,
                [[str(name), *_counts(these)] for name, these in grouped(counted, axis).items()],
            )
        )
    return Topic(
        "Hidden effects", [*parts, *_quality(inside), *_excluded(rows), *_confusion(counted)]
    )


def _counts(rows: Sequence[Row]) -> list[int]:
    kinds = Counter(named(row) for row in rows)
    return [
        len(rows),
        *(kinds[kind] for kind in _KINDS),
        sum(bool(false_secondary(row)) for row in rows),
    ]


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
        Table(["record", "said"], [[title(row), answer_line(row)] for row in wrong]),
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


def run(
    wanted: Sequence[HiddenCase],
    kept: Path,
    with_floor: bool = True,
    progress: Callable[[str], None] = print,
) -> list[Row]:
    """Judge all cases that are not kept yet."""
    return judged(wanted, kept, lambda case: judge(case, with_floor), answer_line, progress)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.judging.hidden", description=__doc__.split("\n\n")[0]
    )
    add_options(parser, 120, "hidden")
    parser.add_argument(
        "--two",
        type=int,
        default=0,
        help="records with two effects at once, kept in SEED-two.jsonl",
    )
    parser.add_argument(
        "--no-floor", action="store_true", help="do not fit every effect alone, which takes longest"
    )
    parser.add_argument("--out", type=Path, help="page to write")
    chosen = parser.parse_args(arguments)
    plants = [name for name in ON_REQUEST if name in chosen.only] or USUAL
    wanted = among(cases(chosen.records, chosen.seed, plants), chosen)
    pairs = among(cases_of_two(chosen.two, chosen.seed, plants), chosen)
    kept = chosen.kept or ROOT / "build" / "hidden" / f"{chosen.seed}.jsonl"
    progress = lambda line: print(line, flush=True)  # noqa: E731
    topics = [report(run(wanted, kept, not chosen.no_floor, progress))] if wanted else []
    if pairs:
        beside = kept.with_stem(f"{kept.stem}-two")
        topics.append(
            hidden_two.report(
                judged(pairs, beside, hidden_two.judge, hidden_two.answer_line, progress)
            )
        )
    text = "\n\n".join(map(str, topics))
    print("\n" + text)
    if chosen.out is not None:
        options = [f"--records {chosen.records} --seed {chosen.seed}"]
        options += [f"--two {chosen.two}"] if pairs else []
        options += [
            f"--{name} {' '.join(words)}"
            for name in ("only", "without")
            if (words := getattr(chosen, name))
        ]
        head = _HEAD.format(options=" ".join(options), least=LEAST, stamp=stamp(CODE))
        chosen.out.write_text(head + text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
