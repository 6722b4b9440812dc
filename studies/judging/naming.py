"""Study of hundreds of emulated records: how often the hidden effect is named.

A confusion matrix and the rates that count.

`python -m studies.judging.naming --seeds 2 --seed NEW --out docs/naming.md` writes the page; the
seed should be one that nobody has looked at.
"""

from __future__ import annotations

import tempfile
import time as clock
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.tables import Table, Topic
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import Chosen, Part, Row, Study, among, processor_time

if TYPE_CHECKING:
    from orchestration.fmu import Model
    from orchestration.records import Record

Drawn = Any  # of `demonstrations.draw`
Answering = Callable[["Record", "Model", Drawn], Row]

PAIRS = (
    ("strain_saturation", "double_layer"),
    ("resistance_growth", "quadratic_strain"),
    ("second_kelvin", "charge_dependent_capacitance"),
    ("nonlinear_stiffness", "force_to_voltage"),
    ("strain_hysteresis", "capacitance_fade"),
    ("transport_delay.voltage", "slack"),
    ("self_heating", "strain_lag"),
    ("sensor_drift.voltage", "charge_dependent_stiffness"),
)
VARIANTS: dict[str, dict[str, Any]] = {
    "voltage only": {"outputs": ("voltage",)},
    "displacement only": {"outputs": ("displacement",)},
    "2 Hz": {"rate": 2.0},
    "three minutes": {"duration": 180.0},
    "not at rest": {"at_rest": False},
}
CHANGES = {"R1 +40 %": ("R1", {"R1": 1.4}), "k2 -30 %": ("k2", {"k2": 0.7})}


@dataclass(frozen=True)
class Case:
    """A record to draw, and what should be said of it.

    Attributes
    ----------
    group : str
    hidden : tuple of str
    seed : int
    options : dict
        Of `demonstrations.records.draw`.
    """

    group: str
    hidden: tuple[str, ...]
    seed: int
    options: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.group}: {' + '.join(self.hidden) or 'nothing'} {self.seed}"


def cases(seeds: int, first: int = 1) -> Iterator[Case]:
    """Return everything that is drawn, the first seeds of all groups first.

    Parameters
    ----------
    seeds : int
        Of every variation at every strength and colour; the other groups in proportion.
    first : int
        The first of them.
    """
    from demonstrations.emulator import CATALOGUE, UNKNOWN

    for seed in range(first, first + seeds):
        for colour in (0.0, 0.9):
            for strength in (1.0, 0.3):
                group = f"strength {strength:g}, φ = {colour:g}"
                options = {"strength": strength, "noise_colour": colour}
                yield from (Case(group, (name,), seed, options) for name in CATALOGUE)
            for k in range(50):
                yield Case(f"clean, φ = {colour:g}", (), 50 * seed + k, {"noise_colour": colour})
        yield from (
            Case("outside the catalogue", (name,), 10 * seed + k)
            for name in UNKNOWN
            for k in range(2)
        )
        yield from (Case("two effects", pair, seed) for pair in PAIRS)
        for group, (_, factors) in CHANGES.items():
            yield from (
                Case(group, (), 10 * seed + k, {"changed": factors, "spread": 0.0})
                for k in range(2)
            )
        if seed - first < max(1, seeds // 2):
            for group, options in VARIANTS.items():
                yield from (Case(group, (name,), seed, options) for name in CATALOGUE)


def judge(case: Case) -> Row:
    """Draw a record, diagnose it from its CSV file, and return the answer and the right one."""
    return _judged(case, _by_the_old_engine)


def judge_new(case: Case) -> Row:
    """Judge a record as `judge` does, by the new engine."""
    return _judged(case, _by_the_new_engine)


def _judged(case: Case, answer: Answering) -> Row:
    from demonstrations import draw, write
    from orchestration.api import read_record
    from orchestration.fmu import find_model

    try:
        drawn = draw(case.hidden, case.seed, **case.options)
    except ValueError as error:
        return asdict(case) | {"impossible": str(error)}
    model = find_model("ppy_actuator")
    with tempfile.TemporaryDirectory() as folder:
        write(drawn, Path(folder) / "record.csv")
        record = read_record(Path(folder) / "record.csv", model)
    hidden = drawn.truth.hidden
    described = {
        "wanted": [h.id + (f"({h.output})" if h.output else "") for h in hidden],
        "alike": any(h.alike for h in hidden),
        "widths": [h.widths for h in hidden],
    }
    return asdict(case) | described | answer(record, model, drawn)


def _by_the_old_engine(record: Record, model: Model, drawn: Drawn) -> Row:
    from orchestration.discrepancy import diagnose
    from orchestration.discrepancy.candidates import catalogue
    from orchestration.discrepancy.data import dataset_of
    from orchestration.fmu.model import catalogue as known_effects
    from orchestration.identify import normalised_rms

    data = dataset_of(record, model, {})
    began, used = clock.perf_counter(), processor_time()
    # what follows in the pipeline, an FMU and an experiment, names nothing
    diagnosis = diagnose(
        model.cls, data, catalogue(model.cls, known_effects(model.cls), data.measured)
    )
    took = {"seconds": clock.perf_counter() - began, "processor": processor_time() - used}
    first = diagnosis.validation.first
    best = {
        o: normalised_rms(y[first:], drawn.truth.outputs[o][first:])
        for o, y in data.measured.items()
    }
    return took | {
        "verdict": diagnosis.verdict,
        "causes": diagnosis.causes,
        "rivals": [[e.effect_name for e in s.alternatives] for s in diagnosis.selection.steps],
        "gains": [s.gain for s in diagnosis.selection.steps],
        "differing": list(diagnosis.changed),
        "ratio": max(error / best[o] for o, error in diagnosis.after.items()),
        "inside": _inside(drawn, diagnosis.estimates),
    }


def _by_the_new_engine(record: Record, model: Model, drawn: Drawn) -> Row:
    from orchestration.diagnosis import diagnose

    began, used = clock.perf_counter(), processor_time()
    diagnosis = diagnose([record], model)
    took = {"seconds": clock.perf_counter() - began, "processor": processor_time() - used}
    named = diagnosis.causes if diagnosis.is_named else ()
    best = [name for cause in named[:1] for name in _names_of(cause.parts[0], cause.members)]
    others = [name for cause in named[1:] for name in _names_of(cause.parts[0], cause.members)]
    more = [_names_of(part) for cause in named[:1] for part in cause.parts[1:]]
    return took | {
        "verdict": diagnosis.verdict,
        "causes": [*best[:1], *(names[0] for names in more)],
        "rivals": [[*best[1:], *others], *(names[1:] for names in more)][: len(more) + bool(best)],
        "gains": [cause.comparison.gain for cause in named[:1]],
        "differing": list(diagnosis.changed),
        "guesses": [[cause.name, cause.probability] for cause in diagnosis.causes],
        "inside": _inside(drawn, diagnosis.parameters),
    }


def _inside(drawn: Drawn, estimates: Mapping[str, Any]) -> dict[str, bool]:
    """Return whether the true values of physical parameters are in their intervals."""
    truth = drawn.truth.parameters
    return {
        n: bool(e.interval[0] <= getattr(truth, n) <= e.interval[1])
        for n, e in estimates.items()
        if n in asdict(truth) and np.isfinite(e.interval).all()
    }


def _names_of(part: Any, members: Iterable[tuple[str, str]] = ()) -> list[str]:
    """Return the effects of the catalogue that a part of a model is; else its own name.

    A law over a signal is an effect of that law over that signal, with a memory where that has
    states of its own, and with its symmetry where that has one; the laws that act alike count.
    """
    from orchestration.diagnosis import Memory, Term
    from orchestration.fmu import find_model
    from orchestration.fmu.model import catalogue

    if not isinstance(part, Term):
        return [str(part)]
    if not part.cause[1]:  # an effect, or a fault of a sensor
        return [part.name]
    laws = {part.cause, *members}
    names = [
        name
        for name, effect in catalogue(find_model("ppy_actuator").cls).items()
        if (effect.term.law, effect.term.signal) in laws
        and bool(effect.layout.states) == (part.memory is not Memory.NONE)
        and _symmetry(effect.term.family or "") in ("", _symmetry_of(part.shape.name))
    ]
    return names or [part.name]


def _symmetry(family: str) -> str:
    return next((word for word in ("even", "odd") if family.startswith(f"{word} part")), "")


def _symmetry_of(shape: str) -> str:
    return "even" if shape in ("SQUARE", "MODULUS") else "odd"


@cache
def _families() -> dict[str, str]:
    """Return effects of the catalogue by name, with what shapes of one cause have in common."""
    from orchestration.fmu import find_model
    from orchestration.fmu.model import catalogue

    return {
        name: effect.term.family or name
        for name, effect in catalogue(find_model("ppy_actuator").cls).items()
    }


def _cause(name: str) -> str:
    return _families().get(name, name)


def right(row: Row, rivals: bool = True, shapes: bool = True) -> bool:
    """Return whether the answer is the right one.

    Parameters
    ----------
    row : dict
        As :func:`judge` gives it.
    rivals : bool
        Whether what the verdict tells as a rival of a cause counts, or only what stands first.
    shapes : bool
        Whether another shape of the same law over the same signal counts.
    """
    cause = _cause if shapes else str
    if row["group"] in CHANGES:
        return row["verdict"] == "recalibrate" and row["differing"][:1] == [
            CHANGES[row["group"]][0]
        ]
    if row["group"] == "outside the catalogue":
        return row["verdict"] == "unexplained"
    if not row["hidden"]:
        return not row["causes"] and row["verdict"] in ("consistent", "recalibrate")
    if len(row["wanted"]) > 1:
        each = zip(row["causes"], row["rivals"], strict=True)
        groups = [{*map(cause, (name, *(others if rivals else ())))} for name, others in each]
        chosen = permutations(groups, len(row["wanted"]))
        return any(
            all(cause(w) in group for w, group in zip(row["wanted"], some, strict=True))
            for some in chosen
        )
    if row["alike"] and not row["causes"]:
        return (
            row["verdict"] == "recalibrate"
        )  # other parameters of the base model do just the same
    named = [*row["causes"][:1], *(row["rivals"][0] if row["causes"] and rivals else ())]
    return cause(row["wanted"][0]) in map(cause, named)


def too_many(row: Row) -> bool:
    """Return whether more causes are named than were hidden, shapes of one counted once."""
    return (
        len({*map(_cause, row["causes"])}) > len(row["hidden"])
        and row["group"] != "outside the catalogue"
    )


def _summary(row: Row) -> str:
    if row.get("impossible"):
        return str(row["impossible"])
    mark = "ok " if right(row) else "NO "
    return f"{mark} {row['verdict']} {row['causes']} {row['rivals']}"


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of what was named."""
    drawn = [row for row in rows if "impossible" not in row]
    groups = sorted({row["group"] for row in drawn})
    parts: list[str | Table] = [
        f"{len(drawn)} records.",
        _rates(drawn, groups),
        _by_effect(drawn, [group for group in groups if "strength" in group]),
        _named_first(drawn),
        *_intervals(drawn),
        _times(drawn),
    ]
    return Topic("What was named", parts)


def _rates(rows: Sequence[Row], groups: Sequence[str]) -> Table:
    """Return how often the hidden effect was named, by group of records."""
    table = []
    for group in groups:
        members = [row for row in rows if row["group"] == group]
        ratios = [row["ratio"] for row in members if "ratio" in row]
        table.append(
            [
                group,
                sum(right(row, rivals=False, shapes=True) for row in members),
                sum(right(row, rivals=False, shapes=False) for row in members),
                sum(map(right, members)),
                sum(map(too_many, members)),
                len(members),
                f"{np.median(ratios):.3f}, {np.quantile(ratios, 0.9):.3f}" if ratios else "-",
            ]
        )
    columns = ["records", "first", "in its shape", "or in the group", "too many", "of"]
    return Table([*columns, "extended model / true model, held out (median, 90 %)"], table)


def _by_effect(rows: Sequence[Row], groups: Sequence[str]) -> Table:
    """Return how often each effect was named, by group of records."""
    single = [
        row for row in rows if len(row["hidden"]) == 1 and row["group"] != "outside the catalogue"
    ]
    table = []
    for name in dict.fromkeys(row["hidden"][0] for row in single):
        own = [row for row in single if row["hidden"][0] == name]
        of = [[row for row in own if row["group"] == group] for group in groups]
        table.append([name, *(f"{sum(map(right, some))}/{len(some)}" for some in [*of, own])])
    return Table(["hidden", *groups, "all"], table)


def _named_first(rows: Sequence[Row]) -> Table:
    """Return what was named first, by what was hidden."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        hidden = " + ".join(row["wanted"]) or row["group"]
        counts[hidden][row["causes"][0] if row["causes"] else row["verdict"]] += 1
    table = [
        [hidden, ", ".join(f"{name}: {count}" for name, count in counts[hidden].most_common())]
        for hidden in sorted(counts)
    ]
    return Table(["hidden", "named first: times"], table)


def _intervals(rows: Sequence[Row]) -> Iterator[str]:
    """Yield sentences on how many parameters lie within their intervals."""
    inside = [hit for row in rows if right(row) for hit in row["inside"].values()]
    yield (
        f"Of {len(inside)} physical parameters of rightly judged records,"
        f" {100 * np.mean(inside):.1f} % lie within their interval. The rig's effects have other"
        " forms than the catalogue's, which moves parameters that trade with them."
    )
    clean_rows = [row for row in rows if row["group"].startswith("clean")]
    clean = [hit for row in clean_rows for hit in row["inside"].values()]
    if clean:
        yield f"On clean records, {100 * np.mean(clean):.1f} % of {len(clean)} do."


def _times(rows: Sequence[Row]) -> str:
    seconds = [row["seconds"] for row in rows]
    used = [row["processor"] for row in rows if "processor" in row]
    sentence = (
        f"A diagnosis took {np.median(seconds):.1f} s (median), {np.quantile(seconds, 0.95):.1f} s"
        " (95 %)"
    )
    if not used:
        return f"{sentence}."
    return f"{sentence}; {np.median(used):.1f} s and {np.max(used):.1f} s of processor time."


def part(wanted: Sequence[Case], new: bool = False) -> Part:
    """Return cases as a part of a study, judged by the old engine or the new one."""
    if new:
        return Part(wanted, judge_new, _summary, report, "new")
    return Part(wanted, judge, _summary, report)


def _parts(chosen: Chosen) -> Iterator[Part]:
    yield part(among(cases(chosen.seeds, chosen.seed), chosen), chosen.new)


STUDY = Study(
    name="naming",
    about=__doc__,
    parts=_parts,
    numbers={"--seeds": (4, "of every variation; 4 are some 900 records")},
    switches={"--new": "by the new engine"},
    page="naming.md",
    head="""# How often the hidden effect is named

How often the hidden effect is named: hundreds of emulated records, a confusion matrix and the rates
that count. Drawn by `python -m studies.judging.naming {options}`, by seeds that were not looked at
before. *First* are those in which the hidden effect, in whatever shape, stands at the top, and *in
its shape* those in which it does so by its own name; *or in the group* adds to the former those in
which the verdict `ambiguous` names it as a rival of the top. *Too many* are records with more
causes than were hidden, shapes of one law over one signal counted once. What is right where none
is hidden is in `studies/judging/naming.py`.

{stamp}

""",
    code=(
        *DIAGNOSIS,
        "studies/judging/naming.py",
        "fmus/ppy_actuator",
        "demonstrations/bench.py",
        "demonstrations/records.py",
        "demonstrations/emulator",
    ),
)


if __name__ == "__main__":
    STUDY.main()
