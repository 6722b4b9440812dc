"""Study of records whose truth is half inside and half outside of what a search of laws knows.

`python -m studies.judging.outside --records 200 --seed 1 --workers 2` draws records of five plants
(`studies/outside`, by code that shares nothing with the engine) and asks the engine for the cause.
`--only two motor` chooses two at once in a closed loop. Beside it stands a floor: every plain term
alone, fitted from nominal, of which that with the least information criterion is the answer.
"""

from __future__ import annotations

import time as clock
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict
from functools import cache

import numpy as np

from benchmarks.tables import Table, Topic
from orchestration.diagnosis import (
    Found,
    LawModel,
    Record,
    Subject,
    conclude,
    search,
    subject_of,
)
from orchestration.fmu import find_model
from studies.judging.calibration import groups_of
from studies.judging.floor import best_plain_term
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import Chosen, Part, Row, Study, among, grouped, share
from studies.outside import Drawn, OutsideCase, Run, cases, draw_outside

KINDS = ("first", "in group", "silent", "unsure", "group wrong", "sure and wrong")
_LEFT = 1.5  # noise widths that no verdict passes over in silence

Pair = tuple[str, str]


@cache
def law_model(model: str) -> LawModel:
    """Compile the model of a plant."""
    cls = find_model(model).cls
    assert cls is not None
    return LawModel(cls)


def record_of(run: Run, label: str) -> Record:
    """Return a simulated record as the engine takes it."""
    inputs, outputs = map(np.ascontiguousarray, (run.inputs, run.measured))
    return Record(run.time, inputs, outputs, (False,) * inputs.shape[1], label)


def judge(case: OutsideCase) -> Row:
    """Draw a record, and ask the engine and the floor for its cause."""
    drawn = draw_outside(case)
    model = law_model(drawn.plant.model)
    row = asdict(case) | _described(drawn)
    fitted, held_out = (
        record_of(drawn.fitted, "fitted"),
        record_of(drawn.held_out, "held out"),
    )
    began, used = clock.perf_counter(), clock.process_time()
    values = dict(drawn.nominal)
    subject = subject_of(model, [fitted], [held_out], drawn.plant.known, values)
    found = None if subject is None else search.search(subject)
    if subject is None or found is None:
        return row | {"verdict": "refused", "seconds": clock.perf_counter() - began, "said": []}
    conclusion = conclude.conclude(found)
    row |= {"seconds": clock.perf_counter() - began, "processor": clock.process_time() - used}
    row |= _answer(conclusion, drawn) | _errors(conclusion, drawn, subject)
    row |= {
        "fits": len(found.fits),
        "groups": groups_of(found, conclusion, lambda cause: _is_right(cause.key, drawn.right)),
    }
    return row | _in_search(found, drawn) | _floor(subject, drawn)


def _described(drawn: Drawn) -> Row:
    """Return what was drawn."""
    return {
        "truth": [one.kind.name for one in drawn.hidden],
        "right": drawn.right,
        "strength": drawn.strength,
        "noise": float(np.mean(drawn.noise / drawn.fitted.exact.std(axis=0))),
        "correlation": drawn.correlation,
        "stimuli": [drawn.fitted.stimuli, drawn.held_out.stimuli],
    }


def _is_right(cause: Pair, right: Sequence[Collection[Pair]]) -> bool:
    return any(cause in pairs for pairs in right)


def _answer(conclusion: conclude.Conclusion, drawn: Drawn) -> Row:
    """Return the verdict with its causes, and which of them are right."""
    causes = conclusion.causes
    right = [_is_right((c.law, c.signal), drawn.right) for c in causes]
    found = [
        any(t.cause in pairs for t in causes[0].terms) if causes else False for pairs in drawn.right
    ]
    return {
        "verdict": conclusion.verdict,
        "said": [
            {"cause": c.name, "probability": c.probability, "terms": list(map(str, c.terms))}
            for c in causes
        ],
        "nothing": conclusion.nothing,
        "first_right": bool(right) and right[0],
        "group_right": any(right),
        "both": len(found) == 2 and all(found),
        "false_terms": sum(not _is_right(t.cause, drawn.right) for t in causes[0].terms)
        if causes
        else 0,
    }


def _errors(conclusion: conclude.Conclusion, drawn: Drawn, subject: Subject) -> Row:
    """Return errors on the samples by which nothing was chosen, in widths of the noise."""
    noise = float(np.sqrt(np.mean((drawn.noise / subject.problem.spread) ** 2)))
    best = conclusion.causes[0].judged if conclusion.causes else conclusion.base
    if conclusion.verdict == "consistent":
        best = conclusion.base
    return {"before": conclusion.base.left_out / noise, "after": best.left_out / noise}


def _in_search(found: Found, drawn: Drawn) -> Row:
    """Return the place of the first fit whose terms are all right among all, by score."""
    ranked = found.compared()
    for place, one in enumerate(ranked, start=1):
        terms = one.judged.terms
        if terms and all(_is_right(t.cause, drawn.right) for t in terms):
            return {"place": place, "score": one.score, "best": ranked[0].score}
    return {"place": 0}


def _floor(subject: Subject, drawn: Drawn) -> Row:
    """Return the answer of the floor."""
    answer = best_plain_term(subject)
    return {
        "floor": str(answer or ""),
        "floor_right": answer is not None and _is_right(answer.cause, drawn.right),
    }


def kind_of(row: Row) -> str:
    """Return which of `KINDS` an answer is."""
    if row["verdict"] in ("consistent", "refused"):
        return "silent"
    sure = row["verdict"] == "cause"
    if row["group"] == "clean":
        return "sure and wrong" if sure or row["verdict"] == "ambiguous" else "unsure"
    if row["first_right"] and (sure or row["verdict"] == "ambiguous"):
        return "first"
    if row["verdict"] == "ambiguous" and row["group_right"]:
        return "in group"
    if sure:
        return "sure and wrong"
    return "group wrong" if row["verdict"] == "ambiguous" else "unsure"


def _line(row: Row) -> str:
    truth = " + ".join(row["truth"]) or "nothing"
    said = "; ".join(f"{c['cause']} {c['probability']:.2f}" for c in row["said"])
    after = f"{row.get('before', 0.0):.1f} -> {row.get('after', 0.0):.1f} widths"
    return (
        f"{kind_of(row).upper()} {truth} ({row['strength']:.2f}, noise {row['noise']:.3f}): "
        f"{row['verdict']} {said}; first guess {row.get('first_right')}, "
        f"place {row.get('place')}, floor {row.get('floor_right')}; {after}, {row['seconds']:.1f} s"
    )


def report(rows: Sequence[Row]) -> Topic:
    """Return the tables of the study."""
    tables = [_counts(rows, axis) for axis in ("group", "plant")]
    hidden = [row for row in rows if row["group"] != "clean"]
    seconds = [row["seconds"] for row in rows]
    two = [row for row in rows if row["group"] == "two"]
    told = [row for row in hidden if "after" in row]
    notes = [
        f"Of {len(hidden)} wrong models the first guess is right in "
        f"{share(sum(row.get('first_right', False) for row in hidden), len(hidden))}, "
        f"that of the floor in "
        f"{share(sum(row.get('floor_right', False) for row in hidden), len(hidden))}.",
        f"Of two at once both are named in "
        f"{share(sum(row.get('both', False) for row in two), len(two))}.",
        f"Error over the noise, held out, geometric mean: {_mean(told, 'before'):.2f} before, "
        f"{_mean(told, 'after'):.2f} after.",
        f"Consistent or a cause, with more than {_LEFT:g} noise widths left: "
        f"{sum(_is_hasty(row) for row in rows)}.",
        f"Seconds: median {np.median(seconds):.1f}, largest {np.max(seconds):.1f}.",
    ]
    wrong = [row for row in rows if kind_of(row) == "sure and wrong"]
    lines = [f"- {row['plant']} {row['number']}: {_line(row)}" for row in wrong]
    return Topic("Truth inside and outside", [*notes, *tables, "\n".join(lines)])


def _is_hasty(row: Row) -> bool:
    """Return whether a verdict is without reserve while more than the noise is left."""
    return row["verdict"] in ("consistent", "cause") and bool(row["after"] > _LEFT)


def _mean(rows: Sequence[Row], key: str) -> float:
    return float(np.exp(np.mean(np.log([row[key] for row in rows])))) if rows else float("nan")


def _counts(rows: Sequence[Row], axis: str) -> Table:
    table = []
    for name, these in grouped(rows, axis).items():
        counts = [sum(kind_of(row) == kind for row in these) for kind in KINDS]
        guesses = sum(row.get("first_right", False) for row in these)
        floor = sum(row.get("floor_right", False) for row in these)
        table.append([str(name), len(these), *counts, guesses, floor])
    return Table([axis, "records", *KINDS, "first guess right", "floor"], table)


def _parts(chosen: Chosen) -> Iterator[Part]:
    yield Part(among(cases(chosen.records, chosen.seed), chosen), judge, _line, report)


STUDY = Study(
    name="outside",
    about=__doc__ or "",
    parts=_parts,
    numbers={"--records": (40, "records to draw")},
    code=(*DIAGNOSIS, "studies/outside", "studies/judging/outside.py", "studies/judging/floor.py"),
)


if __name__ == "__main__":
    STUDY.main()
