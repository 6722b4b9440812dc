"""Study of records in which something is hidden, and of clean ones: which causes are named.

`python -m studies.judging.hidden --records 60 --clean 60 --seed NEW` draws plants, families,
shapes, strengths, stimuli and kinds of noise with generators that share no code with what they
judge (`studies/hidden`, `studies/clean`, the emulated rig of `demonstrations`), diagnoses each
record from its file, and writes how often that is right. A cause is right if its law and signal
are, or those that act like them.
"""

from __future__ import annotations

import re
import tempfile
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.tables import Cell, Table, Topic
from fmus.kit import UserError
from fmus.kit.symbolic import PerturbedLaws
from orchestration.fmu import find_model
from studies.clean import Case, CleanRecord
from studies.clean import cases as clean_cases
from studies.clean import draw as draw_clean
from studies.hidden import (
    USUAL,
    HiddenCase,
    TermCase,
    cases,
    cases_of_terms,
    cases_of_two,
    draw_hidden,
    draw_term,
    left_beside,
)
from studies.hidden import left as widths_left
from studies.judging.calibration import groups_of
from studies.judging.floor import best_plain_term
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import (
    LEAST,
    Chosen,
    Part,
    Row,
    Study,
    among,
    counted,
    grouped,
    processor_time,
    settings_of,
    share,
)
from studies.plants import BY_THE_BOOK, DRAWN

if TYPE_CHECKING:
    from orchestration.diagnosis import Diagnosis
    from orchestration.fmu import Model

LITTLE = "too little"  # is left after a refit, so that a record does not count
_KINDS = ("first", "in the group", "best guess", "another", "none", "refused")
_VERDICTS = ("consistent", "recalibrate", "unexplained", "ambiguous", "cause", "refused")
_NAMED = ("cause", "ambiguous")
_ACTUATOR = "ppy_actuator"


@dataclass(frozen=True)
class RigCase:
    """A record of the emulated rig to draw, ten minutes at 10 Hz.

    Attributes
    ----------
    hidden : str
        Of `demonstrations.emulator.CATALOGUE`.
    seed : int
    strength, colour : float
        Factor of the noise widths that are left, and lag-one correlation of the noise.
    """

    hidden: str
    seed: int
    strength: float
    colour: float

    @property
    def plant(self) -> str:
        """The model that it is diagnosed with."""
        return _ACTUATOR

    @property
    def noise(self) -> str:
        """Kind of its noise."""
        return "AR" if self.colour else "Gaussian"

    def __str__(self) -> str:
        return f"{self.hidden}, {self.strength:g}, {self.plant}, {self.noise}, {self.seed}"


def rig_cases(count: int, seed: int) -> list[RigCase]:
    """Draw cases of the emulated rig: effects in an order that is drawn, then the same again."""
    from demonstrations.emulator import CATALOGUE

    rng = np.random.default_rng([seed, 15])
    names: list[str] = []
    while len(names) < count:
        names += [str(name) for name in rng.permutation(list(CATALOGUE))]
    return [
        RigCase(name, 100_000 * seed + k, (1.0, 0.3)[k % 2], (0.0, 0.9)[k // 2 % 2])
        for k, name in enumerate(names[:count])
    ]


def judge(case: HiddenCase, with_floor: bool = False) -> Row:
    """Draw a record with one hidden effect or two, diagnose it, and compare the answer.

    Parameters
    ----------
    case : HiddenCase
    with_floor : bool
        Whether the floor is asked too, which may take longer than the diagnosis.
    """
    drawn = draw_hidden(case)
    each = case.alone()
    widths = [widths_left(draw_hidden(one)) for one in each] if len(each) > 1 else []
    least = min(*left_beside(drawn), *widths) if widths else widths_left(drawn)
    row = _described(case, least) | {"family": case.variation.family}
    if least < LEAST:
        return row
    return row | _of_drawn(drawn, [one.variation.right for one in each], with_floor)


def judge_term(case: TermCase) -> Row:
    """Draw a record with a hidden term of a form that the engine knows."""
    return _described(case) | _of_drawn(draw_term(case), [case.hidden.right])


def judge_clean(case: Case) -> Row:
    """Draw a record in which nothing is hidden, and diagnose it from its file."""
    return _described(case) | _of_drawn(draw_clean(case), [])


def judge_rig(case: RigCase) -> Row:
    """Draw a record of the emulated rig, diagnose it, and compare the answer."""
    from demonstrations import draw, write

    try:
        drawn = draw(case.hidden, case.seed, strength=case.strength, noise_colour=case.colour)
    except ValueError:  # at no plausible size
        return _described(case, 0.0)
    (hidden,) = drawn.truth.hidden
    if hidden.alike:  # other parameters do just the same
        return _described(case, 0.0)
    row = _described(case, max(drawn.truth.widths.values()))
    if row["widths"] < LEAST:
        return row
    name = f"{hidden.id}({hidden.output})" if hidden.output else hidden.id
    truth = asdict(drawn.truth.parameters)
    return row | _answered(partial(write, drawn), _ACTUATOR, truth, [_names_of_effect(name)])


def _described(case: Any, widths: float = np.inf) -> Row:
    """Return a row of a case, which does not count where too little is left."""
    row = asdict(case) | {"title": str(case), "plant": case.plant, "noise": case.noise}
    if np.isfinite(widths):
        row["widths"] = widths
    return row | ({"verdict": LITTLE} if widths < LEAST else {})


def _of_drawn(drawn: CleanRecord, right: Sequence[Iterable[str]], with_floor: bool = False) -> Row:
    """Diagnose a record of a plant."""
    plant = drawn.plant
    truth = {name: drawn.truth[name] for name in plant.nominal}
    settings = settings_of(drawn)
    known = {"settings": settings, "hold": plant.known}
    return _answered(drawn.write, plant.model, truth, right, with_floor, **known)


def _answered(
    write: Callable[[Path], object],
    model: str,
    truth: Mapping[str, float],
    right: Sequence[Iterable[str]],
    with_floor: bool = False,
    **options: Any,
) -> Row:
    """Diagnose a record from its file, and compare the answer with the right names."""
    import orchestration as ppy

    names = [said_otherwise(find_model(model), of) if of else set() for of in right]
    row: Row = {"right": [sorted(of) for of in names if of]}
    began, used = clock.perf_counter(), processor_time()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.csv"
        write(path)
        try:
            diagnosis = ppy.diagnose(path, model, **options).details
        except UserError as error:
            why = re.sub(r"\S*/", "", str(error))
            return row | {"verdict": "refused", "why": why, "processor": processor_time() - used}
    row |= {"processor": processor_time() - used, "elapsed": clock.perf_counter() - began}
    row |= _told(diagnosis, row["right"], truth)
    return row | (_floor(diagnosis, row["right"]) if with_floor else {})


def _told(diagnosis: Diagnosis, right: Sequence[Sequence[str]], truth: Mapping[str, float]) -> Row:
    """Return what was said, and which of the right answers each cause and each part is."""
    causes = diagnosis.causes
    inside = {}
    for name, value in truth.items():
        if name in diagnosis.parameters:
            low, high = diagnosis.parameters[name].interval
            if np.isfinite([low, high]).all():
                inside[name] = bool(low <= value <= high)
    return {
        "verdict": str(diagnosis.verdict),
        "said": [
            [cause.name, float(cause.probability), [str(part) for part in cause.parts]]
            for cause in causes
        ],
        "causes": [_matches(_names(cause), right) for cause in causes],
        "parts": [_matches(_names_of(part), right) for part in causes[0].parts] if causes else [],
        "inside": inside,
        "groups": groups_of(
            diagnosis.found,
            diagnosis.conclusion,
            lambda cause: bool(_matches(_names(cause), right)),
        ),
    }


def _floor(diagnosis: Diagnosis, right: Sequence[Sequence[str]]) -> Row:
    """Return the answer of the floor, which knows laws alone, where a law over a signal is right.

    It is of one cause.
    """
    if len(right) != 1 or not any(" over " in name for name in right[0]):
        return {}
    term = best_plain_term(diagnosis.found.subject)
    return {"floor": bool(term is not None and _matches(_names_of(term), right))}


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


def _names_of_effect(name: str) -> set[str]:
    """Return the names of an effect of the actuator: its own, and its law over its signal."""
    from orchestration.fmu.model import known_effects

    term = known_effects(find_model(_ACTUATOR).cls)[name].term
    return {name, term.family, f"{term.law} over {term.signal}"} if term.law else {name}


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
    return {re.sub(r"^(odd|even) part of ", "", name) for name in names}


def _matches(names: set[str], right: Sequence[Sequence[str]]) -> list[int]:
    """Return which of the right answers, each of several names, names are of."""
    return [k for k, of in enumerate(right) if names.intersection(of)]


def named(row: Row) -> str:
    """Return what was answered about hidden effects, one of `_KINDS`."""
    if row["verdict"] == "refused":
        return "refused"
    if not row["causes"] or row["verdict"] == "consistent":
        return "none"
    if row["verdict"] not in _NAMED:
        return "best guess" if row["causes"][0] else "none"
    if row["causes"][0]:
        return "first"
    return "in the group" if any(row["causes"]) else "another"


def both(row: Row) -> bool:
    """Return whether two hidden effects are named, each by a part of the first cause."""
    pairs = [(k, which) for k, of in enumerate(row.get("parts", [])) for which in of]
    is_named = row["verdict"] in _NAMED
    return is_named and any(k != m and a != b for k, a in pairs for m, b in pairs)


def _has_false_part(row: Row) -> bool:
    return row["verdict"] in _NAMED and not all(row["parts"][1:])


def _is_sure(row: Row) -> bool:
    return bool(row["verdict"] == "cause")


def _line(row: Row) -> str:
    if row["verdict"] == LITTLE:
        return "not counted"
    if row["verdict"] == "refused":
        return f"refused: {row['why']}"
    said = "; ".join(f"{name} {p:.2f} [{' + '.join(parts)}]" for name, p, parts in row["said"])
    kind = f"{named(row)}: " if row["right"] else ""
    right = f", right: {' | '.join(of[0] for of in row['right'])}" if row["right"] else ""
    return f"{kind}{row['verdict']}, {said or 'nothing'} ({row['processor']:.1f} s){right}"


def report(rows: Sequence[Row], heading: str, axes: Sequence[str]) -> Topic:
    """Return tables of the answers about hidden effects.

    Parameters
    ----------
    rows : sequence of dict
    heading : str
    axes : sequence of str
        Keys by which answers are counted.
    """
    those = [row for row in rows if row["verdict"] != LITTLE]
    inside = [row for row in those if row["right"]]
    outside = [row for row in those if not row["right"]]
    two = [row for row in inside if len(row["right"]) > 1]
    first = [row for row in inside if named(row) == "first"]
    floors = [row for row in inside if "floor" in row]
    questions = [
        _question("the first cause is right", inside, lambda row: named(row) == "first"),
        _question(
            "a cause of the group is right",
            inside,
            lambda row: named(row) in ("first", "in the group"),
        ),
        _question(
            "the first cause or best guess is right",
            inside,
            lambda row: named(row) in ("first", "best guess"),
        ),
        _question("both are named", two, both),
        _question("sure and wrong", inside, lambda row: _is_sure(row) and not row["causes"][0]),
        _question("sure, of what is outside of every family", outside, _is_sure),
        _question("a further term is false", inside, _has_false_part),
        _question("where a law is wrong: first", floors, lambda row: named(row) == "first"),
        _question("where a law is wrong: the floor is right", floors, lambda row: row["floor"]),
        _covered("where first, true values in 95 % intervals", first),
    ]
    wrong = [row for row in inside if named(row) not in ("first", "in the group")]
    wrong += [row for row in outside if _is_sure(row)]
    told = f"{len(those)} of {len(rows)} records count."
    if not those:
        return Topic(heading, [told])
    parts: list[str | Table] = [
        told,
        _table(questions),
        *(counted(inside, axis, _KINDS, named) for axis in axes),
        *_intervals(first),
        *_times(those),
        "\n".join(f"- {row['title']}: {_line(row)}" for row in wrong),
    ]
    return Topic(heading, [part for part in parts if part])


def report_clean(rows: Sequence[Row]) -> Topic:
    """Return tables of what is said of clean records."""
    answered = [row for row in rows if row["verdict"] != "refused"]
    silent = ("consistent", "recalibrate")
    questions = [
        _question("accused: a cause is named", rows, lambda row: row["verdict"] in _NAMED),
        _question("called unexplained", rows, lambda row: row["verdict"] == "unexplained"),
        _question("refused", rows, lambda row: row["verdict"] == "refused"),
        _covered(
            "where not accused, true values in 95 % intervals",
            [row for row in answered if row["verdict"] in silent],
        ),
    ]
    lines = [f"- {row['title']}: {_line(row)}" for row in rows if row["verdict"] not in silent]
    return Topic(
        "Clean records",
        [
            f"{len(rows)} records.",
            _table(questions),
            *(counted(rows, axis, _VERDICTS, _verdict) for axis in ("plant", "noise")),
            *_intervals([row for row in answered if row["verdict"] in silent]),
            *_times(rows),
            *(["\n".join(lines)] if lines else []),
        ],
    )


def _verdict(row: Row) -> str:
    return str(row["verdict"])


def _question(text: str, rows: Sequence[Row], holds: Callable[[Row], Any]) -> list[Cell]:
    """Return a question with how many rows it is asked of, and of how many it is true."""
    return [text, len(rows), share(sum(bool(holds(row)) for row in rows), len(rows))]


def _covered(text: str, rows: Sequence[Row]) -> list[Cell]:
    hits = [hit for row in rows for hit in row["inside"].values()]
    return [text, len(hits), share(sum(hits), len(hits))]


def _table(questions: Sequence[list[Cell]]) -> Table:
    """Return the questions that are asked of any row."""
    return Table(["question", "of", "yes"], [asked for asked in questions if asked[1]])


def _intervals(rows: Sequence[Row]) -> list[Table]:
    """Return how often intervals hold the truth, by kind of noise."""
    table = [_covered(str(noise), of) for noise, of in grouped(rows, "noise").items()]
    return [Table(["noise", "intervals", "cover"], table)] if table else []


def _times(rows: Sequence[Row]) -> list[str]:
    seconds = [row["processor"] for row in rows]
    return [
        f"Processor time of a diagnosis: median {np.median(seconds):.1f} s, 90 %"
        f" {np.quantile(seconds, 0.9):.1f} s, largest {max(seconds):.1f} s."
    ]


def _parts(chosen: Chosen) -> Iterator[Part]:
    plants = (*USUAL, *BY_THE_BOOK)
    one = among(cases(chosen.records, chosen.seed, plants), chosen)
    two = among(cases_of_two(chosen.two, chosen.seed, plants), chosen)
    terms = among(cases_of_terms(chosen.terms, chosen.seed), chosen)
    rig = among(rig_cases(chosen.rig, chosen.seed), chosen)
    bare = among(clean_cases(chosen.clean, chosen.seed, (*DRAWN, *BY_THE_BOOK)), chosen)
    judge_one = partial(judge, with_floor=chosen.floor)
    yield _part(one, judge_one, "One hidden effect", ("family", "plant"))
    yield _part(two, judge, "Two hidden effects", ("plant",), "two")
    yield _part(terms, judge_term, "A term of a known form", ("plant",), "terms")
    yield _part(rig, judge_rig, "Effects of the emulated rig", ("hidden",), "rig")
    yield Part(bare, judge_clean, _line, report_clean, "clean")


def _part(
    wanted: Sequence[Any],
    judged: Callable[[Any], Row],
    heading: str,
    axes: Sequence[str],
    name: str = "",
) -> Part:
    return Part(wanted, judged, _line, partial(report, heading=heading, axes=axes), name)


STUDY = Study(
    name="hidden",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (60, "records with one hidden effect"),
        "--two": (0, "records with two at once"),
        "--terms": (0, "records with a term of a form that the engine knows"),
        "--rig": (0, "records of the emulated rig"),
        "--clean": (60, "records in which nothing is hidden"),
    },
    switches={"--floor": "fit every plain term alone, which may take longer than a diagnosis"},
    page="hidden-records.md",
    head=f"""# How often the right cause is named

Drawn by `python -m studies.judging.hidden {{options}}`, a seed that was not looked at before;
`make hidden-study` draws it anew. Every family of effects has several shapes, and the generators
share no code with what they judge: plants that nobody here prepared, ten that textbooks have, in
units from um to km and ms to days, each with the model that an engineer writes first, and the
emulated rig of the actuator. Not counted are records in which the effect leaves less than
{LEAST:g} noise widths after a refit of the base. What is called right is in
`studies/hidden/variations.py`. *First* are records whose first cause is right, *in the group* those
of whose group of causes another is, *best guess* those where nothing is named and the best guess is
right. With `--floor`, every plain term of a law is fitted alone from nominal values, and that of
the least information criterion is held beside the answers where a law is wrong.

{{stamp}}

""",
    code=(
        *DIAGNOSIS,
        "fmus/galvanostat",
        "fmus/ppy_actuator",
        "fmus/voice_coil_dma",
        "orchestration/fmu/model/effects.py",
        "demonstrations/bench.py",
        "demonstrations/records.py",
        "demonstrations/emulator",
        "studies/hidden",
        "studies/clean",
        "studies/plants",
        "studies/judging/floor.py",
        "studies/judging/hidden.py",
    ),
)


if __name__ == "__main__":
    STUDY.main()
