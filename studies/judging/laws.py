"""Study of records whose law lacks a term of no catalogue, which `ppy laws` should name.

`python -m studies.judging.laws --records 120 --seed 1` draws plants, kinds, shapes, strengths,
stimuli and kinds of noise with generators that share no code with what they judge
(`studies/hidden_laws`). Records in which what is hidden leaves too little after a refit of the base
are not counted. Beside it stands a naive search for the signal of which the residual is a curve.
`--clean 120` asks the same of records in which nothing is hidden.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.tables import Topic
from fmus.kit import UserError
from fmus.kit.arrays import Array
from studies.clean import Case, CleanRecord
from studies.clean import cases as clean_cases
from studies.clean import draw as draw_clean
from studies.hidden_laws import (
    Answer,
    Kind,
    LawCase,
    base_of,
    cases,
    draw_lack,
    is_right,
    least_bic,
    proportional,
    series,
)
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import (
    Chosen,
    Part,
    Row,
    Study,
    among,
    counted,
    processor_time,
    settings_of,
    share,
    title,
)
from studies.plants import PLANTS

if TYPE_CHECKING:
    from orchestration.diagnosis import Diagnosis

LEAST = 4.0  # noise widths that must be left of what is hidden
KINDS = ("first", "in the group", "best guess", "another", "none", "refused")
_GOOD = KINDS[:2]
_WAYS = [
    (kind, memory)
    for kind in ("add", "multiply")
    for memory in ("", "lagged", "leading", "heat", "integrated", "throughput")
]
_STILL = 1e-9  # of its size, within which a signal stands still


def judge(case: LawCase) -> Row:
    """Draw a record, leave it if it does not count, and ask the laws of the model."""
    row = asdict(case) | {"kind": case.kind.kind, "shape": case.kind.shape, "widths": 0.0}
    try:
        drawn = draw_lack(case)
        base = base_of(drawn)
    except (OverflowError, ValueError):  # a plant that runs away makes no record
        return row
    known = series(drawn)
    row |= {"widths": base.left, "still": stands_still(known.get(case.kind.place.signal))}
    if excluded(row):
        return row
    residuals = {o: y - base.outputs[o] for o, y in drawn.outputs.items()}
    ranked = least_bic(residuals, {**drawn.inputs, **drawn.outputs, **base.states}, drawn.regular)
    row["naive"] = bool(ranked) and naive_is_right(ranked[0], case.kind.right, known)
    diagnosis, said = _asked(drawn)
    if diagnosis is None:
        return row | said
    those = right_answers(case.kind, known)
    right = [is_named(c.members, those, known, drawn.step) for c in diagnosis.causes]
    return row | said | {"right": right}


def judge_clean(case: Case) -> Row:
    """Ask the laws of a clean record."""
    return asdict(case) | _asked(draw_clean(case))[1]


def _asked(drawn: CleanRecord) -> tuple[Diagnosis | None, Row]:
    """Return the answer to a record, None if it is refused."""
    import orchestration as ppy

    used = processor_time()
    with tempfile.TemporaryDirectory() as folder:
        path = drawn.write(Path(folder) / "record.csv")
        known = {"settings": settings_of(drawn), "hold": drawn.plant.known}
        try:
            result = ppy.laws(path, drawn.plant.model, **known)
        except UserError as error:
            why = re.sub(r"\S*/", "", str(error))
            return None, {"verdict": "refused", "why": why, "processor": processor_time() - used}
    diagnosis = result.details
    said = [
        f"{cause.name} {cause.probability:.2f} [{' + '.join(map(str, cause.parts))}]"
        for cause in diagnosis.causes
    ]
    seconds = processor_time() - used
    return diagnosis, {"verdict": str(result.verdict), "said": said, "processor": seconds}


def right_answers(kind: Kind, known: Mapping[str, Array]) -> frozenset[Answer]:
    """Return the right answers: in percent of a law that stands still is an addition to it.

    Parameters
    ----------
    kind : Kind
    known : Mapping of str to ndarray, shape (n,)
        Signals of the plant in truth, SI.
    """
    plant = PLANTS[kind.plant]
    still = [a for a in kind.right if a.kind == "multiply" and a.law in known]
    added = {
        replace(answer, law=law, kind="add")
        for answer in still
        if stands_still(known[answer.law])
        for law in plant.equals(answer.law, plant.nominal)
    }
    return kind.right | added


def is_named(
    members: Iterable[tuple[str, str]],
    right: frozenset[Answer],
    known: Mapping[str, Array],
    step: float,
) -> bool:
    """Return whether a cause is a right law over a right signal, or over what is remembered of it.

    Parameters
    ----------
    members : iterable of (str, str)
        Laws with their signals that are the cause in other words.
    right : frozenset of Answer
    known : Mapping of str to ndarray, shape (n,)
        Signals of the plant in truth, SI.
    step : float
        Between samples, s.
    """
    return any(
        is_right(Answer(law, kind, signal, memory), right, known, step)
        for law, signal in members
        for kind, memory in _WAYS
    )


def excluded(row: Row) -> bool:
    """Return whether what is hidden leaves too little, or depends on what stands still."""
    return bool(row["widths"] < LEAST or row.get("still"))


def stands_still(signal: Array | None) -> bool:
    """Return whether a term of a signal is constant in a record; None stands for the time."""
    return signal is not None and float(np.ptp(signal)) <= _STILL * float(np.abs(signal).max())


def naive_is_right(name: str, right: Iterable[Answer], known: Mapping[str, Array]) -> bool:
    """Return whether some right answer is a curve of a signal as it is, whatever its law."""
    signals = {a.signal for a in right if not a.memory}
    mine = known.get(name)
    return name in signals or (
        mine is not None and any(proportional(mine, known.get(s)) for s in signals)
    )


def named(row: Row) -> str:
    """Return how the hidden term was answered, one of `KINDS`."""
    if row["verdict"] == "refused":
        return "refused"
    right = row["right"]
    if not right or row["verdict"] in ("consistent", "recalibrate"):
        return "none"
    if row["verdict"] == "unexplained":
        return "best guess" if right[0] else "none"
    if right[0]:
        return "first"
    return "in the group" if any(right) else "another"


def _line(row: Row) -> str:
    if "verdict" not in row:
        return f"not counted: {row['widths']:.1f} widths"
    kind = f"{named(row)}: " if "widths" in row else ""
    said = row.get("why") or "; ".join(row["said"])
    return f"{kind}{row['verdict']}, {said} ({row['processor']:.0f} s)"


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of the answers about hidden laws."""
    those = [row for row in rows if "verdict" in row]
    seconds = [row["processor"] for row in those]
    pace = f"Processor seconds: median {np.median(seconds):.0f}, largest {np.max(seconds):.0f}."
    axes = ("strength", "plant", "noise", "stimulus", "kind")
    tables = [counted(those, axis, KINDS, named, naive=lambda row: row["naive"]) for axis in axes]
    bad = [row for row in those if named(row) not in _GOOD]
    lines = "\n".join(f"- {title(row, LawCase)}: {_line(row)}" for row in bad)
    more = ["What was said of the others:", lines] if bad else []
    return Topic("Hidden laws", [_sums(rows, those), pace, *tables, *more])


def _sums(rows: Sequence[Row], those: Sequence[Row]) -> str:
    """Return how many records there are and how many count, and what is told of these."""
    count = len(those)
    still = sum(bool(row.get("still")) for row in rows)
    little = len(rows) - still - count
    good = share(sum(named(row) in _GOOD for row in those), count)
    guessed = share(sum(bool(row.get("right") and row["right"][0]) for row in those), count)
    sure = [row for row in those if row["verdict"] == "cause"]
    wrong = sum(not row["right"][0] for row in sure)
    naive = share(sum(row["naive"] for row in those), count)
    return (
        f"{len(rows)} records: in {still} the signal stands still, and {little} leave less than"
        f" {LEAST:g} noise widths or make no record; {count} count. The right law over the right"
        f" signal is named first, or in a group of at most 3, in {good}; it is the first guess,"
        f" sure or not, in {guessed}. A cause is told in {len(sure)}, wrong in {wrong}. The naive"
        f" signal is right in {naive}; it names no law."
    )


def report_clean(rows: Sequence[Row]) -> Topic:
    """Return what is told of records in which nothing is hidden."""
    false = [row for row in rows if row["verdict"] not in ("consistent", "recalibrate")]
    sure = sum(row["verdict"] in ("cause", "ambiguous") for row in false)
    text = (
        f"{len(rows)} records in which nothing is hidden: something is named in"
        f" {share(sure, len(rows))}, and {len(false) - sure} more are unexplained or refused."
    )
    lines = "\n".join(f"- {title(row, Case)}: {_line(row)}" for row in false)
    return Topic("Laws of clean records", [text, lines])


def _parts(chosen: Chosen) -> Iterator[Part]:
    yield Part(among(cases(chosen.records, chosen.seed), chosen), judge, _line, report)
    bare = among(clean_cases(chosen.clean, chosen.seed), chosen)
    yield Part(bare, judge_clean, _line, report_clean, "clean")


STUDY = Study(
    name="laws",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (120, "records of hidden laws"),
        "--clean": (0, "records in which nothing is hidden"),
    },
    page="hidden-laws.md",
    head=f"""# How often a law is found that lacks what no catalogue has

Drawn by `python -m studies.judging.laws {{options}}`, a seed that was not looked at before.
Every kind has three shapes, and the generators share no code with what they judge. Not counted are
records in which what is hidden leaves less than {LEAST:g} noise widths after a refit of the base,
or depends on a signal that stands still, so that it is a constant. What is called right is in
`studies/hidden_laws/kinds.py`: every law over every signal, or over a memory of it, that does the
same to the outputs. No effect of a catalogue is looked at
([why](decisions/0106-laws-by-the-one-search.md)).

{{stamp}}

""",
    code=(
        *DIAGNOSIS,
        "studies/hidden_laws",
        "studies/hidden",
        "studies/clean",
        "studies/judging/laws.py",
    ),
)


if __name__ == "__main__":
    STUDY.main()
