"""Processor time of a diagnosis over a distribution of records, and where it is spent."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from pathlib import Path
from time import process_time, thread_time
from typing import Any

import numpy as np

from .tables import Cell, Table, Topic

RATE = 10.0  # Hz
MINUTES = 20.0  # of which the second half is held out
SEED = 9_100  # of the first record
QUICK = 2  # records, of two minutes
STAGES = ("start", "compile", "score", "fit", "judge", "rest")
# what belongs to a stage, less what of it belongs to another
FUNCTIONS = {
    "compile": (("fmus.kit.record.compiled", "CompiledModel.__init__"),),
    "score": (
        ("orchestration.discrepancy.selection.scoring", "score"),
        ("orchestration.discrepancy.selection.scoring", "screen"),
        ("orchestration.discrepancy.selection.scoring", "confounding"),
    ),
    "fit": (
        ("orchestration.identify.fitting.prediction_error", "fit_prediction_error"),
        ("orchestration.identify.fitting.prediction_error", "fit_free_run"),
    ),
    "judge": (
        ("orchestration.discrepancy.residuals.analysis", "analyse_residuals"),
        ("orchestration.discrepancy.residuals.analysis", "has_structure"),
        ("orchestration.discrepancy.validation.confirmation", "confirm"),
    ),
}


def measure(quick: bool = False, count: int = 46) -> Topic:
    """Diagnose records of an emulated rig with one hidden effect each, a process each."""
    from demonstrations.emulator import CATALOGUE

    names = list(CATALOGUE)
    splits = []
    for k in range(QUICK if quick else count):
        strength = (1.0, 0.3)[k // len(names) % 2]
        minutes = 2.0 if quick else MINUTES
        with tempfile.TemporaryDirectory() as folder:
            if _drawn(Path(folder), names[k % len(names)], SEED + k, strength, minutes):
                splits.append(_diagnosed(Path(folder), 1 if quick else 2))
    text = (
        f"{len(splits)} records of ten minutes at {RATE:g} Hz, and as much held out, of an emulated"
        " rig, each with another hidden effect, half of them weak. Processor time of a process,"
        " start of the interpreter included, compiled models in the cache."
    )
    columns = ["s of processor time", *STAGES, "in all"]
    rows = [_row("median", splits, 50.0), _row("worst", splits, 100.0)]
    return Topic("Where the time of a diagnosis goes", [text, Table(columns, rows)])


def _drawn(folder: Path, hidden: str, seed: int, strength: float, minutes: float) -> bool:
    """Draw a record, and write its halves as files; False if it cannot be of that strength."""
    from demonstrations import draw, write

    try:
        drawn = draw(hidden, seed, strength=strength, duration=60.0 * minutes, rate=RATE)
    except ValueError:
        return False
    half = drawn.time.size // 2
    for part, name in ((slice(half), "record"), (slice(half, None), "holdout")):
        inputs, outputs = (
            {n: values[part] for n, values in signals.items()}
            for signals in (drawn.inputs, drawn.outputs)
        )
        clock = drawn.time[part] - drawn.time[part][0]
        write(replace(drawn, time=clock, inputs=inputs, outputs=outputs), folder / f"{name}.csv")
    return True


def _diagnosed(folder: Path, runs: int) -> dict[str, float]:
    """Diagnose in a process of its own, so often; return the split of the last run."""
    command = f"from benchmarks.diagnosing_split import once; once({str(folder)!r})"
    for _ in range(runs):  # whatever has to be compiled is compiled in the first
        done = subprocess.run(
            [sys.executable, "-c", command], check=True, capture_output=True, text=True
        )
    split: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return split


def _row(name: str, splits: list[dict[str, float]], percentile: float) -> list[Cell]:
    """Return a percentile of every stage, and of their sum."""
    whole = [sum(split.values()) for split in splits]
    stages = [float(np.percentile([s[stage] for s in splits], percentile)) for stage in STAGES]
    return [name, *stages, float(np.percentile(whole, percentile))]


def once(folder: str) -> None:
    """Diagnose a record by another; print the processor time of every stage as JSON."""
    from orchestration.api import read_record
    from orchestration.discrepancy.pipeline import DiagnosisOptions, diagnose_only
    from orchestration.fmu import find_model
    from orchestration.rig import RIG_COMPONENT

    model = find_model(RIG_COMPONENT)
    watch = Stopwatch()
    for stage, functions in FUNCTIONS.items():
        for module, name in functions:
            watch.attach(stage, module, name)
    record, holdout = (read_record(Path(folder) / f"{n}.csv", model) for n in ("record", "holdout"))
    start = process_time()
    diagnose_only(record, model, holdout, DiagnosisOptions(time=float("inf")))
    whole = process_time() - start
    known = {stage: watch.seconds[stage] for stage in FUNCTIONS}
    print(json.dumps({"start": start, **known, "rest": whole - sum(known.values())}))


class Stopwatch:
    """The processor time of functions by stage, each less what it calls of another.

    Attributes
    ----------
    seconds : dict of str to float
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._inner = threading.local()
        self._lock = threading.Lock()

    def attach(self, stage: str, module: str, name: str) -> None:
        """Measure a function, or a method, wherever a module has it by name."""
        from importlib import import_module

        home: Any = import_module(module)
        *owner, last = name.split(".")
        for part in owner:
            home = getattr(home, part)
        original = getattr(home, last)
        measured = self._measured(stage, original)
        setattr(home, last, measured)
        for other in list(sys.modules.values()):
            if getattr(other, "__dict__", {}).get(last) is original:
                setattr(other, last, measured)

    def _measured(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def measured(*arguments: Any, **named: Any) -> Any:
            before = getattr(self._inner, "spent", 0.0)
            self._inner.spent = 0.0
            began = thread_time()
            try:
                return function(*arguments, **named)
            finally:
                whole = thread_time() - began
                with self._lock:
                    self.seconds[stage] += whole - self._inner.spent
                self._inner.spent = before + whole

        return measured
