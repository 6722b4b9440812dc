"""Batches written by hand, with which `ppy.sweep` is compared: the same cases and numbers."""

from __future__ import annotations

import contextlib
import ctypes
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from fmus.kit.arrays import Array


@dataclass(frozen=True)
class Batch:
    """Cases of one FMU: a parameter over values, one driven input and one output.

    Attributes
    ----------
    path : Path
        Of the FMU.
    parameter : str
    values : sequence of float
        Of the parameter, c of them.
    time : ndarray, shape (n,)
        Equally spaced, s, from zero.
    name : str
        Of an input.
    given : ndarray, shape (n,)
        Its values.
    output : str
    """

    path: Path
    parameter: str
    values: Sequence[float]
    time: Array
    name: str
    given: Array
    output: str


def simulate_each(batch: Batch) -> Array:
    """Call ``fmpy.simulate_fmu`` for every value.

    Returns
    -------
    ndarray, shape (c, 3)
        The last value of the output, its smallest and its largest.
    """
    step = batch.time[1]
    series = np.rec.fromarrays([batch.time, batch.given], names=["time", batch.name])
    found = []
    for value in batch.values:
        with contextlib.redirect_stdout(None):  # it warns of every input that has no series
            result = fmpy.simulate_fmu(
                str(batch.path),
                stop_time=batch.time[-1],
                step_size=step,
                output_interval=step,
                start_values={batch.parameter: value},
                input=series,
                output=[batch.output],
                fmi_type="CoSimulation",
                set_input_derivatives=False,
            )
        found.append(_numbers(result[batch.output]))
    return np.array(found)


def reuse_one(batch: Batch) -> Array:
    """Unpack once, reset one instance, and call FMI with arguments that are ready.

    It is as fast as a loop in Python gets. The result is as of :func:`simulate_each`.
    """
    description = fmpy.read_model_description(batch.path)
    folder = fmpy.extract(str(batch.path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    slave.instantiate()
    run = _ready(slave, batch, references[batch.name], references[batch.output])
    found = []
    for value in batch.values:
        slave.setupExperiment(startTime=0.0)
        slave.setReal([references[batch.parameter]], [value])
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        found.append(_numbers(run()))
        slave.reset()
    slave.freeInstance()
    shutil.rmtree(folder, ignore_errors=True)
    return np.array(found)


def _ready(slave: FMU2Slave, batch: Batch, given: int, asked: int) -> Callable[[], Array]:
    """Bind the arguments of every call of one case; the function makes the calls."""
    set_real, do_step, get_real = (
        slave.dll[f"fmi2{verb}"] for verb in ("SetReal", "DoStep", "GetReal")
    )
    component = ctypes.c_void_p(slave.component)
    one = ctypes.c_size_t(1)
    step = ctypes.c_double(batch.time[1])
    no = ctypes.c_int(0)
    into = (ctypes.c_uint * 1)(given)
    out = (ctypes.c_uint * 1)(asked)
    got = (ctypes.c_double * 1)()
    instants = [ctypes.c_double(t) for t in batch.time.tolist()]
    inputs = [(ctypes.c_double * 1)(u) for u in batch.given.tolist()]
    course = np.empty(len(batch.time))

    def run() -> Array:
        for k, (now, held) in enumerate(zip(instants, inputs, strict=True)):
            set_real(component, into, one, held)
            get_real(component, out, one, got)
            course[k] = got[0]
            if k + 1 < len(instants):
                do_step(component, now, step, no)
        return course

    return run


def _numbers(course: Array) -> list[float]:
    return [float(course[-1]), float(course.min()), float(course.max())]
