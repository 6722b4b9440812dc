"""Run an SSP file in real masters, in the same way in each: constant inputs, values after every
communication step.

Like `hosts.py`, which does it for single FMUs. libcosim and Ecos run in processes of their own.
"""

from __future__ import annotations

import importlib.util
import os
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

from tests.support.hosts import (
    ECOS_COMPLAINT,
    NANOSECONDS,
    HostError,
    Result,
    _installed,
    finish_in_subprocess,
    preload_tbb,
)

Values = Mapping[str, float]


def run_fmpy_ssp(
    path: Path, step: float, count: int, inputs: Values, signals: Sequence[str]
) -> Result:
    """Run a system in fmpy.ssp.

    Parameters
    ----------
    path : Path
        The ``.ssp`` file, written without connectors of the system.
    step : float
        Communication step, s.
    count : int
        Number of steps.
    inputs : mapping of "member.variable" to value
        Constant from the first step on.
    signals : sequence of "member.variable"
        Real outputs to record.

    Returns
    -------
    dict of str to ndarray, shape (count,)
        After each step.
    """
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import Parameter, ParameterSet, read_ssd

    # fmpy reads the parameters of the members and does not apply them; it does apply a set that it
    # is given
    found = []
    for component in read_ssd(str(path)).system.elements:
        for binding in component.parameterBindings:
            for values in binding.parameterValues:
                for p in values.parameters:
                    number = float({"true": 1, "false": 0}.get(p.value, p.value))
                    found.append(Parameter(name=f"{component.name}.{p.name}", value=number))
    found += [Parameter(name=name, value=value) for name, value in inputs.items()]
    stop = (count - 0.5) * step
    table = simulate_ssp(
        str(path), stop_time=stop, step_size=step, parameter_set=ParameterSet(parameters=found)
    )
    return {name: np.array(table[name]) for name in signals}


def run_own_ssp(
    path: Path, step: float, count: int, inputs: Values, signals: Sequence[str]
) -> Result:
    """Run a system in our master, as the others do it; arguments and result are those of
    `run_fmpy_ssp`.
    """
    from orchestration import master
    from orchestration.system import ssp

    system = ssp.read(path, path.parent / f"{path.stem}-own")
    time = step * np.arange(count + 1)
    held = {name: np.full(time.size, value) for name, value in inputs.items()}
    found = master.run(system, time, held, method="jacobi", feedthrough=False, record=signals)
    return {name: found.signals[name][1:] for name in signals}


def run_libcosim_ssp(
    path: Path, step: float, count: int, inputs: Values, signals: Sequence[str]
) -> Result:
    """Run a system in libcosim; arguments and result are those of `run_fmpy_ssp`."""
    if importlib.util.find_spec("libcosimpy") is None:
        pytest.skip("libcosimpy is not installed")
    references = _references(path)
    finished = finish_in_subprocess(
        _libcosim, str(path), step, count, dict(inputs), list(signals), references
    )
    if finished.returncode != 0:
        raise HostError("libcosim", finished.returncode, finished.output)
    return finished.result


def _references(path: Path) -> dict[str, int]:
    """Value reference of every variable of every member."""
    from orchestration.system import ssp

    folder = path.parent / f"{path.stem}-unpacked"
    return {
        f"{member.name}.{variable.name}": variable.valueReference
        for member in ssp.read(path, folder).members
        for variable in fmpy.read_model_description(str(member.fmu), validate=False).modelVariables
    }


def _libcosim(
    path: str,
    step: float,
    count: int,
    inputs: Values,
    signals: list[str],
    references: dict[str, int],
) -> Result:
    from libcosimpy import _internal  # type: ignore[import-untyped]
    from libcosimpy.CosimExecution import CosimExecution  # type: ignore[import-untyped]
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # type: ignore[import-untyped]
    from libcosimpy.CosimManipulator import CosimManipulator  # type: ignore[import-untyped]
    from libcosimpy.CosimObserver import CosimObserver  # type: ignore[import-untyped]

    log_output_level(CosimLogLevel.WARNING)
    try:
        execution = CosimExecution.from_ssp_file(path, round(step * NANOSECONDS))
    except AssertionError as error:
        raise RuntimeError(_internal.get_last_error_message()) from error
    index = {info.name.decode(): info.index for info in execution.slave_infos()}
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    for name, value in inputs.items():
        manipulator.slave_real_values(index[name.split(".")[0]], [references[name]], [value])
    table = {name: np.empty(count) for name in signals}
    for k in range(count):
        if not execution.step():
            raise RuntimeError(_internal.get_last_error_message())
        for name in signals:
            (table[name][k],) = observer.last_real_values(
                index[name.split(".")[0]], [references[name]]
            )
    return table


def run_ecos_ssp(
    path: Path,
    step: float,
    count: int,
    inputs: Values,
    signals: Sequence[str],
    parameters: str | None = "start",
) -> Result:
    """Run a system in Ecos; arguments and result are those of `run_fmpy_ssp`, and the name of the
    parameter sets.
    """
    if importlib.util.find_spec("ecospy") is None:
        pytest.skip("ecospy is not installed")
    if os.name != "nt" and not _installed("tbb"):
        pytest.skip("ecospy needs the package tbb")
    finished = finish_in_subprocess(
        _ecos, str(path), step, count, dict(inputs), list(signals), parameters
    )
    if finished.returncode != 0 or ECOS_COMPLAINT.search(finished.output):
        raise HostError("Ecos", finished.returncode, finished.output)
    return finished.result


def _ecos(
    path: str, step: float, count: int, inputs: Values, signals: list[str], parameters: str | None
) -> Result:
    preload_tbb()
    from ecospy import EcosLib, EcosSimulation  # type: ignore[import-untyped]

    EcosLib.set_log_level("debug")  # Ecos shows messages of the FMU at this level only
    simulation: Any = EcosSimulation(ssp_path=path, step_size=step)
    try:
        if not simulation.init(0.0, parameters):
            raise RuntimeError(EcosLib.get_last_error())
        for name, value in inputs.items():
            simulation.set_real(name.replace(".", "::"), value)
        table = {name: np.empty(count) for name in signals}
        for k in range(count):
            simulation.step()
            for name in signals:
                table[name][k] = simulation.get_real(name.replace(".", "::"))
    finally:
        simulation.free()
    return table


def member_of_archive(path: Path, name: str) -> bytes:
    """Contents of a file in an archive."""
    with zipfile.ZipFile(path) as archive:
        return archive.read(name)
