"""The stepping kernel: one FMU over a million steps, beside bare loops in C and in Python."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from fmus import component
from fmus.kit.build.building import build_cached
from orchestration.fmu import stepping
from orchestration.fmu.instance import Fmu
from orchestration.fmu.kernel import one_fmu
from orchestration.fmu.stepping import plan_course
from tests.support import hosts
from tests.support.kernel import bare_loop

from .stepping import EMPTY, NATIVE, YARDSTICK, empty_fmu
from .tables import Cell, Table, Topic
from .timing import Times

BARE = "a bare loop in C"
KERNEL = "the kernel"
PYTHON = "the loop in Python"
TARGET = 2.0
STEP = 1e-3  # s
_SHARE = 20  # the loop in Python makes one step for so many of the others
_SIGNALS = {NATIVE: ("current", "voltage")}


def measure(quick: bool = False) -> Topic:
    """Time both loops and the kernel with three FMUs."""
    steps, rounds = (2000, 2) if quick else (1_000_000, 9)
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        fmus = {
            EMPTY: empty_fmu(Path(folder)),
            YARDSTICK: hosts.build_one_state_fmu(folder),
            NATIVE: build_cached(component("ppy_actuator"), "native"),
        }
        measured = {
            name: _time(path, *_SIGNALS.get(name, ("u", "x")), steps, rounds)
            for name, path in fmus.items()
        }
    ratio = measured[NATIVE].median_ratio(KERNEL, BARE)
    rows: list[list[Cell]] = [
        [
            name,
            *(1e6 * times.best(loop) for loop in (BARE, KERNEL, PYTHON)),
            times.median_ratio(KERNEL, BARE),
            times.median_ratio(PYTHON, KERNEL),
        ]
        for name, times in measured.items()
    ]
    columns = [
        "FMU",
        *(f"{loop}, best, µs" for loop in (BARE, KERNEL, PYTHON)),
        "kernel over bare loop, median",
        "Python over kernel, median",
    ]
    return Topic(
        "Stepping kernel",
        [
            (
                f"Time of a step with one input set and one output read and kept, of {steps} steps"
                " as `ppy simulate` makes them, without opening the FMU. The bare loop calls the"
                " same functions and does nothing else; that all come to the same bits was"
                " verified."
            ),
            (
                f"{NATIVE}: {ratio:.2f} of the bare loop (target {TARGET:g},"
                f" {'met' if ratio <= TARGET else 'missed'})."
            ),
            Table(columns, rows),
        ],
    )


def _time(path: Path, name: str, output: str, steps: int, rounds: int) -> Times:
    """Seconds for a step, in turns."""
    points = STEP * np.arange(steps + 1, dtype=np.float64)
    values = 0.9 * np.sin(points)
    loops: dict[str, Callable[[Fmu, int], Callable[[], np.ndarray]]] = {
        BARE: lambda fmu, n: bare_loop(fmu, points[:n], name, values[:n], output),
        KERNEL: lambda fmu, n: partial(
            _stepped, one_fmu.follow_course, fmu, points[:n], {name: values[:n]}, output
        ),
        PYTHON: lambda fmu, n: partial(
            _stepped, stepping.follow_course, fmu, points[:n], {name: values[:n]}, output
        ),
    }
    seconds = {loop: np.empty(rounds) for loop in loops}
    for k in range(-1, rounds):  # the first does not count
        found = {}
        for loop in list(loops)[k % 3 :] + list(loops)[: k % 3]:
            made = steps // _SHARE if loop == PYTHON else steps
            with Fmu(path) as fmu:
                fmu.start()
                act = loops[loop](fmu, made + 1)
                begin = time.perf_counter()
                found[loop] = act()[: steps // _SHARE].tobytes()
                seconds[loop][k] = (time.perf_counter() - begin) / made
        if len(set(found.values())) > 1 and path.stem != "empty":  # which answers nothing
            raise RuntimeError(f"{path.name}: the kernel and the loops differ")
    return Times(seconds)


def _stepped(
    way: Callable[..., None],
    fmu: Fmu,
    points: np.ndarray,
    inputs: dict[str, np.ndarray],
    output: str,
) -> np.ndarray:
    result = np.empty((len(points), 1))
    way(
        fmu,
        plan_course(fmu, points, inputs, (), 1),
        [output],
        result,
        _silent,
        max(1, len(points) // 200),
    )
    return result[:, 0]


def _silent(done: int) -> None:
    """Tell nobody."""
