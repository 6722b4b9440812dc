"""Study of records whose law lacks a term of no catalogue, which `ppy laws` should name.

`python -m studies.judging.laws --records 120 --seed 1` draws plants, kinds, shapes, strengths,
stimuli and kinds of noise with generators that share no code with what they judge
(`studies/hidden_laws`). Records in which what is hidden leaves too little after a refit of
the base are not counted. Beside it stands a naive search for the signal of which the
residual is a curve. `--clean 120` asks the same of records in which nothing is hidden, and
`--actuator 2` of the variations of the emulated rig with the catalogue off
(`studies.judging.laws_clean`). `--catalogue 60` diagnoses records of hidden laws with the catalogue
on, and counts what is named beside them (`studies.judging.laws_catalogue`).
"""

from __future__ import annotations

import tempfile
import time as clock
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import UserError
from orchestration.identify import normalised_rms
from studies.clean import CleanRecord
from studies.clean import cases as clean_cases
from studies.hidden_laws import (
    Answer,
    Base,
    LawCase,
    base_of,
    cases,
    curve_of,
    draw_lack,
    is_right,
    lack_of,
    least_bic,
    series,
)
from studies.judging import laws_catalogue, laws_clean
from studies.judging.clean import settings_of
from studies.judging.laws_answers import (
    LEAST,
    answer,
    band_covers,
    closed_form,
    excluded,
    naive_is_right,
    other_way,
    rank,
    stands_still,
)
from studies.judging.laws_report import answer_line, report
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import Chosen, Part, Row, Study, among

if TYPE_CHECKING:
    from orchestration.api import LawsResult


def judge(case: LawCase) -> Row:
    """Draw a record, leave it if it does not count, and ask the laws of the model.

    Parameters
    ----------
    case : LawCase
    """
    row = asdict(case) | {
        "kind": case.kind.kind,
        "shape": case.kind.shape,
        "widths": 0.0,
        "seconds": 0.0,
    }
    try:
        drawn = draw_lack(case)
    except OverflowError:  # a plant in a loop that runs away makes no record
        return row
    base = base_of(drawn)
    known = series(drawn)
    row |= {"widths": base.left, "still": stands_still(known.get(case.kind.place.signal))}
    if excluded(row):
        return row
    row |= _naive(drawn, base, case, known)
    with tempfile.TemporaryDirectory() as folder:
        path = drawn.write(Path(folder) / "record.csv")
        result, said = searched_laws(path, drawn.plant.model, settings_of(drawn), drawn.plant.known)
    row |= said
    return row if result is None else row | _judged(result, drawn, case, known)


def searched_laws(
    path: Path, model: str, settings: dict[str, float] | None = None, hold: Sequence[str] = ()
) -> tuple[LawsResult | None, Row]:
    """Search the laws of a model without a catalogue; return the result (None if refused), time."""
    import orchestration as ppy

    began = clock.perf_counter()
    try:
        result = ppy.laws(path, model, effects=(), settings=settings, hold=hold)
    except UserError as error:
        return None, {"refused": str(error)[:200], "seconds": clock.perf_counter() - began}
    return result, {"seconds": clock.perf_counter() - began, "sentence": result.sentence}


def _naive(drawn: CleanRecord, base: Base, case: LawCase, known: dict[str, Any]) -> Row:
    """Return the answer of the naive search."""
    residuals = {o: y - base.outputs[o] for o, y in drawn.outputs.items()}
    ranked = least_bic(residuals, {**drawn.inputs, **drawn.outputs, **base.states}, drawn.regular)
    right = bool(ranked) and naive_is_right(ranked[0], case.kind.right, known)
    return {"naive": ranked[:3], "naive_right": right}


def judged_answers(
    result: LawsResult, right: frozenset[Answer], known: dict[str, Any], step: float
) -> Row:
    """Return the answers, each with whether it is right."""
    found = result.details
    corrections = found.corrections if found else []
    names = [answer(c.entry) for c in corrections]
    alike = [answer(e) for e in corrections[0].alike] if corrections else []
    return {
        "said": [
            {
                "label": c.entry.label,
                "gain": c.gain,
                "confirmed": c.confirmed,
                "right": is_right(a, right, known, step),
            }
            for c, a in zip(corrections, names, strict=True)
        ],
        "alike": [
            {"label": e.label, "right": is_right(a, right, known, step)}
            for e, a in zip(corrections[0].alike if corrections else (), alike, strict=True)
        ],
        "another_way": bool(names) and other_way(names[0], right, known, step),
        "rank": rank(names, right, known, step),
        "in_map": rank([answer(e) for e in found.entries] if found else [], right, known, step),
        "shapes": [name for name, _ in corrections[0].shapes] if corrections else [],
        "shape_told": corrections[0].shape if corrections else "",
    }


def _judged(result: LawsResult, drawn: CleanRecord, case: LawCase, known: dict[str, Any]) -> Row:
    row = judged_answers(result, case.kind.right, known, drawn.step) | _held_out(result, drawn)
    if not row["said"] or not row["said"][0]["right"]:
        return row
    assert result.details is not None
    best = result.details.corrections[0]
    lack = lack_of(case)
    from_zero = not lack.change.rest or abs(drawn.truth["memory_0_start"]) < 1e-9
    return row | {
        "covered": band_covers(
            best,
            case.kind,
            curve_of(drawn, lack),
            known,
            drawn.step,
            plant=drawn.plant,
            truth=drawn.truth,
        ),
        "closed": closed_form(row["shapes"], case.kind, answer(best.entry), from_zero),
    }


def _held_out(result: LawsResult, drawn: CleanRecord) -> Row:
    """Return held-out errors over the truth's, of the given model and of the best correction."""
    found = result.details
    if found is None or not found.corrections:
        return {}
    first = result.diagnosis.details.diagnosis.validation.first
    best = {o: normalised_rms(y[first:], drawn.clean[o][first:]) for o, y in drawn.outputs.items()}
    before, after = (
        max((e / best[o] for o, e in errors.items() if best[o] > 0.0), default=float("nan"))
        for errors in found.corrections[0].errors
    )
    return (
        {"ratio": float(after), "ratio_before": float(before)}
        if np.isfinite([before, after]).all()
        else {}
    )


def _parts(chosen: Chosen) -> Iterator[Part]:
    seed = chosen.seed
    yield Part(among(cases(chosen.records, seed), chosen), judge, answer_line, report)
    bare = among(clean_cases(chosen.clean, seed), chosen)
    rig = among(laws_clean.rig_cases(chosen.actuator, seed), chosen)
    both = among(cases(chosen.catalogue, seed), chosen)
    clean = laws_clean
    yield Part(bare, clean.judge_clean, clean.said_of_clean, clean.clean_report, "clean")
    yield Part(rig, clean.judge_rig, clean.said_of_rig, clean.rig_report, "actuator")
    named = laws_catalogue
    yield Part(both, named.judge, named.answer_line, named.report, "catalogue")


STUDY = Study(
    name="laws",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (120, "records of hidden laws"),
        "--clean": (0, "records in which nothing is hidden"),
        "--actuator": (0, "seeds of each variation of the rig"),
        "--catalogue": (0, "records diagnosed with the catalogue on"),
    },
    page="hidden-laws.md",
    head=f"""# How often a law is found that lacks what no catalogue has

Drawn by `python -m studies.judging.laws {{options}}`, a seed that was not looked at before.
Every kind has three shapes, and the generators share no code with what they judge. Not counted are
records in which what is hidden leaves less than {LEAST:g} noise widths after a refit of the base,
or depends on a signal that stands still, so that it is a constant. What is called right is in
`studies/hidden_laws/kinds.py`: every form that does the same to the outputs. No effect of a
catalogue is looked at ([why](decisions/0030-the-missing-law-as-a-curve.md)).

{{stamp}}

""",
    code=(
        *DIAGNOSIS,
        "orchestration/discrepancy/laws",
        "fmus/kit/corrections.py",
        "fmus/voice_coil_dma",
        "fmus/ppy_actuator",
        "studies/hidden_laws",
        "studies/hidden",
        "studies/clean",
        "studies/judging/laws.py",
        "studies/judging/laws_answers.py",
        "studies/judging/laws_report.py",
        "studies/judging/laws_clean.py",
        "studies/judging/laws_catalogue.py",
    ),
)


if __name__ == "__main__":
    STUDY.main()
