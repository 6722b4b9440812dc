"""Sweeps of one FMU beside batches written by hand, with two workers, and with many cases."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import orchestration as ppy
from orchestration.fmu.model import Model
from tests.support import hosts

from . import by_hand
from .stepping import NATIVE, YARDSTICK
from .tables import Cell, Table, Topic
from .timing import Times

EACH = "fmpy.simulate_fmu for each case"
REUSE = "one instance, by hand in Python"
FMU = "ppy sweep, FMU"
COMPILED = "ppy sweep, compiled"
ENGINES = {FMU: "fmu", COMPILED: "compiled"}
SHARE = 20  # the first runs one case for so many of the others: to begin costs it nothing
TARGETS = ((FMU, EACH, 20.0), (FMU, REUSE, 8.0), (COMPILED, EACH, 100.0))
TWO_WORKERS = 1.8
KEEP = ("last", "smallest", "largest")
# outputs without feedthrough: fmpy reads them before it sets the input of the same point, not after
_SUBJECTS = {
    NATIVE: ("C", 5.0, 10.0, "current", "displacement"),
    YARDSTICK: ("tau", 0.5, 4.0, "u", "x"),
}
_STEP = 0.01  # s


def measure(quick: bool = False) -> Topic:
    """Time the cases of both FMUs in every way; then workers, memory and a large sweep."""
    cases, points, rounds = (20, 51, 1) if quick else (1000, 1001, 2)
    many, by_fmu, whole = (40, 40, 80) if quick else (40_000, 400_000, 100_000)
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        paths = {NATIVE: "ppy_actuator", YARDSTICK: str(hosts.build_one_state_fmu(folder))}
        measured = {
            name: _time(name, model, cases, points, rounds) for name, model in paths.items()
        }
        beside = [_beside(FMU, paths[YARDSTICK], YARDSTICK, by_fmu, points, rounds)]
        beside += [
            _beside(COMPILED, paths[NATIVE], NATIVE, n, points, rounds) for n in (cases, many)
        ]
    rows: list[list[Cell]] = [
        [
            f"{name}: {way}",
            1e6 * times.best(way),
            *(_slower(times, other, way) for other in (EACH, REUSE)),
        ]
        for name, times in measured.items()
        for way in times.seconds
    ]
    spent = _seconds(NATIVE, "ppy_actuator", COMPILED, whole, points)
    return Topic(
        "Sweeps",
        [
            (
                f"Processor time of a case of {points - 1:,} steps with one input set at every"
                f" point, of {cases:,} cases with other values of a parameter, of which the last,"
                " smallest and largest value of an output are kept; with all that it takes to"
                " begin. By hand: `fmpy.simulate_fmu` in a loop, and a loop that unpacks once,"
                " resets one instance and calls the functions of the FMU with arguments made ready"
                " beforehand. One process each; that the numbers agree to 1e-9 was verified."
            ),
            _told(measured),
            Table(
                [
                    "FMU and way",
                    "best, µs",
                    *(f"{way}: times as long, median" for way in (EACH, REUSE)),
                ],
                rows,
            ),
            (
                f"Two workers beside one (target {TWO_WORKERS:g} times as fast). Each needs a core"
                " of its own. Of compiled code they are threads; of an FMU processes, each with an"
                " interpreter that has to start first."
            ),
            Table(
                ["", "cases", "one worker, s", "two workers, s", "times as fast, median"], beside
            ),
            (
                f"{whole:,} cases of {NATIVE}, compiled, one worker: {spent:.3g} s,"
                f" {whole / spent:,.0f} cases a second. Memory of the process at its largest, by"
                " the number of cases of ten steps:"
            ),
            Table(
                ["cases", "largest, MB"],
                [[n, _memory(n)] for n in ((10, 40) if quick else (1000, 100_000))],
            ),
        ],
    )


def _slower(times: Times, other: str, way: str) -> float | str:
    return times.median_ratio(other, way) if other in times.seconds else ""


def _told(measured: dict[str, Times]) -> str:
    told = []
    for name, times in measured.items():
        for way, other, target in TARGETS:
            if way in times.seconds:
                ratio = times.median_ratio(other, way)
                result = "met" if ratio >= target else "missed"
                told.append(
                    f"{name}: {way} {ratio:.3g} times as fast as {other} (target {target:g},"
                    f" {result})"
                )
    return "; ".join(told) + "."


def _batch(name: str, path: Path, cases: int, points: int) -> by_hand.Batch:
    """Cases of a subject: its parameter over a range, its input a sine."""
    parameter, low, high, driven, output = _SUBJECTS[name]
    clock = _STEP * np.arange(points)
    values = np.linspace(low, high, cases).tolist()
    return by_hand.Batch(path, parameter, values, clock, driven, np.sin(clock), output)


def _time(name: str, model: str, cases: int, points: int, rounds: int) -> Times:
    """Measure processor seconds for a case, in turns; each way has one process and never waits."""
    found_model = ppy.find_model(model)
    batch = _batch(name, found_model.path, cases, points)
    few = replace(batch, values=batch.values[::SHARE])
    ways: dict[str, Callable[[], NDArray[np.float64]]] = {
        EACH: partial(by_hand.simulate_each, few),
        REUSE: partial(by_hand.reuse_one, batch),
    }
    for way, engine in ENGINES.items():
        if engine == "fmu" or model == "ppy_actuator":
            ways[way] = partial(_swept, found_model, batch, engine)
    seconds = {way: np.empty(rounds) for way in ways}
    for k in range(-1, rounds):  # the first does not count
        found = {}
        for way in list(ways)[k % len(ways) :] + list(ways)[: k % len(ways)]:
            begin = time.process_time()
            found[way] = ways[way]()
            seconds[way][k] = (time.process_time() - begin) / len(found[way])
        check_agreement(
            {way: numbers if way == EACH else numbers[::SHARE] for way, numbers in found.items()}
        )
    return Times(seconds)


def check_agreement(found: dict[str, NDArray[np.float64]]) -> None:
    """Refuse to time what does not come to the same numbers (cases, 3)."""
    for way, numbers in found.items():
        if not np.allclose(numbers, found[EACH], rtol=1e-9, atol=0.0):
            raise RuntimeError(f"{way}: not the numbers of {EACH}")


def _swept(
    model: Model | str, batch: by_hand.Batch, engine: str, workers: int = 1
) -> NDArray[np.float64]:
    """Run them as a user does; last, smallest and largest (cases, 3)."""
    found = ppy.sweep(
        model,
        {batch.parameter: batch.values},
        {batch.name: batch.given},
        time=batch.time,
        outputs=[batch.output],
        keep=KEEP,
        engine=engine,
        workers=workers,
    )
    return np.column_stack([found[f"{batch.output}_{kept}"].values for kept in KEEP])


def _seconds(name: str, model: str, way: str, cases: int, points: int, workers: int = 1) -> float:
    batch = _batch(name, Path(model), cases, points)
    begin = time.perf_counter()
    _swept(model, batch, ENGINES[way], workers)
    return time.perf_counter() - begin


def _beside(way: str, model: str, name: str, cases: int, points: int, rounds: int) -> list[Cell]:
    """One worker and two, in turns."""
    seconds = {workers: np.empty(rounds) for workers in (1, 2)}
    for k in range(rounds):
        for workers in (1, 2) if k % 2 else (2, 1):
            seconds[workers][k] = _seconds(name, model, way, cases, points, workers)
    times = Times({str(workers): spent for workers, spent in seconds.items()})
    return [f"{name}: {way}", cases, times.best("1"), times.best("2"), times.median_ratio("1", "2")]


def _memory(cases: int) -> float:
    """Largest memory in MB of a process that runs so many short cases."""
    program = f"from benchmarks.sweeping import _short; _short({cases})"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def _short(cases: int) -> None:
    _seconds(NATIVE, "ppy_actuator", COMPILED, cases, 11)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
