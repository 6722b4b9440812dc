"""Study of misused records: clean ones, spoilt in the ways in which people spoil them.

`python -m studies.judging.misuse --each 2 --seed 1` draws records of every kind of `studies.misuse`
and diagnoses them from their files with the models that they were drawn for. A cause that is named
is false, and `consistent` or `recalibrate` is no answer. Counted is whether the fault is told by
its name, or else that the model does not describe the record; with `--new` by the new engine, whose
causes may be readings of columns.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.tables import Table, Topic
from fmus.kit import UserError
from studies.judging.clean import settings_of
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import Chosen, Part, Row, Study, among, share, title
from studies.misuse import KINDS, MisuseCase, cases, draw_misused, write

if TYPE_CHECKING:
    from orchestration.api import DiagnosisResult
    from orchestration.discrepancy import Note
    from studies.misuse import Columns

REFUSED = "refused"
NAMED = "told by name"
IN_GENERAL = "told in general"
SILENT = "unexplained"
MISLED = "misled"
OUTCOMES = (REFUSED, NAMED, IN_GENERAL, SILENT, MISLED)
_COLUMNS = {"exchanged", "other_sign", "other_unit"}  # notes on columns
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
    "cut and closed up": {"pieced"},
    "two specimens in one": {"pieced", "other_specimen"},
    "inputs of another run": {"unrelated"},
    "outputs of something else": {"unrelated"},
}
_GENERAL = {"large_error", "unrelated", "implausible", "not_followed", "end_not_followed"}


def judge(case: MisuseCase) -> Row:
    """Draw a record, spoil it, diagnose it from its file, and tell what was said."""
    return _judged(case, "old", _outcome)


def judge_by_terms(case: MisuseCase) -> Row:
    """Judge a record as `judge` does, by the new engine."""
    return _judged(case, "new", _outcome_by_terms)


def _judged(
    case: MisuseCase, engine: str, outcome_of: Callable[[str, DiagnosisResult, set[str]], str]
) -> Row:
    """Return the row of a record, diagnosed by an engine."""
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
                laws=False,
                engine=engine,
            )
        except UserError as error:
            return asdict(case) | {"outcome": REFUSED, "said": str(error)}
    changed = _changed({"time": right.time, **right.inputs, **right.outputs}, spoilt)
    outcome = outcome_of(case.kind, result, changed)
    return asdict(case) | {"outcome": outcome, "said": result.sentence}


def _changed(right: dict[str, Any], spoilt: Columns) -> set[str]:
    """Return the columns that were spoilt."""
    return {
        name
        for name, values in spoilt.everything.items()
        if len(values) != len(right[name]) or not np.allclose(values, right[name])
    }


def _outcome(kind: str, result: DiagnosisResult, changed: set[str]) -> str:
    """Class an answer."""
    notes = result.details.diagnosis.notes
    named = any(_names(note, kind, changed) for note in notes)
    if result.causes or str(result.verdict) in ("consistent", "recalibrate"):
        # of a fault of values that is told, what is left may be right
        return NAMED if named and not result.causes else MISLED
    if named:
        return NAMED
    general = _GENERAL & {str(note.code) for note in notes}
    return IN_GENERAL if general else SILENT


def _outcome_by_terms(kind: str, result: DiagnosisResult, changed: set[str]) -> str:
    """Class an answer of the new engine, whose causes may be readings of columns."""
    diagnosis = result.details
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


def _names(note: Note, kind: str, changed: set[str]) -> bool:
    """Return whether a note names a fault: its kind, or spoilt columns, be it beside others."""
    code = str(note.code)
    if kind in _FAULTS:
        return code in _FAULTS[kind]
    if code in _COLUMNS:
        others = [other.split(" in ")[0] for other in note.facts["others"]]
        told = [note.facts["columns"], *others]
        return any(changed.issuperset(columns.split(" and ")) for columns in told)
    return False


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
    by, name = (judge_by_terms, "new") if chosen.new else (judge, "")
    yield Part(wanted, by, lambda row: f"{row['outcome']}: {row['said']}", report, name)


STUDY = Study(
    name="misuse",
    about=__doc__,
    parts=_parts,
    numbers={"--each": (2, "records of every kind")},
    switches={"--new": "by the new engine"},
    page="misused-records.md",
    head="""# What is said of records that were spoilt

Drawn by `python -m studies.judging.misuse {options}`; `make misuse-study` draws it anew.
The records are clean ones, of generators that share no code with the models under test, spoilt in
the ways of `studies/misuse/kinds.py`. Whatever cause is named is false.

{stamp}

""",
    code=(*DIAGNOSIS, "studies/clean", "studies/misuse", "studies/judging/misuse.py"),
)


if __name__ == "__main__":
    STUDY.main()
