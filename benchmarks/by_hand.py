"""Batches as people write them by hand, which `ppy.sweep` is held against: the same cases, the same numbers."""

from __future__ import annotations

import contextlib
import ctypes
import shutil
from collections.abc import Sequence
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

Array = NDArray[np.float64]


def simulate_each(
    path: Path,
    parameter: str,
    values: Sequence[float],
    time: Array,
    name: str,
    given: Array,
    output: str,
) -> Array:
    """Call ``fmpy.simulate_fmu`` for every value.

    Parameters
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

    Returns
    -------
    ndarray, shape (c, 3)
        The last value of the output, its smallest and its largest.
    """
    step, stop = time[1], time[-1]
    series = np.rec.fromarrays([time, given], names=["time", name])
    found = []
    for value in values:
        with contextlib.redirect_stdout(None):  # it warns of every input that has no series
            result = fmpy.simulate_fmu(
                str(path),
                stop_time=stop,
                step_size=step,
                output_interval=step,
                start_values={parameter: value},
                input=series,
                output=[output],
                fmi_type="CoSimulation",
                set_input_derivatives=False,
            )
        found.append(_numbers(result[output]))
    return np.array(found)


def reuse_one(
    path: Path,
    parameter: str,
    values: Sequence[float],
    time: Array,
    name: str,
    given: Array,
    output: str,
) -> Array:
    """Unpack once, reset one instance, and call FMI with arguments that are ready: as fast as a loop in Python gets.

    Parameters and result as of :func:`simulate_each`.
    """
    description, folder = fmpy.read_model_description(path), fmpy.extract(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    slave.instantiate()
    set_real, do_step, get_real = (
        slave.dll[f"fmi2{verb}"] for verb in ("SetReal", "DoStep", "GetReal")
    )
    component, one, step = (
        ctypes.c_void_p(slave.component),
        ctypes.c_size_t(1),
        ctypes.c_double(time[1]),
    )
    into, out = ((ctypes.c_uint * 1)(references[n]) for n in (name, output))
    got, no = (ctypes.c_double * 1)(), ctypes.c_int(0)
    instants = [ctypes.c_double(t) for t in time.tolist()]
    inputs = [(ctypes.c_double * 1)(u) for u in given.tolist()]
    course, found = np.empty(len(time)), []
    for value in values:
        slave.setupExperiment(startTime=0.0)
        slave.setReal([references[parameter]], [value])
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        for k, (now, held) in enumerate(zip(instants, inputs, strict=True)):
            set_real(component, into, one, held)
            get_real(component, out, one, got)
            course[k] = got[0]
            if k + 1 < len(instants):
                do_step(component, now, step, no)
        found.append(_numbers(course))
        slave.reset()
    slave.freeInstance()
    shutil.rmtree(folder, ignore_errors=True)
    return np.array(found)


def _numbers(course: Array) -> list[float]:
    return [float(course[-1]), float(course.min()), float(course.max())]
