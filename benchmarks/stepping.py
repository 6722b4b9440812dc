"""Co-simulation, one communication step: set one input, step, get one output."""

from __future__ import annotations

import contextlib
import ctypes
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from fmus import component
from fmus.kit import build
from tests.support import hosts

from . import c_code
from .tables import Cell, Table, Topic
from .timing import Times, pooled, take_turns

EMPTY = "empty C FMU (the floor)"
YARDSTICK = "one state, C by hand"
STOCK = "one state, stock pythonfmu"
NATIVE = "ppy_actuator, native"
PYTHON = "ppy_actuator, Python"
TARGETS = {NATIVE: (YARDSTICK, 1.0), PYTHON: (STOCK, 1.5)}
STEP = 0.1  # s
FMPY = "Through fmpy's `FMU2Slave`"
IN_C = "The same calls in a loop in C"
HOSTS = {FMPY: 1, IN_C: 5}  # how many times the steps of a turn
HELD = "current held at 0.9 A"
CHANGING = "current between -0.9 A and 0.9 A, another in each step"
_SIGNALS = {EMPTY: ("u", "x"), YARDSTICK: ("u", "x"), STOCK: ("u", "x")}
_ACTUATOR = ("current", "voltage")


def measure(quick: bool = False) -> Topic:
    """Time every FMU through fmpy and in a loop in C, in each of several processes."""
    processes, size = (2, (3, 50)) if quick else (6, (12, 1000))
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        fmus = {
            EMPTY: empty_fmu(Path(folder)),
            YARDSTICK: hosts.build_one_state_fmu(folder),
            NATIVE: build.build_cached(component("ppy_actuator"), "native"),
            PYTHON: build.build_cached(component("ppy_actuator"), "python"),
            STOCK: hosts.build_minimal_pythonfmu(folder),
        }
        loop = c_code.library("host.c", folder)
        measured = [_in_a_process(fmus, loop, *size) for _ in range(processes)]
    parts: list[str | Table] = [
        (
            f"Time of `setReal`, `doStep` ({STEP} s), `getReal`, one variable each. All FMUs are in"
            f" one process and take turns; figures are of {processes} such processes, the range is"
            " of their median ratios and says how far a ratio can be trusted. The actuator has"
            " three states and controls its error (at least five evaluations of the rates in a"
            " step); the FMUs it is held against have one state and no error control. The floor is"
            " the time of the host alone, in an FMU whose functions return at once."
        ),
    ]
    for host, load in measured[0]:
        several = [found[host, load] for found in measured]
        times = pooled(several)
        ratios = [
            f"{name} {times.median_ratio(name, other):.2f} of {other} (target {target}, "
            f"{'met' if times.median_ratio(name, other) <= target else 'missed'})"
            for name, (other, target) in TARGETS.items()
        ]
        parts += [f"{host}; {load}:", _table(several, size[1] * HOSTS[host])]
        if host == FMPY:
            parts.append("Median ratios: " + "; ".join(ratios) + ".")
    return Topic("Co-simulation step", parts)


def _in_a_process(
    fmus: dict[str, Path], loop: Path, rounds: int, steps: int
) -> dict[tuple[str, str], Times]:
    """Measure in a process that ends without clean-up: stock pythonfmu may read freed memory."""
    finished = hosts.finish_in_subprocess(time_steps, fmus, loop, rounds, steps, clean_exit=False)
    if finished.result is None:
        raise RuntimeError(
            f"the measuring process ended with return code {finished.returncode}\n{finished.output}"
        )
    return finished.result


def _table(several: list[Times], steps: int) -> Table:
    others = {
        EMPTY: YARDSTICK,
        YARDSTICK: YARDSTICK,
        NATIVE: YARDSTICK,
        PYTHON: STOCK,
        STOCK: STOCK,
    }
    times = pooled(several)
    rows: list[list[Cell]] = []
    for name, other in others.items():
        medians = [part.median_ratio(name, other) for part in several]
        above = times.best(name) - times.best(EMPTY)
        rows.append(
            [
                name,
                times.best(name) / steps * 1e6,
                above / steps * 1e6,
                other,
                times.ratio_of_best(name, other),
                times.median_ratio(name, other),
                f"{min(medians):.3g} ... {max(medians):.3g}",
            ]
        )
    columns = [
        "FMU",
        "best, µs",
        "above the floor, µs",
        "held against",
        "ratio of best",
        "median ratio",
        "range",
    ]
    return Table(columns, rows)


def empty_fmu(folder: Path) -> Path:
    """Pack an FMU whose functions return at once."""
    description = hosts.ONE_STATE_DESCRIPTION.replace("one_state", "empty")
    library = c_code.library("empty.c", folder)
    path = folder / "empty.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{fmpy.platform}/{library.name}")
    return path


# --- in the measuring process
# ---------------------------------------------------------------------------------------


class _Stepper:
    """One instance, ready to step."""

    def __init__(self, folder: Path, name: str):
        description = fmpy.read_model_description(str(folder), validate=False)
        references = {v.name: v.valueReference for v in description.modelVariables}
        self.input, self.output = (references[signal] for signal in _SIGNALS.get(name, _ACTUATOR))
        self.model = hosts.slave(folder)
        self.model.instantiate()
        self.model.setupExperiment(startTime=0.0)
        self.model.enterInitializationMode()
        self.model.exitInitializationMode()
        self.count = 0

    def through_fmpy(self, inputs: list[float]) -> float:
        model = self.model
        into = [self.input]
        out_of = [self.output]
        result = [0.0]
        for k, value in enumerate(inputs, self.count):
            model.setReal(into, [value])
            model.doStep(k * STEP, STEP)
            result = model.getReal(out_of)
        self.count += len(inputs)
        return result[0]

    def in_c(self, run_steps: Any, inputs: np.ndarray) -> float:
        last = ctypes.c_double()
        functions = (
            getattr(self.model.dll, f"fmi2{name}") for name in ("SetReal", "DoStep", "GetReal")
        )
        status = run_steps(
            *(ctypes.cast(function, ctypes.c_void_p) for function in functions),
            ctypes.c_void_p(self.model.component),
            self.input,
            self.output,
            ctypes.c_long(self.count),
            ctypes.c_long(len(inputs)),
            ctypes.c_double(STEP),
            inputs.ctypes.data_as(ctypes.c_void_p),
            ctypes.byref(last),
        )
        if status != 0:
            raise RuntimeError(f"a step answered with status {status}")
        self.count += len(inputs)
        return last.value


def time_steps(
    fmus: dict[str, Path], loop: Path, rounds: int, steps: int
) -> dict[tuple[str, str], Times]:
    """Load all FMUs and time them in turns.

    Parameters
    ----------
    fmus : dict of str to Path
        FMU by name.
    loop : Path
        Library compiled from ``c/host.c``.
    rounds : int
    steps : int
        Communication steps of one turn through fmpy; in C there are more.

    Returns
    -------
    dict of tuple to Times
        By host and by what the input does.
    """
    run_steps = ctypes.CDLL(str(loop)).run_steps

    def turn(stepper: _Stepper, host: str, inputs: np.ndarray) -> Callable[[], float]:
        values = inputs.tolist()
        return lambda: (
            stepper.through_fmpy(values) if host == FMPY else stepper.in_c(run_steps, inputs)
        )

    found = {}
    with contextlib.ExitStack() as stack:
        folders = {name: stack.enter_context(hosts.extracted(path)) for name, path in fmus.items()}
        for host, times in HOSTS.items():
            for load in (HELD, CHANGING):
                n = steps * times
                inputs = np.full(n, 0.9) if load == HELD else 0.9 * np.sin(np.arange(1.0, n + 1))
                actions = {
                    name: turn(_Stepper(folder, name), host, inputs)
                    for name, folder in folders.items()
                }
                for name, act in actions.items():
                    if name != EMPTY and act() == 0.0:
                        raise RuntimeError(f"{name}: nothing moved")
                found[host, load] = take_turns(actions, rounds)
    return found
