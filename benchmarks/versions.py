"""A step of the build of FMI 3.0 beside that of FMI 2.0, in a loop in C."""

from __future__ import annotations

import contextlib
import ctypes
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from fmus import component
from fmus.kit import build
from tests.support import hosts

from . import c_code
from .tables import Cell, Table, Topic
from .timing import Times, take_turns

# input, output and step in s: the smallest component, the largest, one with samples and the muscle
COMPONENTS = {
    "pid": ("reference", "command", 0.001),
    "ppy_actuator": ("current", "voltage", 0.1),
    "voice_coil_dma": ("force_reference", "force_measured", 0.001),
    "foot_free": ("an_tension", "leg_height", 0.001),
}
TARGET = 1.05
FUNCTIONS = {2: ("SetReal", "DoStep", "GetReal"), 3: ("SetFloat64", "DoStep", "GetFloat64")}
LOOPS = {2: "host.c", 3: "host_fmi3.c"}


def measure(quick: bool = False) -> Topic:
    """Time steps of both builds of some components in turns."""
    rounds, steps = (3, 200) if quick else (40, 20000)
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        loops = {
            version: ctypes.CDLL(str(c_code.library(source, folder))).run_steps
            for version, source in LOOPS.items()
        }
        measured = {name: _in_turns(name, loops, rounds, steps) for name in COMPONENTS}
    rows: list[list[Cell]] = [
        [
            name,
            times.best("2") / steps * 1e9,
            times.best("3") / steps * 1e9,
            times.ratio_of_best("3", "2"),
            times.median_ratio("3", "2"),
        ]
        for name, times in measured.items()
    ]
    columns = [
        "component",
        "FMI 2.0, best, ns",
        "FMI 3.0, best, ns",
        "ratio of best",
        "median ratio",
    ]
    worst = max(times.median_ratio("3", "2") for times in measured.values())
    met = "met" if worst <= TARGET else "missed"
    return Topic(
        "FMI 3.0 beside 2.0",
        [
            "Set one input, step, get one output in a loop in C, without event mode.",
            Table(columns, rows),
            f"The largest median ratio is {worst:.2f} (target {TARGET}, {met}).",
        ],
    )


def _in_turns(name: str, loops: dict[int, Any], rounds: int, steps: int) -> Times:
    """Time both builds of a component, by version of FMI."""
    with contextlib.ExitStack() as stack:
        actions = {}
        for version, run in loops.items():
            path = build.build_cached(component(name), "native", version)
            unpacked = stack.enter_context(hosts.extracted(path))
            actions[str(version)] = _stepping(unpacked, version, run, COMPONENTS[name], steps)
        return take_turns(actions, rounds)


def _stepping(
    folder: Path, version: int, run: Any, course: tuple[str, str, float], steps: int
) -> Callable[[], None]:
    """Start an instance; return a function that makes steps of it."""
    fed, read, step = course
    description = fmpy.read_model_description(str(folder), validate=False)
    references = {v.name: v.valueReference for v in description.modelVariables}
    kind = FMU3Slave if version == 3 else FMU2Slave
    model = kind(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="one",
    )
    model.instantiate()
    if version == 2:
        model.setupExperiment(startTime=0.0)
    model.enterInitializationMode()
    model.exitInitializationMode()
    functions = [
        ctypes.cast(getattr(model.dll, f"fmi{version}{name}"), ctypes.c_void_p)
        for name in FUNCTIONS[version]
    ]
    inputs = 0.5 * np.sin(np.arange(1.0, steps + 1))
    done = [0]

    def act() -> None:
        last = ctypes.c_double()
        status = run(
            *functions,
            ctypes.c_void_p(model.component),
            references[fed],
            references[read],
            ctypes.c_long(done[0]),
            ctypes.c_long(steps),
            ctypes.c_double(step),
            inputs.ctypes.data_as(ctypes.c_void_p),
            ctypes.byref(last),
        )
        if status != 0:
            raise RuntimeError(f"a step answered with status {status}")
        done[0] += steps

    return act
