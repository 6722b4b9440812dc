"""Models and records drawn at random, given to ``diagnose`` and ``laws``; what fails is named.

Nothing may end but with an error that names a fault of what was given; nothing may warn, or print
what is no number. ``python -m tests.support.fuzz_models --seed 7 --cases 2000`` runs the cases of a
seed in processes of their own and prints a line for each finding, which repeats it. ``--shrink``
leaves out of a case what it fails without::

    python -m tests.support.fuzz_models --seed 7 --case 12 --shrink
    python -m tests.support.fuzz_models --seed 7 --case 12 --without "damage 0" "drag 1"
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import random
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.fuzzed_models import FuzzedModel, draw_model, written
from tests.support.fuzzed_records import DAMAGES, FuzzedRecord, draw_record
from tests.support.source import ROOT

LONGEST = 30  # s of processor time of a case, some fifty times its budget
BATCH = 100  # cases of a process
# Refusals that name a fault of what was given. Each was read and judged; any other is a finding.
FAULTS: tuple[str, ...] = (
    r"no column of a signal has any value",
    r"a free run over \S+ leaves all bounds, and follows it if ",
    r"a free run over \S+ leaves all bounds, and so do predictions by an observer",
    r"its \d+ measured values say nothing of any parameter or start state",
    r"this is the same record as \S+; it tells nothing more",
    r"the clock jumps back: row \d+ is at ",
    r"the clock restarts: row \d+ is at .*; split the file before row \d+",
    r"effects: \S+ is of an output that the record does not have",
    r"no output can be both fitted and unseen: ",
    r"row 1: 'time \[s\]' is not a header of several columns",
    r"the input '\w+' has no value in rows \d+ to \d+: \d+ samples \(interpolated are at most",
    r"cannot be simulated over (the record from where it starts|the data held out, as)",
    r"law '\w+' has the name of something that every component has",
    r"the input '\w+' has no value in rows? \d+( to \d+)?, at the \w+ of the record",
    r"only one instant \(row \d+\); a record needs at least two different times",
    r"it lacks an output of the record before",
    r"(--set |settings=).* is out of range; allowed is",
    r"it has none of the outputs of the record",
    r"samples are too few for a diagnosis; \d+ are the least",
    r"no column is an output of",
    r"must be named by an ASCII identifier without an underscore in front",
    r"has the name of something else in the class",
    r"is declared twice; every state brings its '_start' parameter",
    r"values all within \S+ of zero are no measurement",
    r"the model is too unstable along its simulation: within one sample ",
)
_NO_NUMBER = re.compile(r"(?<![\w.])[-+]?(nan|inf)(?![\w.])", re.IGNORECASE)
# notes on what was not judged because of an error of ours, not of what was given
_INTERNAL = re.compile(r"\b[A-Z]\w*(Error|Exception|Warning)\b|singular", re.IGNORECASE)


@dataclass(frozen=True)
class Case:
    """A model, its records and the options of one call.

    Attributes
    ----------
    task : {"diagnose", "laws"}
    model : FuzzedModel
    records : dict of str to FuzzedRecord
        By the name of the file; the first is what is judged.
    options : dict of str to object
        Keyword arguments.
    effects : int
        Seed by which effects are chosen by name; 0 for none.
    command : bool
        Whether it goes through the command line.
    built : bool
        Whether the model is described by its native build.
    """

    task: str
    model: FuzzedModel
    records: dict[str, FuzzedRecord]
    options: dict[str, Any]
    effects: int
    command: bool
    built: bool


def draw_case(seed: int, number: int, without: frozenset[str] = frozenset()) -> Case:
    """Draw a case of a seed, or the same without some of its parts."""

    def drawing(part: str) -> random.Random:
        return random.Random(f"{seed} {number} {part}")

    model = draw_model(drawing("model")).without(without)
    draw = drawing("case")
    damages = draw.sample(DAMAGES, draw.choices((0, 1, 2, 3), (3, 4, 2, 1))[0])
    left = tuple(d for k, d in enumerate(damages) if f"damage {k}" not in without)
    task = draw.choice(("diagnose", "diagnose", "laws"))
    options, effects = _draw_options(draw, drawing("values"), model, task)
    records = {"record.csv": draw_record(drawing("record"), model, left)}
    for option in ("holdout", "compare"):
        if option in options:
            records[f"{option}.csv"] = draw_record(drawing(option), model, left[1:])
    command, built = draw.random() < 0.04, draw.random() < 0.04
    for option in [option for option in options if f"option {option}" in without]:
        del options[option]
        records.pop(f"{option}.csv", None)
    if "option effects" in without:
        effects = 0
    return Case(task, model, records, options, effects, command, built)


def _draw_options(
    draw: random.Random, values: random.Random, model: FuzzedModel, task: str
) -> tuple[dict[str, Any], int]:
    """Draw keyword arguments, and the seed by which effects are chosen."""
    options: dict[str, Any] = {"time": draw.choice((0.1, 0.2, 0.5))}
    parameters = [p.name for p in model.of_kind("Parameter")]
    parameters += [f"{s.name}_start" for s in model.of_kind("State")]
    chance = {name: draw.random() for name in ("hold", "each", "holdout", "set", "more", "effects")}
    seed = draw.getrandbits(30)
    if chance["hold"] < 0.25 and parameters:
        options["hold"] = values.sample(parameters, values.randint(1, len(parameters)))
    if chance["holdout"] < 0.15:
        options["holdout"] = "holdout.csv"
    if chance["each"] < 0.15 and parameters:
        free = [name for name in parameters if name not in options.get("hold", ())]
        options["each"] = values.sample(free, min(len(free), values.randint(1, 2)))
    if chance["set"] < 0.15 and model.of_kind("Parameter"):
        one = values.choice(model.of_kind("Parameter"))
        options["settings"] = {one.name: one.value * 1.5}
    interpolate = draw.choice((None, None, True, False))
    if interpolate is not None:
        options["interpolate"] = interpolate
    if task == "diagnose" and chance["more"] < 0.05:
        options["compare"] = "compare.csv"
    if task == "diagnose" and draw.random() < 0.4:
        options["laws"] = False
    if chance["effects"] < 0.2:
        options["effects"] = ["families"]
    elif chance["effects"] < 0.3:
        options["effects"] = []
    return options, seed if 0.3 <= chance["effects"] < 0.5 else 0


@contextlib.contextmanager
def _limited(seconds: int) -> Iterator[None]:
    def too_long(number: int, frame: Any) -> None:
        raise TimeoutError(f"more than {seconds} s of processor time")

    before = signal.signal(signal.SIGPROF, too_long)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def findings_of(case: Case, folder: Path) -> list[str]:
    """Run a case in a folder; return what is wrong with what came of it."""
    from fmus.kit import UserError

    (folder / "fuzzed.py").write_text(written(case.model), encoding="utf-8")
    for name, record in case.records.items():
        (folder / name).write_text(record.text(), encoding="utf-8")
    findings: list[str] = []
    warned: list[str] = []

    def note(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        frames = _places(traceback.extract_stack()[:-1])
        warned.append(f"warned: {category.__name__}: {message} at {frames}")

    with warnings.catch_warnings(), _limited(LONGEST):
        warnings.simplefilter("always")
        warnings.showwarning = note
        try:
            findings = _answered(case, folder)
        except UserError as error:
            findings = [] if is_fault(str(error)) else [f"refused: {error}"]
        except Exception as error:
            places = _places(traceback.extract_tb(error.__traceback__))
            findings = [f"{type(error).__name__}: {error} at {places}"]
    return findings + warned


def is_fault(message: str) -> bool:
    """Return whether a refusal, of one line, names a fault of what was given."""
    return "\n" not in message and any(re.search(fault, message) for fault in FAULTS)


def _places(frames: Sequence[traceback.FrameSummary]) -> str:
    """Return the innermost places of ours among frames."""
    own = [f for f in frames if str(ROOT) in f[0] and "/site-packages/" not in f[0]]
    ours = [f"{Path(f.filename).name}:{f.lineno}" for f in own]
    return " < ".join(reversed(ours[-3:]))


def _answered(case: Case, folder: Path) -> list[str]:
    """Call what the case is of; return what is wrong with its answer."""
    from orchestration.fmu.model import find_class

    options = dict(case.options)
    for option in ("holdout", "compare"):
        if option in options:
            options[option] = folder / options[option]
    place = f"{folder / 'fuzzed.py'}:Fuzzed"
    if case.effects:
        options["effects"] = _some_effects(find_class(place), random.Random(case.effects))
    if case.command:
        return _printed(case, folder, place, options)
    return _judged(case, folder, place, options)


def _some_effects(cls: Any, draw: random.Random) -> list[str]:
    from orchestration.fmu.model import known_effects

    offered = list(known_effects(cls))
    return draw.sample(offered, min(len(offered), draw.randint(1, 5)))


def _judged(case: Case, folder: Path, place: str, options: dict[str, Any]) -> list[str]:
    """Call a function of Python, and read all that its result offers."""
    import orchestration as ppy
    from orchestration.cli.outputs import write_json
    from orchestration.fmu import find_model

    # of the model itself the Python build is described as well, and needs no compiler
    model = find_model(place, "native" if case.built else "python")
    call: Callable[..., Any] = getattr(ppy, case.task)
    result = call(folder / "record.csv", model, **options)
    findings = []
    text = str(result)
    if case.task == "diagnose":
        findings += [f"note: {note}" for note in result.notes if _INTERNAL.search(note)]
        text = "\n".join([text, *result.notes])
    write_json(folder / "answer.json", result.to_dict())
    json.loads((folder / "answer.json").read_text(encoding="utf-8"), parse_constant=_refuse)
    findings += [
        f"printed: {line.strip()}" for line in text.splitlines() if _NO_NUMBER.search(line)
    ]
    page = result.report(folder / "report.html").read_text(encoding="utf-8")
    if "</html>" not in page:
        findings.append("the report has no end")
    return findings


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is not JSON")


def _printed(case: Case, folder: Path, place: str, options: dict[str, Any]) -> list[str]:
    """Call the command line, in this process."""
    from orchestration.api.declaration import words_of
    from orchestration.api.options import DiagnoseOptions, LawsOptions
    from tests.support.command import here

    declared = DiagnoseOptions if case.task == "diagnose" else LawsOptions
    defaults = {"each": (), "hold": (), "fit": (), "laws": True, "effects": None}
    if case.task == "laws":
        defaults["effects"] = ()
    values = {**defaults, **options}
    if "holdout" in values:
        values["holdout"] = [str(values["holdout"])]
    files = [str(folder / "record.csv"), "--model", place, "--json", "answer.json"]
    words = [case.task, *files, "--report", "page.html", *words_of(declared, values)]
    done = here(*words, cwd=folder)
    if done.returncode == 2:
        error = done.stderr.splitlines()[-1].removeprefix("error: ")
        return [] if is_fault(error) else [f"refused: {error}"]
    if done.returncode or "Traceback" in done.stderr or "Warning" in done.stderr:
        return [f"exit {done.returncode}: {shlex.join(words)}: {done.stderr[-300:]}"]
    json.loads((folder / "answer.json").read_text(encoding="utf-8"), parse_constant=_refuse)
    return []


def run_case(seed: int, number: int, without: frozenset[str] = frozenset()) -> list[str]:
    """Draw a case and run it; return what is wrong with what came of it."""
    with tempfile.TemporaryDirectory() as folder:
        return findings_of(draw_case(seed, number, without), Path(folder))


def kind_of(finding: str) -> str:
    """Return the part of a finding that two cases with one cause have in common."""
    return re.sub(r"[-+]?\d[\d.e+-]*|'[^']*'|\"[^\"]*\"", "#", finding)[:60]


def shrink(seed: int, number: int, finding: str, seconds: float = 120.0) -> frozenset[str]:
    """Return parts that a case fails the same way without, as many as time allows."""
    case = draw_case(seed, number)
    parts = [f"damage {k}" for k in range(3)]
    parts += [f"option {name}" for name in (*case.options, "effects")]
    parts += case.model.parts
    gone: frozenset[str] = frozenset()
    end = time.monotonic() + seconds
    for part in parts:
        if time.monotonic() > end:
            break
        with contextlib.suppress(Exception):
            found = run_case(seed, number, gone | {part})
            if kind_of(finding) in map(kind_of, found):
                gone |= {part}
    return gone


def repeated(seed: int, number: int, without: frozenset[str] = frozenset()) -> str:
    """Return the command that repeats a case."""
    words = ["python", "-m", "tests.support.fuzz_models", "--seed", seed, "--case", number]
    left_out = ["--without", *sorted(without)] if without else []
    return shlex.join(map(str, [*words, *left_out]))


def _run_here(seed: int, first: int, last: int) -> None:
    """Run cases and print a line of JSON for each."""
    for number in range(first, last):
        began = time.process_time()
        findings = run_case(seed, number)
        spent = time.process_time() - began
        print(json.dumps({"case": number, "findings": findings, "seconds": spent}), flush=True)


def _run_apart(seed: int, first: int, last: int) -> Iterator[dict[str, Any]]:
    """Run cases in a process of their own, and go on behind one that ends it."""
    while first < last:
        until = min(first + BATCH, last)
        words = ["--seed", seed, "--from", first, "--to", until]
        command = [sys.executable, "-m", "tests.support.fuzz_models", *map(str, words)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                for line in process.stdout or ():
                    if line.startswith('{"case"'):
                        yield json.loads(line)
                        first += 1
            finally:
                process.kill()
        if first < until:
            finding = f"the process ended with {process.returncode}"
            yield {"case": first, "findings": [finding], "seconds": 0.0}
            first += 1


def main() -> None:
    """Run cases as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=math.inf)
    parser.add_argument("--case", type=int)
    parser.add_argument("--without", nargs="*", default=[])
    parser.add_argument("--shrink", action="store_true")
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--to", dest="last", type=int)
    chosen = parser.parse_args()
    seed: int = chosen.seed
    if chosen.last is not None:
        _run_here(seed, chosen.first, chosen.last)
        return
    if chosen.case is not None:
        without = frozenset(chosen.without)
        case = draw_case(seed, chosen.case, without)
        print(
            written(case.model),
            case.task,
            case.options,
            {n: len(r.text()) for n, r in case.records.items()},
        )
        found = run_case(seed, chosen.case, without)
        print(*found, sep="\n")
        if chosen.shrink and found:
            print(repeated(seed, chosen.case, shrink(seed, chosen.case, found[0])))
        sys.exit(bool(found))
    kinds: Counter[str] = Counter()
    done, slowest = 0, 0.0
    end = time.monotonic() + chosen.seconds
    for answer in _run_apart(seed, chosen.first, chosen.first + chosen.cases):
        done += 1
        slowest = max(slowest, answer["seconds"])
        for finding in dict.fromkeys(answer["findings"]):
            kinds[kind_of(finding)] += 1
            print(f"{repeated(seed, answer['case'])}: {finding}", flush=True)
        if time.monotonic() > end:
            break
    print(
        f"{done} cases, {sum(kinds.values())} findings, slowest {slowest:.1f} s of processor time"
    )
    sys.exit(bool(kinds))


if __name__ == "__main__":
    main()
