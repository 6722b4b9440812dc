"""Sweeps of one FMU beside batches written by hand, with two workers, and with many cases."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import fmpy
import numpy as np

import orchestration as ppy
from fmus.kit.arrays import Array
from tests.support import hosts

from .stepping import NATIVE, YARDSTICK
from .tables import Table
from .timing import Duration, comparison, in_a_process, take_turns, timed

EACH = "fmpy.simulate_fmu for each case"
ENGINES = {"ppy sweep, FMU": "fmu", "ppy sweep, compiled": "compiled"}
TARGETS = {"ppy sweep, FMU": 1 / 20, "ppy sweep, compiled": 1 / 100}
SHARE = 20  # the first runs one case for so many of the others: to begin costs it nothing
KEEP = ("last", "smallest", "largest")
# parameter, its range, input and output; outputs without feedthrough, as fmpy reads them before it
# sets the input of the same point
_SUBJECTS = {
    NATIVE: ("C", 5.0, 10.0, "current", "displacement"),
    YARDSTICK: ("tau", 0.5, 4.0, "u", "x"),
}
_STEP = 0.01  # s


def sweeps(quick: bool) -> Iterator[str | Table]:
    """Time the cases of two FMUs by every method; then workers, and memory."""
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        paths = {NATIVE: "ppy_actuator", YARDSTICK: str(hosts.build_one_state_fmu(folder))}
        yield "Processor time of a case:"
        yield _by_method(paths, quick)
        yield "Two workers beside one; threads of compiled code, processes of an FMU:"
        yield _by_workers(paths, quick)
    yield "Largest memory of a process, compiled code, by the number of cases of ten steps:"
    run = partial(in_a_process, _sweep, paths[NATIVE], NATIVE, "compiled")
    counts = (10, 40) if quick else (1000, 100_000)
    yield Table(["cases", "largest, GB"], [[count, run(count, 11)[1]] for count in counts])


def _by_method(paths: dict[str, str], quick: bool) -> Table:
    cases, points, rounds = (20, 51, 1) if quick else (1000, 1001, 2)
    durations: dict[str, Duration] = {}
    for name, path in paths.items():
        durations |= _methods(name, path, cases, points)
    against = {name: f"{name.partition(': ')[0]}: {EACH}" for name in durations}
    targets = {f"{name}: {method}": TARGETS[method] for name in paths for method in TARGETS}
    return comparison(take_turns(durations, rounds), against, targets=targets)


def _by_workers(paths: dict[str, str], quick: bool) -> Table:
    few, many, by_fmu = (20, 40, 40) if quick else (1000, 40_000, 400_000)
    durations: dict[str, Duration] = {}
    sizes = [(YARDSTICK, "fmu", by_fmu), (NATIVE, "compiled", few), (NATIVE, "compiled", many)]
    for name, engine, cases in sizes:
        for workers, title in ((1, "one worker"), (2, "two workers")):
            run = partial(_sweep, paths[name], name, engine, cases, 51 if quick else 1001, workers)
            durations[f"{name}, {engine}: {cases:,} cases, {title}"] = timed(run)
    against = {
        name: name.replace("two workers", "one worker")
        for name in durations
        if "two workers" in name
    }
    times = take_turns(durations, 1 if quick else 2)
    return comparison(times, against, "s", dict.fromkeys(against, 1 / 1.8))


def _values(name: str, cases: int) -> list[float]:
    _, low, high, _, _ = _SUBJECTS[name]
    return np.linspace(low, high, cases).tolist()


def _methods(name: str, model: str, cases: int, points: int) -> dict[str, Duration]:
    """Return the processor time of a case by every method; their numbers are held together."""
    path = ppy.find_model(model).path
    numbers: dict[str, Array] = {}
    few = _values(name, cases)[::SHARE]
    actions: dict[str, tuple[Callable[[], Array], int]] = {
        EACH: (partial(_simulate_each, name, path, few, points), len(few)),
    }
    for method, engine in ENGINES.items():
        if engine == "fmu" or name == NATIVE:
            actions[method] = (partial(_sweep, model, name, engine, cases, points), cases)

    def duration(method: str) -> float:
        action, count = actions[method]
        begin = time.process_time()
        found = action()
        seconds = (time.process_time() - begin) / count
        numbers[method] = found if method == EACH else found[::SHARE]
        check_agreement(numbers)
        return seconds

    return {f"{name}: {method}": partial(duration, method) for method in actions}


def check_agreement(found: dict[str, Array]) -> None:
    """Raise RuntimeError if the numbers, shape (cases, 3), differ from those of `EACH`."""
    for method, numbers in found.items():
        if not np.allclose(numbers, found[EACH], rtol=1e-9, atol=0.0):
            raise RuntimeError(f"{method}: not the numbers of {EACH}")


def _sweep(model: str, name: str, engine: str, cases: int, points: int, workers: int = 1) -> Array:
    """Sweep as a user does; last, smallest and largest value of the output (cases, 3)."""
    parameter, _, _, driven, output = _SUBJECTS[name]
    clock = _STEP * np.arange(points)
    found = ppy.sweep(
        model,
        {parameter: _values(name, cases)},
        {driven: np.sin(clock)},
        time=clock,
        outputs=[output],
        keep=KEEP,
        engine=engine,
        workers=workers,
    )
    return np.column_stack([found[f"{output}_{kept}"].values for kept in KEEP])


def _numbers(course: Array) -> list[float]:
    return [float(course[-1]), float(course.min()), float(course.max())]


def _simulate_each(name: str, path: Path, values: list[float], points: int) -> Array:
    parameter, _, _, driven, output = _SUBJECTS[name]
    clock = _STEP * np.arange(points)
    series = np.rec.fromarrays([clock, np.sin(clock)], names=["time", driven])
    found = []
    for value in values:
        with contextlib.redirect_stdout(None):  # it warns of every input that has no series
            result = fmpy.simulate_fmu(
                str(path),
                stop_time=clock[-1],
                step_size=_STEP,
                output_interval=_STEP,
                start_values={parameter: value},
                input=series,
                output=[output],
                fmi_type="CoSimulation",
                set_input_derivatives=False,
            )
        found.append(_numbers(result[output]))
    return np.array(found)
