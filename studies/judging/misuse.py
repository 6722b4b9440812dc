"""Study of misused records: clean ones, spoilt in the ways in which people spoil them.

`python -m studies.judging.misuse --each 2 --seed 1` draws records of every kind of `studies.misuse`
and diagnoses them from their files with the models that they were drawn for. A cause that is named
is false unless it reads spoilt columns otherwise, and `consistent` or `recalibrate` is no answer.
Counted is whether the fault is told by its name, or else that the model does not describe the
record.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.tables import Table, Topic
from fmus.kit import UserError
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import Chosen, Part, Row, Study, among, settings_of, share, title
from studies.misuse import KINDS, MisuseCase, cases, draw_misused, write

if TYPE_CHECKING:
    from orchestration.diagnosis import Diagnosis
    from studies.misuse import Columns

REFUSED = "refused"
NAMED = "told by name"
IN_GENERAL = "told in general"
SILENT = "unexplained"
MISLED = "misled"
OUTCOMES = (REFUSED, NAMED, IN_GENERAL, SILENT, MISLED)
_FAULTS = {  # notes on what was done to values
    "resampled ten times finer": {"resampled"},
    "saturated": {"clipped", "clipped_repeatedly"},
    "of six levels": {"quantised"},
    "output is a copy of the input": {"copied"},
    "differentiated": {"differentiated", "moves_ahead"},
    "integrated": {"integrated"},
    "filtered both ways": {"filtered", "moves_ahead", "oversampled"},
    "output without sign": {"unsigned"},
    "outputs logged late": {"moves_ahead", "runs_ahead"},
    "outputs by another clock": {"other_clock"},
    "pieces in the wrong order": {"pieced"},
    "too short": {"short"},
    "sampled too coarsely": {"coarse"},
    "cut and closed up": {"pieced"},
    "two specimens in one": {"pieced", "other_specimen"},
    "inputs of another run": {"unrelated"},
    "outputs of something else": {"unrelated"},
}


def judge(case: MisuseCase) -> Row:
    """Draw a record, spoil it, diagnose it from its file, and tell what was said."""
    import orchestration as ppy

    right, spoilt = draw_misused(case)
    with tempfile.TemporaryDirectory() as folder:
        path = write(right, spoilt, Path(folder) / "record.csv")
        try:
            result = ppy.diagnose(
                path,
                right.plant.model,
                settings=settings_of(right),
                hold=right.plant.known,
            )
        except UserError as error:
            return asdict(case) | {"outcome": REFUSED, "said": str(error)}
    changed = _changed({"time": right.time, **right.inputs, **right.outputs}, spoilt)
    outcome = _outcome(case.kind, result.details, changed)
    return asdict(case) | {"outcome": outcome, "said": result.sentence}


def _changed(right: dict[str, Any], spoilt: Columns) -> set[str]:
    """Return the columns that were spoilt."""
    return {
        name
        for name, values in spoilt.everything.items()
        if len(values) != len(right[name]) or not np.allclose(values, right[name])
    }


def _outcome(kind: str, diagnosis: Diagnosis, changed: set[str]) -> str:
    """Class an answer, whose causes may be readings of columns."""
    is_noted = any(code in _FAULTS.get(kind, ()) for code, _, _ in diagnosis.notes)
    readings = [cause.reading for cause in diagnosis.causes if cause.reading is not None]
    told = [one for reading in readings for one in (reading, *reading.instead)]
    is_read = any(changed.issuperset(one.columns) for one in told)
    if diagnosis.is_named:
        return NAMED if is_read else MISLED
    if is_noted:
        return NAMED
    if diagnosis.verdict != "unexplained":
        return MISLED
    return IN_GENERAL if is_read else SILENT


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of what was said, by kind, and of the answers that mislead."""
    counts = {outcome: sum(row["outcome"] == outcome for row in rows) for outcome in OUTCOMES}
    table = [
        [kind, *(sum(row["outcome"] == outcome for row in of) for outcome in OUTCOMES)]
        for kind in KINDS
        if (of := [row for row in rows if row["kind"] == kind])
    ]
    said = counts[REFUSED] + counts[NAMED]
    parts: list[str | Table] = [
        f"Of {len(rows)} records {share(said, len(rows))} are refused or told by name,"
        f" {share(counts[IN_GENERAL], len(rows))} told not to be described by the model, and"
        f" {share(counts[MISLED], len(rows))} mislead: a cause, `consistent` or `recalibrate`.",
        Table(["misuse", *OUTCOMES], table),
    ]
    wrong = [[title(row, MisuseCase), row["said"]] for row in rows if row["outcome"] == MISLED]
    if wrong:
        parts.append(Table(["misled", "said"], wrong))
    return Topic("Misused records", parts)


def _parts(chosen: Chosen) -> Iterator[Part]:
    wanted = among(cases(chosen.each, chosen.seed), chosen)
    yield Part(wanted, judge, lambda row: f"{row['outcome']}: {row['said']}", report)


STUDY = Study(
    name="misuse",
    about=__doc__,
    parts=_parts,
    numbers={"--each": (2, "records of every kind")},
    page="misused-records.md",
    head="""# What is said of records that were spoilt

Drawn by `python -m studies.judging.misuse {options}`; `make misuse-study` draws it anew.
The records are clean ones, of generators that share no code with the models under test, spoilt in
the ways of `studies/misuse/kinds.py`. Whatever cause is named is false, unless it reads spoilt
columns otherwise.

{stamp}

""",
    code=(*DIAGNOSIS, "studies/clean", "studies/misuse", "studies/judging/misuse.py"),
)


if __name__ == "__main__":
    STUDY.main()
