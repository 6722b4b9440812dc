"""Study of hidden and clean records, judged by the engine that adds terms to laws.

Records are drawn as in the studies `hidden`, `book` and `clean`; a cause is right if its law and
signal are, or those that act like them.

`python -m studies.judging.by_terms --records 60 --clean 60 --seed NEW` prints the rates.
"""

from __future__ import annotations

import re
import tempfile
import time as clock
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.tables import Topic
from fmus.kit import UserError
from fmus.kit.symbolic import PerturbedLaws
from orchestration.fmu import find_model
from studies.clean import Case, CleanRecord
from studies.clean import cases as clean_cases
from studies.clean import draw as draw_clean
from studies.hidden import OUTSIDE, USUAL, HiddenCase, cases, cases_of_two, draw_hidden
from studies.hidden import left as widths_left
from studies.judging.answers import LEAST
from studies.judging.clean import settings_of
from studies.judging.study import (
    Chosen,
    Part,
    Row,
    Study,
    among,
    counted,
    processor_time,
    share,
    title,
)
from studies.plants import BY_THE_BOOK

if TYPE_CHECKING:
    from orchestration.diagnosis import Diagnosis
    from orchestration.fmu import Model

_KINDS = ("first", "in the group", "best guess", "another", "none", "refused")
_GOOD = ("first", "in the group")


def judge(case: HiddenCase) -> Row:
    """Draw a record with hidden effects, diagnose it from its file, and compare the answer."""
    drawn = draw_hidden(case)
    row = asdict(case) | {"family": case.variation.family, "widths": widths_left(drawn)}
    if row["widths"] < LEAST:
        return row | {"verdict": "too little"}
    diagnosis, said = _diagnosed(drawn)
    right = [sorted(one.variation.right) for one in case.alone()]
    if diagnosis is None:
        return row | said | {"right": right}
    right = [sorted(said_otherwise(find_model(drawn.plant.model), names)) for names in right]
    causes = diagnosis.causes
    each = [_is_right(_names(cause), right) for cause in causes]
    parts = [_is_right(_names_of(part), right) for part in causes[0].parts] if causes else []
    return row | said | {"right": right, "each": each, "parts": parts}


def judge_clean(case: Case) -> Row:
    """Draw a record in which nothing is hidden, and diagnose it from its file."""
    _, said = _diagnosed(draw_clean(case))
    return asdict(case) | said


def _diagnosed(drawn: CleanRecord) -> tuple[Diagnosis | None, Row]:
    import orchestration as ppy

    began, used = clock.perf_counter(), processor_time()
    with tempfile.TemporaryDirectory() as folder:
        path = drawn.write(Path(folder) / "record.csv")
        try:
            result = ppy.diagnose(
                path,
                drawn.plant.model,
                settings=settings_of(drawn),
                hold=drawn.plant.known,
                engine="new",
            )
        except UserError as error:
            why = re.sub(r"\S*/", "", str(error))
            return None, {"verdict": "refused", "why": why, "processor": processor_time() - used}
    diagnosis = result.details
    return diagnosis, {
        "verdict": str(diagnosis.verdict),
        "said": [
            [cause.name, float(cause.probability), [str(part) for part in cause.parts]]
            for cause in diagnosis.causes
        ],
        "left": [one.noise_widths for one in diagnosis.remainders],
        "processor": processor_time() - used,
        "elapsed": clock.perf_counter() - began,
    }


def _names(cause: Any) -> set[str]:
    """Return the names under which a cause is known to the studies."""
    names = _names_of(cause.parts[0])
    for law, signal in cause.members:
        names |= _of_law(law, signal) if signal else {law}
    return names


def _names_of(part: Any) -> set[str]:
    """Return the names of a part of a model: an effect, or a law over or remembering a signal."""
    from orchestration.diagnosis import Term

    if not isinstance(part, Term):
        return {str(part), str(part).replace("reading_late", "transport_delay")}
    law, signal = part.cause
    # an effect and its family, or a fault of a sensor
    return _of_law(law, signal) if signal else {law, part.name}


def _of_law(law: str, signal: str) -> set[str]:
    return {f"{law} {word} {signal}" for word in ("over", "remembering", "loop of")}


def said_otherwise(model: Model, right: Iterable[str]) -> set[str]:
    """Return right names with those by which the engine says the same.

    A law over a signal is seen in the balance that it is a part of. A fault of an input is seen in
    the laws that depend on the input.
    """
    laws = PerturbedLaws(model.cls)
    rates = [state.rate for state in model.cls.layout.states]
    names = set(right)
    for name in right:
        law = re.fullmatch(r"(?:\w+ part of )?(\w+) (over|remembering|loop of) (\w+)", name)
        fault = re.fullmatch(r"(\w+)\((\w+)\)", name)
        if law and law[1] in laws.names:
            names |= {f"{rate} {law[2]} {law[3]}" for rate in rates if laws.calls(rate, law[1])}
        elif fault and fault[2] in model.inputs:
            depend = [law for law in laws.names if fault[2] in laws.computed_from(law)]
            if fault[1] == "input_offset":
                names |= {f"{law}()" for law in depend} | {f"reading_offset({fault[2]})"}
            else:
                names.update(*(_of_law(law, fault[2]) for law in depend))
    return names


def _is_right(names: set[str], right: Sequence[Sequence[str]]) -> bool:
    return any(names & {re.sub(r"^(odd|even) part of ", "", name) for name in of} for of in right)


def named(row: Row) -> str:
    """Return what was answered about the hidden effects, one of `_KINDS`."""
    if row["verdict"] in ("refused", "too little"):
        return str(row["verdict"])
    is_named = row["verdict"] in ("cause", "ambiguous")
    if not row["each"] or row["verdict"] == "consistent":
        return "none"
    if not is_named:
        return "best guess" if row["each"][0] else "none"
    if row["each"][0]:
        return "first"
    return "in the group" if any(row["each"]) else "another"


def _answer(row: Row) -> str:
    if row["verdict"] == "refused":
        return f"refused: {row['why']}"
    if row["verdict"] == "too little":
        return "not counted"
    kind = f"{named(row)}: " if "each" in row else ""
    said = "; ".join(f"{name} {p:.2f} [{' + '.join(parts)}]" for name, p, parts in row["said"])
    return f"{kind}{row['verdict']}, {said} ({row['processor']:.1f} s) right {row.get('right', '')}"


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of the answers about hidden effects."""
    those = [row for row in rows if row["verdict"] != "too little"]
    inside = [row for row in those if row["family"] != OUTSIDE]
    good = sum(named(row) in _GOOD for row in inside)
    first = sum(named(row) == "first" for row in inside)
    false = sum(any(not right for right in row.get("parts", [])[1:]) for row in inside)
    wrong = [row for row in those if named(row) not in _GOOD]
    lines = [f"- {title(row, HiddenCase)}: {_answer(row)}" for row in wrong]
    return Topic(
        "Hidden effects",
        [
            f"{len(those)} of {len(rows)} count. Of {len(inside)} with an effect of a family it is"
            f" first in {share(first, len(inside))}, first or in the group in"
            f" {share(good, len(inside))}; false further terms in {share(false, len(inside))}.",
            counted(those, "plant", _KINDS, named),
            "\n".join(lines),
        ],
    )


def report_clean(rows: Sequence[Row]) -> Topic:
    """Return how many clean records are called what."""
    false = [row for row in rows if row["verdict"] not in ("consistent", "recalibrate")]
    lines = [f"- {title(row, Case)}: {_answer(row)}" for row in false]
    text = f"{len(rows) - len(false)} of {len(rows)} are consistent or recalibrated."
    return Topic("Clean records", [text, "\n".join(lines)])


def _parts(chosen: Chosen) -> Iterator[Part]:
    plants = BY_THE_BOOK if chosen.book else USUAL
    yield Part(among(cases(chosen.records, chosen.seed, plants), chosen), judge, _answer, report)
    pairs = among(cases_of_two(chosen.two, chosen.seed, plants), chosen)
    yield Part(pairs, judge, _answer, report, "two")
    bare = (
        clean_cases(chosen.clean, chosen.seed, BY_THE_BOOK)
        if chosen.book
        else clean_cases(chosen.clean, chosen.seed)
    )
    yield Part(among(bare, chosen), judge_clean, _answer, report_clean, "clean")


STUDY = Study(
    name="by_terms",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (60, "records with one hidden effect"),
        "--two": (0, "records with two at once"),
        "--clean": (60, "records in which nothing is hidden"),
    },
    switches={"--book": "of the plants by the book"},
)


if __name__ == "__main__":
    STUDY.main()
