"""FMUs of FMI 3.0 behind the functions of FMI 2.0: what that costs, in a step and at loading."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from fmus import component
from fmus.kit.build import build_cached
from orchestration.fmu import Fmu, RepeatedRuns
from orchestration.fmu.simulation import FmuSource
from tests.support import fmi3_fmus

from .tables import Cell, Table, Topic
from .timing import Times, take_turns

NAMES = {"ppy_actuator": "current", "voice_coil_dma": "force_reference"}
STEP = 0.01  # s
_SIZES = (1_000, 10_000)  # elements of an array


def measure(quick: bool = False) -> Topic:
    """Time runs of both builds of components in turns, and exchanges of arrays."""
    rounds, steps = (3, 200) if quick else (41, 20_000)
    rows: list[list[Cell]] = []
    for name, signal in NAMES.items():
        times = _runs(name, signal, steps, rounds)
        of_2, of_3 = (1e6 * times.best(version) / steps for version in ("2", "3"))
        ratios = [times.ratio_of_best("3", "2"), times.median_ratio("3", "2")]
        rows.append([name, of_2, of_3, 1e3 * (of_3 - of_2), *ratios])
    columns = ["component", "FMI 2.0, µs", "FMI 3.0, µs", "more, ns", "ratio of best"]
    loading = _loading(3 if quick else 21)
    return Topic(
        "FMUs of FMI 3.0",
        [
            (
                f"A step of {STEP} s by the stepping kernel, with one input set and all outputs"
                " read: the builds of a component for both versions, in turns in one process."
            ),
            Table([*columns, "median ratio"], rows),
            (
                "Opening, starting and closing an actuator:"
                f" {1e3 * loading.median('2'):.3g} ms of FMI 2.0,"
                f" {1e3 * loading.median('3'):.3g} ms of FMI 3.0."
            ),
            "Setting and reading all elements of an array, one call each:",
            _arrays(5 if quick else 101),
        ],
    )


def _runs(name: str, signal: str, steps: int, rounds: int) -> Times:
    clock = STEP * np.arange(steps + 1)
    inputs = {signal: 0.5 * np.sin(clock)}
    with contextlib.ExitStack() as stack:
        actions: dict[str, Callable[[], object]] = {}
        for version in (2, 3):
            source = FmuSource(build_cached(component(name), "native", version))
            runs: RepeatedRuns = stack.enter_context(source.open())
            outputs = [output.name for output in component(name).layout.shown]
            actions[str(version)] = partial(runs.run, clock, inputs, {}, outputs)
        return take_turns(actions, rounds)


def _loading(rounds: int) -> Times:
    def load(path: Path) -> None:
        with Fmu(path) as fmu:
            fmu.start()

    builds = {
        str(version): build_cached(component("ppy_actuator"), "native", version)
        for version in (2, 3)
    }
    return take_turns({name: partial(load, path) for name, path in builds.items()}, rounds)


def _arrays(rounds: int) -> Table:
    rows: list[list[Cell]] = []
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="benchmark_"))
        actions: dict[str, Callable[[], object]] = {}
        for size in _SIZES:
            place = Path(folder, str(size))
            place.mkdir()
            fmu = stack.enter_context(Fmu(fmi3_fmus.build_wide(size, place)))
            fmu.start()
            write = fmu.writer(fmu.inputs)
            read = fmu.reader(fmu.outputs)
            row = np.ones(size)

            def exchange(
                write: Callable[[np.ndarray], None] = write,
                read: Callable[[np.ndarray], None] = read,
                row: np.ndarray = row,
            ) -> None:
                write(row)
                read(row.copy())

            actions[str(size)] = exchange
        times = take_turns(actions, rounds)
    for size in _SIZES:
        best = times.best(str(size))
        rows.append([size, 1e6 * best, 1e9 * best / size])
    return Table(["elements", "best, µs", "ns an element"], rows)
