"""Causes that are named beside a missing law, where the catalogue is looked at as well."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.tables import Table, Topic
from fmus.kit import Effect, UserError
from fmus.kit.arrays import Array
from fmus.kit.effects import effect_name, made_with
from studies.hidden_laws import Answer, LawCase, base_of, draw_lack, is_right, series
from studies.judging.clean import settings_of
from studies.judging.laws_answers import excluded, stands_still
from studies.judging.study import Row, processor_time, share, title

# what is remembered of a signal, by the words that the family of an effect has for it
_MEMORIES = {
    "over temperature": ("heat",),
    "over throughput": ("throughput",),
    "over": ("",),
    "remembering": ("lagged", "leading"),
}


def judge(case: LawCase) -> Row:
    """Draw a record, leave it if it does not count, and diagnose it with the catalogue on."""
    row = asdict(case) | {"kind": case.kind.kind, "widths": 0.0, "seconds": 0.0}
    try:
        drawn = draw_lack(case)
    except OverflowError:  # a plant in a loop that runs away makes no record
        return row
    known = series(drawn)
    still = stands_still(known.get(case.kind.place.signal))
    row |= {"widths": base_of(drawn).left, "still": still}
    if excluded(row):
        return row
    import orchestration as ppy

    began = processor_time()
    with tempfile.TemporaryDirectory() as folder:
        path = drawn.write(Path(folder) / "record.csv")
        try:
            result = ppy.diagnose(
                path,
                drawn.plant.model,
                settings=settings_of(drawn),
                hold=drawn.plant.known,
                laws=True,
                engine="old",
            )
        except UserError as error:
            return row | {"refused": str(error)[:200], "seconds": processor_time() - began}
    diagnosis = result.details.diagnosis
    effects = [step.chosen.effect for step in diagnosis.selection.steps]
    right = case.kind.right
    return row | {
        "seconds": processor_time() - began,
        "sentence": result.sentence,
        "verdict": str(result.verdict),
        "causes": [effect_name(effect) for effect in effects],
        "right": [is_right_effect(effect, right, known, drawn.step) for effect in effects],
    }


def is_right_effect(
    effect: type[Effect], right: frozenset[Answer], known: Mapping[str, Array], step: float
) -> bool:
    """Return whether an effect changes a right law by a right signal, in whatever shape.

    Parameters
    ----------
    effect : type[Effect]
    right : frozenset of Answer
    known : Mapping of str to ndarray, shape (n,)
        Signals of the plant in truth, SI.
    step : float
        Between samples, s.
    """
    return any(is_right(answer, right, known, step) for answer in _answers(effect))


def _answers(effect: type[Effect]) -> list[Answer]:
    """Return the answers that an effect gives."""
    made = made_with(effect)
    signal = made.get("signal")
    if "kind" in made and hasattr(signal, "memory"):
        return [Answer(made["law"], made["kind"], signal.name, signal.memory)]
    term = effect.term
    words = next((w for w in _MEMORIES if f" {w}" in f" {term.family}"), "over")
    name = term.signal.split(" ")[0].rstrip(",")
    return [
        Answer(term.law, kind, name, memory)
        for kind in ("add", "multiply")
        for memory in _MEMORIES[words]
    ]


def false_companions(row: Row) -> list[str]:
    """Return what is named beside a right cause and is not right itself."""
    named = list(zip(row.get("causes", []), row.get("right", []), strict=True))
    if not any(right for _, right in named):
        return []
    return [cause for cause, right in named if not right]


def answer_line(row: Row) -> str:
    """Return the answer to a record as a line of text."""
    if excluded(row):
        return f"not counted ({row['widths']:.1f} widths)"
    if "refused" in row:
        return f"refused: {row['refused']}"
    named = zip(row["causes"], row["right"], strict=True)
    said = " + ".join(cause if right else f"{cause} (wrong)" for cause, right in named)
    return f"{row['verdict']}: {said or 'nothing'} ({row['seconds']:.0f} s)"


def report(rows: Sequence[Row]) -> Topic:
    """Return how often something else is named beside a right law."""
    counted = [row for row in rows if not excluded(row)]
    hits = [row for row in counted if any(row.get("right", []))]
    first = [row for row in hits if row["right"][0]]
    false = [row for row in counted if false_companions(row)]
    wrong = [row for row in counted if row not in first or row in false]
    return Topic(
        "With the catalogue on",
        [
            (
                f"{len(rows)} records, of which {len(counted)} count. A right law over a right"
                f" signal is named in {share(len(hits), len(counted))}, and first in"
                f" {share(len(first), len(counted))}; something else is named beside it, falsely,"
                f" in {share(len(false), len(counted))}."
            ),
            "What was said of the others:",
            Table(["record", "said"], [[title(row, LawCase), answer_line(row)] for row in wrong]),
        ],
    )
