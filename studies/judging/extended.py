"""Study of extended models as FMUs: whether they compute what was written, and are asked again.

`python -m studies.judging.extended --records 30 --seed 1` draws records with hidden laws, sensors
and effects, of models of a user and of the actuator, diagnoses each by the command, and builds the
FMU of the extended model. The oracle is the JSON of the diagnosis: the file of a user's model is
run with a stub in place of the kit, on plain numbers, with the written terms added to its laws, and
SciPy integrates it; of effects of a catalogue the model is built by their names, with the written
values. FMPy runs the FMU. Then `info`, `laws`, `diagnose`, `export modelica` and `build` are asked
about the FMU, which have to know the fitted values.
"""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from benchmarks.tables import Table, Topic
from demonstrations import draw, write
from demonstrations.emulator import VARIATIONS
from fmus.kit.arrays import Array
from orchestration.fmu import find_model
from orchestration.records import write_record
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import Chosen, Part, Row, Study, among, share, title
from studies.outside import PLANTS, case_of, draw_outside

_CLOSE = 2e-3  # largest difference of two integrators, in spreads of an output
_DIGITS = 1e-4  # of values in texts
_ACTUATOR = ("hum", "mains_hum", "slip_jumps", "restless_air", "loose_contact", "loose_fixture")
_EFFECTS = tuple(name for name in VARIATIONS if name not in _ACTUATOR)  # that a catalogue knows
_OURS = "fmus/ppy_actuator/model.py:PpyActuator"
_PARAMETER = re.compile(r'parameter \w+ (\w+).* = (-?\d[\d.]*(?:e[-+]?\d+)?) "')  # of Modelica
_SHORT = ("--time", "5s")  # of a search whose answer is not judged
_GROUPS = ("inside", "outside", "two")


@dataclass(frozen=True)
class ExtendedCase:
    """A record to draw: of a plant, or of the actuator with an effect.

    Attributes
    ----------
    seed, number : int
    model, hidden : str
        A plant with a group of its truths, or the actuator with an effect.
    effects : str
        Effects that are asked for by name.
    """

    seed: int
    number: int
    model: str
    hidden: str
    effects: str = ""


def cases(records: int, seed: int) -> list[ExtendedCase]:
    """Draw cases: plants and groups in turn, every third one the actuator with an effect."""
    rng = np.random.default_rng([seed, 31])
    drawn = []
    for number in range(records):
        if number % 3 == 2:
            drawn.append(ExtendedCase(seed, number, "ppy_actuator", str(rng.choice(_EFFECTS))))
            continue
        plant = PLANTS[int(rng.integers(len(PLANTS)))].name
        named = "families" if number % 2 else ""
        drawn.append(ExtendedCase(seed, number, plant, str(rng.choice(_GROUPS)), named))
    return drawn


def judge(case: ExtendedCase) -> Row:
    """Draw a record, diagnose it, and ask about the FMU of the extended model."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = _written(case, folder)
        failures, about = _judged(folder, model, case.effects)
    return asdict(case) | about | {"failures": failures}


def _written(case: ExtendedCase, folder: Path) -> str:
    """Write two records of a case, and return the model."""
    if case.model == "ppy_actuator":
        for k, record in enumerate(("record.csv", "other.csv")):
            seed = 1000 * case.seed + 10 * case.number + k
            write(draw(case.hidden, seed, duration=300.0), folder / record)
        return case.model
    group = next(
        one
        for number in range(100)
        if (one := case_of(1000 * case.seed + case.number, number)).plant == case.model
        and one.group == case.hidden
    )
    drawn = draw_outside(group)
    plant = drawn.plant
    known = find_model(plant.model)
    units = {n: one.unit for n, one in (known.inputs | known.outputs).items()}
    for record, run in (("record.csv", drawn.fitted), ("other.csv", drawn.held_out)):
        columns = dict(zip(plant.inputs, run.inputs.T, strict=True))
        columns |= dict(zip(plant.outputs, run.measured.T, strict=True))
        write_record(folder / record, run.time, columns, {n: units[n] for n in columns})
    return plant.model


def _judged(folder: Path, model: str, effects: str) -> tuple[list[str], Row]:
    ask = partial(_ask, folder)
    failures: list[str] = []
    more = ["--effects", effects] if effects else []
    written = ["--fmu", "x.fmu", "--json", "d.json"]
    made = ask("diagnose", "record.csv", "--model", model, *written, *more)
    if made.returncode:
        return [f"diagnose: {made.stderr.strip()[-300:]}"], {"verdict": "", "causes": []}
    told = _read(folder / "d.json")
    about = {
        "verdict": told["verdict"],
        "causes": [part["effect"] for part in told["causes"]],
        "parts": [_part_text(part) for part in _parts_of(told)],
        "next": told["next_step"],
    }
    if "--fmu" in told["next_step"]:
        failures.append(f"the advice was just followed: {told['next_step']}")
    values = {n.partition("@")[0]: p["value"] for n, p in told["parameters"].items()}
    for words, check in _questions(folder, values):
        answer = ask(*words)
        if answer.returncode:
            failures.append(f"{' '.join(words)}: {answer.stderr.strip()[-300:]}")
            continue
        if "laws" in answer.stderr and "changed" in answer.stderr:
            failures.append(f"{' '.join(words)}: {answer.stderr.strip()[-300:]}")
        failures += [f"{' '.join(words[:2])}: {text}" for text in check()]
    try:
        difference, by = _difference(folder, model, told)
    except Exception as error:
        return [*failures, f"oracle: {type(error).__name__}: {error}"], about
    if not difference < _CLOSE:
        failures.append(f"{by}: the FMU is {difference:.2g} spreads away")
    return failures, about | {"by": by, "difference": difference}


def _ask(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "orchestration.cli", *words]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )


def _read(path: Path) -> dict[str, Any]:
    read: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return read


def _parts_of(told: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the terms of the first cause, without readings of the file."""
    parts = [part for cause in told["causes"] for part in (cause, *cause["with"])]
    return [part for part in parts if "reading" not in part]


def _part_text(part: Mapping[str, Any]) -> str:
    return f"{part['law']}({part['signal']}) {part['shape']} {part['memory']}".strip()


def _questions(
    folder: Path, values: Mapping[str, float]
) -> Iterator[tuple[list[str], Callable[[], list[str]]]]:
    """Yield commands about the FMU, each with a check of what it wrote."""
    yield (
        ["info", "x.fmu", "--json", "i.json"],
        lambda: _wrong_values(
            {p["name"]: p["start"] for p in _read(folder / "i.json")["parameters"]}, values
        ),
    )
    for command in ("laws", "diagnose"):
        words = [command, "other.csv", "--model", "x.fmu", "--json", f"{command}.json", *_SHORT]
        yield words, partial(_wrong_nominals, folder / f"{command}.json", values)
    yield (
        ["export", "modelica", "x.fmu", "--out", "m"],
        lambda: _wrong_values(_declared(folder / "m"), values),
    )
    yield ["build", "x.fmu", "--out", "b"], lambda: []


def _wrong_values(found: Mapping[str, Any], values: Mapping[str, float]) -> list[str]:
    return [
        f"{name} is {found.get(name)} instead of {value}"
        for name, value in values.items()
        if not math.isclose(float(found.get(name) or 0.0), value, rel_tol=_DIGITS, abs_tol=1e-12)
    ]


def _wrong_nominals(path: Path, values: Mapping[str, float]) -> list[str]:
    told = _read(path)
    nominal = {n: p["nominal"] for n, p in told["parameters"].items()}
    return _wrong_values(nominal, {n: v for n, v in values.items() if n in nominal})


def _declared(folder: Path) -> dict[str, float]:
    """Return values of parameters in files of Modelica."""
    found = {}
    for file in folder.rglob("*.mo"):
        text = file.read_text(encoding="utf-8")
        for name, value in re.findall(
            r'parameter \w+ (\w+).* = (-?\d[\d.]*(?:e[-+]?\d+)?) "', text
        ):
            found[name.removesuffix("_")] = float(value)  # of a name that is a word of Modelica
    return found


# --- the oracle ----------------------------------------------------------------------------------


def _difference(folder: Path, model: str, told: Mapping[str, Any]) -> tuple[float, str]:
    """Return the largest difference of the FMU from what is written, in spreads, and by whom."""
    values = {n.partition("@")[0]: p["value"] for n, p in told["parameters"].items()}
    record = np.genfromtxt(folder / "record.csv", delimiter=",", names=True)
    header = (folder / "record.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    columns = {
        title_.partition("[")[0].strip(): record[name]
        for title_, name in zip(header, record.dtype.names, strict=True)
    }
    parts = _parts_of(told)
    if all(_is_written(part) for part in parts):
        oracle, by = _integrated(model, parts, values, columns), "SciPy"
    else:
        if any(_is_written(part) for part in parts):
            return 0.0, "nobody: effects beside laws"
        oracle, by = _built_by_name(folder, model, parts, values, columns), "build --with"
    found = _simulated(folder / "x.fmu", columns, {}, tuple(oracle))
    worst = 0.0
    for name, course in oracle.items():
        spread = float(np.std(course)) or 1.0
        worst = max(worst, float(np.abs(found[name] - course).max()) / spread)
    return worst, by


def _simulated(
    path: Path, columns: Mapping[str, Array], start: Mapping[str, float], outputs: Sequence[str]
) -> dict[str, Array]:
    """Run an FMU over the inputs of a record by FMPy."""
    description = fmpy.read_model_description(str(path))
    inputs = [v.name for v in description.modelVariables if v.causality == "input"]
    outputs = outputs or [
        v.name for v in description.modelVariables if v.causality == "output" and v.name in columns
    ]
    known = {v.name for v in description.modelVariables}
    missing = set(start) - known
    if missing:
        raise ValueError(f"{path.name} has no {', '.join(sorted(missing))}")
    time = columns["time"]
    rows = [*zip(time, *(columns[name] for name in inputs), strict=True)]
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=float(time[-1]),
        step_size=float(time[1] - time[0]),
        output_interval=float(time[1] - time[0]),
        input=np.array(rows, dtype=[("time", float), *((name, float) for name in inputs)]),
        start_values=dict(start),
        output=list(outputs),
        fmi_type="CoSimulation",
    )
    return {name: result[name][: len(time)] for name in outputs}


def _built_by_name(
    folder: Path,
    model: str,
    parts: Sequence[Mapping[str, Any]],
    values: Mapping[str, float],
    columns: Mapping[str, Array],
) -> dict[str, Array]:
    """Build a model with effects by their names, and run it with the written values."""
    effects = [part["effect"] for part in parts]
    words = ["--with", ",".join(effects)] if effects else []
    made = _ask(folder, "build", model, *words, "--runtime", "native", "--out", "named")
    if made.returncode:
        raise ValueError(made.stderr.strip()[-300:])
    (path,) = (folder / "named").rglob("*.fmu")
    return _simulated(path, columns, values, ())


_SHAPES: dict[str, Callable[[float, float, float], float]] = {
    "a": lambda x, w, s: 1.0,
    "a x": lambda x, w, s: x,
    "a |x|": lambda x, w, s: abs(x),
    "a x^2": lambda x, w, s: x**2,
    "a x |x|": lambda x, w, s: x * abs(x),
    "a x^3": lambda x, w, s: x**3,
    "a sign(x) sqrt(|x|/s)": lambda x, w, s: x / math.sqrt((abs(x) + 0.02 * s) * s),
    "a tanh(x/w)": lambda x, w, s: math.tanh(x / w),
    "a (x - clip(x, -w, w))": lambda x, w, s: x - min(max(x, -w), w),
    "a max(x - w, 0)": lambda x, w, s: max(x - w, 0.0),
    "a min(x + w, 0)": lambda x, w, s: min(x + w, 0.0),
    "a (exp(x/w) - 1)": lambda x, w, s: math.expm1(min(x / w, 30.0)),
    "a (1 - exp(-x/w))": lambda x, w, s: -math.expm1(min(-x / w, 30.0)),
    "a sinh(x/w)": lambda x, w, s: math.sinh(min(max(x / w, -30.0), 30.0)),
    "a step(x - w)": lambda x, w, s: 0.5 + 0.5 * math.tanh((x - w) / (0.004 * s)),
}


def _formula(part: Mapping[str, Any]) -> str:
    """Return the formula of a part without its factor, with x for the signal from its middle on."""
    text = str(part["shape"]).removesuffix(f" {part['factor']}" if part["factor"] else "")
    return re.sub(r"\(x - -?[\d.e+-]+\)", "x", text) if part["middle"] else text


def _is_written(part: Mapping[str, Any]) -> bool:
    return _formula(part) in (*_SHAPES, "a curve")


class _Written:
    """A term as it is written in the JSON: its memory, and what it adds."""

    def __init__(self, part: Mapping[str, Any]):
        self.law, self.signal, self.factor = part["law"], part["signal"], part["factor"]
        self.memory = part["memory"]
        values = {name: one["value"] for name, one in part["parameters"].items()}
        ends = ("width", "time", "ratio", "rate", "way")
        names = {name.rpartition("_")[2]: value for name, value in values.items()}
        self._of = {end: names[end] for end in ends if end in names}
        self._middle, self._scale = part["middle"], part["scale"]
        self._shape = _SHAPES.get(_formula(part))
        if self._shape is None:
            self._curve = _smooth(part["places"], [*values.values()][: len(part["places"])])
            self._middle, self._amount = 0.0, 1.0
        else:
            self._amount = next(iter(values.values()))

    @property
    def is_sampled(self) -> bool:
        """True if it follows its signal at the samples."""
        return self.memory in ("play", "dahl", "backlash")

    def start(self, now: float) -> float:
        """Return what it remembers at the start: a lag is at rest, a Dahl element is, too."""
        kinds = ("lag", "fading", "two_lags", "rate_limit", "play", "backlash")
        return now if self.memory in kinds else 0.0

    def rate(self, now: float, kept: float) -> float:
        """Return the rate of what it remembers."""
        of = self._of
        if self.memory in ("lag", "fading"):
            return (now - kept) / of["time"]
        if self.memory == "two_lags":
            return (now - kept) / of["time"] / (of["ratio"] if now < kept else 1.0)
        if self.memory == "rate_limit":
            return of["rate"] * math.tanh((now - kept) / of["time"] / of["rate"])
        if self.memory == "heat":
            return (now**2 - kept) / of["time"]
        if self.memory in ("integral", "throughput"):
            return now if self.memory == "integral" else abs(now)
        return 0.0

    def followed(self, now: float, before: float, kept: float) -> float:
        """Return what a sampled memory keeps after its signal has moved."""
        way = self._of["way"]
        if self.memory in ("play", "backlash"):
            return min(max(kept, now - way), now + way)
        end = math.copysign(way, now - before)
        return end + (kept - end) * math.exp(-abs(now - before) / way)

    def value(self, now: float, kept: float, factor: float) -> float:
        """Return what is added to the law."""
        behind = self.memory in ("fading", "two_lags", "rate_limit", "backlash")
        seen = now - kept if behind else kept if self.memory else now
        x = seen - self._middle
        if self._shape is None:
            return factor * float(self._curve(x))
        return factor * self._amount * self._shape(x, self._of.get("width", 1.0), self._scale)


def _smooth(places: Sequence[float], values: Sequence[float]) -> Callable[[float], float]:
    """Return cubics between knots, with slopes of parabolas, of chords at both ends."""
    x, y = np.array(places), np.array(values)
    inside = CubicHermiteSpline(x, y, np.gradient(y, x))
    return lambda at: float(inside(min(max(at, x[0]), x[-1])))


class _Declared:
    """A variable of a stubbed kit."""

    def __init__(self, *arguments: Any, **more: Any):
        first = arguments[0] if arguments and not isinstance(arguments[0], str) else 0.0
        self.start, self.rate = more.get("start", first), more.get("rate")


_PORT = "replace(_CHAIN,"  # a port of power as another, which says nothing of laws
_KINDS = ("Input", "Parameter", "State", "Constant", "PowerPort", "Preset")
_KIT = {kind: type(kind, (_Declared,), {}) for kind in _KINDS} | {
    "Component": object,
    "Output": lambda *arguments, **more: lambda law: law,
    "sqrt": math.sqrt,
    "maximum": max,
    "minimum": min,
}


def _numbers_of(model: str) -> type:
    """Run the file of a model with a stub in place of the kit: its laws compute with numbers."""
    file, _, name = (_OURS if model == "ppy_actuator" else model).partition(":")
    text = Path(file).read_text(encoding="utf-8")
    imported = re.search(r"^from (?:fmus|\.)\.kit import .+$", text, re.M)
    assert imported is not None
    names: dict[str, Any] = dict(_KIT)
    text = text.replace(imported[0], "").replace(
        "replace(_CHAIN,", "(lambda *a, **k: None)(_CHAIN,"
    )
    exec(text, names)
    made: type = names[name]
    return made


class _Model:
    """A model of numbers with written terms added to its laws."""

    def __init__(self, cls: type, terms: Sequence[_Written], values: Mapping[str, float]):
        self._cls, self._terms = cls, terms
        kept = {n: v for one in reversed(cls.__mro__) for n, v in vars(one).items()}
        declared = {n: v for n, v in kept.items() if isinstance(v, _Declared)}
        kinds = {n: type(v).__name__ for n, v in declared.items()}
        self.inputs = [n for n, kind in kinds.items() if kind == "Input"]
        self.states = {n: str(declared[n].rate) for n, kind in kinds.items() if kind == "State"}
        self._plain = {
            n: values.get(n, v.start)
            for n, v in declared.items()
            if kinds[n] in ("Parameter", "Constant")
        }
        self.start = [values.get(f"{n}_start", declared[n].start) for n in self.states]

    def plain(self, x: Sequence[float], u: Mapping[str, float], t: float) -> Any:
        """Return an instance without terms."""
        one = self._cls()
        vars(one).update(self._plain | dict(u) | dict(zip(self.states, x, strict=False)))
        one.time = t
        return one

    def has_law(self, name: str) -> bool:
        """Return whether a name is one of a law or an output."""
        return callable(getattr(self._cls, name, None)) and name not in self.inputs

    def signal(self, one: Any, name: str) -> float:
        """Return the value of a signal without terms."""
        if not name:
            return 0.0
        value = getattr(one, name)
        return float(value() if callable(value) else value)

    def with_terms(self, one: Any, kept: Sequence[float]) -> Any:
        """Return an instance whose laws have the terms added."""
        better = self._cls()
        vars(better).update(vars(one))
        added: dict[str, float] = {}
        for term, own in zip(self._terms, kept, strict=True):
            now = self.signal(one, term.signal)
            factor = self.signal(one, term.factor) if term.factor else 1.0
            added[term.law] = added.get(term.law, 0.0) + term.value(now, own, factor)
        for law, addition in added.items():
            own_law = getattr(better, law)
            setattr(better, law, _added(own_law, addition))
        return better

    def rates(self, t: float, w: Sequence[float], u: Mapping[str, float]) -> list[float]:
        """Return the rates of states and memories."""
        n = len(self.states)
        one = self.plain(w[:n], u, t)
        better = self.with_terms(one, w[n:])
        own = [float(getattr(better, rate)()) for rate in self.states.values()]
        pairs = zip(self._terms, w[n:], strict=True)
        return [*own, *(term.rate(self.signal(one, term.signal), kept) for term, kept in pairs)]

    def shown(
        self, w: Sequence[float], u: Mapping[str, float], t: float, outputs: Sequence[str]
    ) -> list[float]:
        """Return outputs by name, with states and memories, before the inputs change."""
        n = len(self.states)
        better = self.with_terms(self.plain(w[:n], u, t), w[n:])
        return [float(getattr(better, name)()) for name in outputs]


def _added(law: Callable[..., float], addition: float) -> Callable[..., float]:
    return lambda *arguments: law(*arguments) + addition


def _integrated(
    model: str,
    parts: Sequence[Mapping[str, Any]],
    values: Mapping[str, float],
    columns: Mapping[str, Array],
) -> dict[str, Array]:
    """Integrate a model with written terms over the inputs of a record, held, by SciPy."""
    terms = [_Written(part) for part in parts]
    made = _Model(_numbers_of(model), terms, values)
    outputs = [name for name in columns if made.has_law(name)]
    time = columns["time"] - columns["time"][0]
    held = [{name: float(columns[name][k]) for name in made.inputs} for k in range(len(time))]
    first = made.plain(made.start, held[0], 0.0)
    before = [made.signal(first, term.signal) for term in terms]
    w = [*made.start, *(term.start(now) for term, now in zip(terms, before, strict=True))]
    n = len(made.states)
    rows = [made.shown(w, held[0], 0.0, outputs)]
    for k in range(len(time) - 1):
        rates = partial(made.rates, u=held[k])
        solved = solve_ivp(rates, time[k : k + 2], w, rtol=1e-8, atol=1e-10)
        w = [*solved.y[:, -1]]
        one = made.plain(w[:n], held[k + 1], time[k + 1])
        for i, term in enumerate(terms):
            now = made.signal(one, term.signal)
            if term.is_sampled:
                w[n + i] = term.followed(now, before[i], w[n + i])
            before[i] = now
        rows.append(made.shown(w, held[k], time[k + 1], outputs))
    return dict(zip(outputs, np.array(rows).T, strict=True))


def report(rows: Sequence[Row]) -> Topic:
    """Return how many FMUs hold, and the failures."""
    right = sum(not row["failures"] for row in rows)
    table = [
        [
            title(row, ExtendedCase),
            row["verdict"],
            "; ".join(row.get("parts", [])),
            row.get("by", ""),
        ]
        for row in rows
    ]
    parts: list[str | Table] = [
        f"{share(right, len(rows))} of {len(rows)} FMUs hold.",
        Table(["record", "verdict", "added", "by"], table),
    ]
    wrong = [[title(r, ExtendedCase), "; ".join(r["failures"])] for r in rows if r["failures"]]
    if wrong:
        parts.append(Table(["record", "failures"], wrong))
    return Topic("Extended models", parts)


def _parts(chosen: Chosen) -> Iterator[Part]:
    wanted = among(cases(chosen.records, chosen.seed), chosen)

    def line(row: Row) -> str:
        return f"{row['verdict']} {row['causes']}: {'; '.join(row['failures']) or 'holds'}"

    yield Part(wanted, judge, line, report)


STUDY = Study(
    name="extended",
    about=__doc__,
    parts=_parts,
    numbers={"--records": (30, "records")},
    code=(*DIAGNOSIS, "studies/judging/extended.py"),
)


if __name__ == "__main__":
    STUDY.main()
