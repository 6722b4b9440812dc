"""Run one FMU in real co-simulation masters, in the same way in each, and build the small FMUs they
are tried on.

All masters take the same arguments: communication points, inputs held from each point to the next,
names of outputs and parameter values. They answer with one array per output. A master in foreign
machine code runs in a process of its own: when it crashes, the caller gets a `HostError` with the
return code, not a dead test run.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import functools
import importlib.metadata
import importlib.util
import os
import pickle
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.model_description import ModelDescription, ScalarVariable

from tests.support.machines import MACHINES, Machine

TESTS = Path(__file__).resolve().parent
HEADERS = Path(fmpy.__file__).parent / "c-code"
LETTER = {"Real": "r", "Float64": "r", "Integer": "i", "Int32": "i", "Boolean": "b"}
TYPE: dict[str, type] = {"Real": float, "Float64": float, "Integer": int, "Boolean": bool}
NANOSECONDS = 1_000_000_000
ECOS_COMPLAINT = re.compile(r"\] (fmi2)?(Discard|Error|Fatal)\b")

Series = Mapping[str, Any]
Times = Sequence[float] | np.ndarray
Result = dict[str, np.ndarray]


class HostError(RuntimeError):
    """A master, or the FMU inside it, failed.

    Attributes
    ----------
    returncode : int
        Return code of the process; negative is the number of the signal that killed it.
    output : str
        All it wrote: messages of the FMU, traceback.
    """

    def __init__(self, host: str, returncode: int, output: str):
        super().__init__(f"{host} ended with return code {returncode}\n{output}")
        self.returncode = returncode
        self.output = output


@dataclass(frozen=True)
class Finished:
    """The outcome of a function that ran in its own process.

    Attributes
    ----------
    returncode : int
        0 when the function returned, 1 when it raised, -n when signal n killed the process (-11:
        segmentation fault).
    result : object
        What the function returned; None when it did not.
    output : str
        Everything written to the output and error streams, by Python and by machine code.
    """

    returncode: int
    result: Any
    output: str


# --- processes
# --------------------------------------------------------------------------------------------------

_CHILD = """
import importlib, os, pickle, sys
with open(sys.argv[1], "rb") as file:
    path, module, name, args, kwargs, clean_exit = pickle.load(file)
sys.path[:] = path
result = getattr(importlib.import_module(module), name)(*args, **kwargs)
with open(sys.argv[2], "wb") as file:
    pickle.dump(result, file)
sys.stdout.flush(); sys.stderr.flush()
if not clean_exit:
    os._exit(0)
"""


def finish_in_subprocess(
    function: str | Callable,
    *args: Any,
    timeout: float = 120.0,
    clean_exit: bool = True,
    **kwargs: Any,
) -> Finished:
    """Call a module-level function in a fresh Python process.

    Parameters
    ----------
    function : str or callable
        A function of a module; as text a name in this module or ``"module:name"``.
    *args, **kwargs
        Its arguments (picklable).
    timeout : float
        Seconds after which the process is killed (the return code is then -9).
    clean_exit : bool
        False: leave right after the function returned, without the clean-up of loaded libraries.
        Stock pythonfmu needs it: its clean-up reads freed memory and now and then kills a process
        whose work is done.

    Returns
    -------
    Finished
        A process that dies after the function returned (in the clean-up of a library, say) has both
        a return code and a result.
    """
    if callable(function):
        module, name = function.__module__, function.__qualname__
    else:
        module, _, name = function.rpartition(":")
    call = (list(sys.path), module or __name__, name, args, kwargs, clean_exit)
    with tempfile.TemporaryDirectory(prefix="host_") as folder:
        question, answer = Path(folder, "call"), Path(folder, "result")
        question.write_bytes(pickle.dumps(call))
        command = [sys.executable, "-c", _CHILD, str(question), str(answer)]
        # What a crashed process leaves behind goes away with the folder.
        surroundings = {**os.environ, "TMPDIR": folder}
        process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            env=surroundings,
        )
        try:
            output, _ = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            process.kill()
            output, _ = process.communicate()
        result = (
            pickle.loads(answer.read_bytes()) if answer.exists() and answer.stat().st_size else None
        )
        return Finished(process.returncode, result, output.decode(errors="replace"))


def in_subprocess(function: str | Callable, *args: Any, **kwargs: Any) -> tuple[int, Any]:
    """Like `finish_in_subprocess`, answering with ``(returncode, result)``; the result of a failure
    is its output.
    """
    finished = finish_in_subprocess(function, *args, **kwargs)
    return finished.returncode, finished.result if finished.returncode == 0 else finished.output


# --- what is common to all masters
# ----------------------------------------------------------------------------------


def _variables(description: ModelDescription) -> dict[str, ScalarVariable]:
    return {variable.name: variable for variable in description.modelVariables}


def _reference(description: ModelDescription, name: str) -> int:
    return _variables(description)[name].valueReference


def _table(times: Times, inputs: Series) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    time = np.asarray(times, dtype=float)
    columns = {
        name: np.broadcast_to(np.asarray(values, dtype=float), time.shape)
        for name, values in inputs.items()
    }
    return time, columns


def _uniform_step(host: str, time: np.ndarray) -> float:
    step = (time[-1] - time[0]) / (len(time) - 1)
    if not np.allclose(np.diff(time), step, rtol=1e-9, atol=0.0):
        raise ValueError(
            f"{host} has a fixed step: the communication points must be equally spaced"
        )
    return float(step)


def _real_only(host: str, description: ModelDescription, names: Sequence[str]) -> None:
    variables = _variables(description)
    for name in names:
        if variables[name].type not in ("Real", "Float64"):
            raise ValueError(
                f"run_{host} handles Real variables only; {name} is {variables[name].type}"
            )


def _typed(
    description: ModelDescription, parameters: Mapping[str, float]
) -> dict[str, float | int | bool]:
    """Values in the types of their variables, which masters go by."""
    variables = _variables(description)
    return {name: TYPE[variables[name].type](value) for name, value in parameters.items()}


def _set(fmu: FMU2Slave, variable: ScalarVariable, value: float) -> None:
    if variable.type == "Real":
        fmu.setReal([variable.valueReference], [float(value)])
    elif variable.type == "Integer":
        fmu.setInteger([variable.valueReference], [int(value)])
    else:
        fmu.setBoolean([variable.valueReference], [bool(value)])


def _get(fmu: FMU2Slave, variable: ScalarVariable) -> float:
    getter = {"Real": fmu.getReal, "Integer": fmu.getInteger, "Boolean": fmu.getBoolean}[
        variable.type
    ]
    return float(getter([variable.valueReference])[0])


# --- fmpy
# --------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def extracted(fmu: str | Path) -> Iterator[Path]:
    """Unzip an FMU into a temporary folder that is removed afterwards."""
    with tempfile.TemporaryDirectory(prefix="fmu_") as folder:
        fmpy.extract(str(fmu), unzipdir=folder)
        yield Path(folder)


def slave(folder: str | Path, instance_name: str = "instance") -> FMU2Slave:
    """Load the binary of an unzipped FMU with fmpy; the caller instantiates and frees."""
    description = fmpy.read_model_description(str(folder), validate=False)
    return FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=instance_name,
    )


def run_fmpy(
    fmu: str | Path,
    times: Times,
    inputs: Series,
    outputs: Sequence[str],
    parameters: Mapping[str, float] | None = None,
    *,
    feedthrough: bool = True,
    stop_time_defined: bool = True,
    tolerance: float | None = None,
    logging: bool = False,
) -> Result:
    """Run an FMU step by step through fmpy, in this process.

    Parameters
    ----------
    fmu : path
        The ``.fmu`` file.
    times : (n,) array, s
        Communication points, increasing; spacing is free.
    inputs : mapping of name to (n,) array or scalar
        Row k holds from ``times[k]`` to ``times[k+1]``, and is set during initialization for k = 0.
    outputs : sequence of str
        Names of variables to read at each point.
    parameters : mapping of name to value, optional
        Set before initialization.
    feedthrough : bool
        True: outputs at point k are read after input row k is set. False: before, as libcosim and
        Ecos observe them; the first row is then read at the end of initialization.
    stop_time_defined : bool
        Announce ``times[-1]`` as the stop time.
    tolerance : float, optional
        Relative tolerance announced to the FMU.
    logging : bool
        Instantiate with ``loggingOn``.

    Returns
    -------
    dict of name to (n,) array

    Raises
    ------
    fmpy.fmi1.FMICallException
        When the FMU answers worse than Warning.
    """
    time, columns = _table(times, inputs)
    table: Result = {name: np.empty(len(time)) for name in outputs}
    with extracted(fmu) as folder:
        variables = _variables(fmpy.read_model_description(str(folder), validate=False))
        model = slave(folder)
        model.instantiate(loggingOn=logging)
        try:
            for name, value in (parameters or {}).items():
                _set(model, variables[name], value)
            stop = time[-1] if stop_time_defined and len(time) > 1 else None
            model.setupExperiment(tolerance=tolerance, startTime=time[0], stopTime=stop)
            model.enterInitializationMode()
            for name, column in columns.items():
                _set(model, variables[name], column[0])
            model.exitInitializationMode()
            for k in range(len(time)):
                if not feedthrough:
                    for name in outputs:
                        table[name][k] = _get(model, variables[name])
                for name, column in columns.items():
                    _set(model, variables[name], column[k])
                if feedthrough:
                    for name in outputs:
                        table[name][k] = _get(model, variables[name])
                if k + 1 < len(time):
                    model.doStep(time[k], time[k + 1] - time[k])
            model.terminate()
        finally:
            model.freeInstance()
    return table


# --- libcosim
# --------------------------------------------------------------------------------------------------


def run_libcosim(
    fmu: str | Path,
    times: Times,
    inputs: Series,
    outputs: Sequence[str],
    parameters: Mapping[str, float] | None = None,
    *,
    clean_exit: bool = True,
) -> Result:
    """Run an FMU in libcosim (fixed step from time 0), in a process of its own.

    Arguments are those of `run_fmpy` and of `finish_in_subprocess`. Outputs are what its observer
    sees: the value at the end of each step, still with the inputs of that step. The value at the
    first point is never observed by libcosim and is NaN here.

    Raises
    ------
    HostError
        When libcosim reports an error or crashes.
    ValueError
        When times do not start at 0 or are not equally spaced, or an input or output is not Real.
    """
    if importlib.util.find_spec("libcosimpy") is None:
        pytest.skip("libcosimpy is not installed")
    time, columns = _table(times, inputs)
    if time[0] != 0.0:
        raise ValueError("libcosim starts at time 0")
    step = _uniform_step("libcosim", time)
    description = fmpy.read_model_description(str(fmu), validate=False)
    _real_only("libcosim", description, [*columns, *outputs])
    finished = finish_in_subprocess(
        _libcosim,
        str(fmu),
        time,
        step,
        columns,
        list(outputs),
        _typed(description, parameters or {}),
        clean_exit=clean_exit,
    )
    if finished.returncode != 0:
        raise HostError("libcosim", finished.returncode, finished.output)
    return finished.result


def _libcosim(
    fmu: str,
    time: np.ndarray,
    step: float,
    columns: Result,
    outputs: list[str],
    parameters: dict[str, float | int | bool],
) -> Result:
    from libcosimpy.CosimExecution import CosimExecution  # type: ignore[import-untyped]
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # type: ignore[import-untyped]
    from libcosimpy.CosimManipulator import CosimManipulator  # type: ignore[import-untyped]
    from libcosimpy.CosimObserver import CosimObserver  # type: ignore[import-untyped]
    from libcosimpy.CosimSlave import CosimLocalSlave  # type: ignore[import-untyped]

    log_output_level(CosimLogLevel.WARNING)
    description = fmpy.read_model_description(fmu, validate=False)
    execution = CosimExecution.from_step_size(round(step * NANOSECONDS))
    local = CosimLocalSlave(fmu_path=fmu, instance_name="instance")
    index = execution.add_local_slave(local)
    if index < 0:
        raise RuntimeError(f"libcosim could not add the FMU: {_libcosim_error()}")
    observer = CosimObserver.create_last_value()
    manipulator = CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    set_start = {
        float: execution.real_initial_value,
        int: execution.integer_initial_value,
        bool: execution.boolean_initial_value,
    }
    for name, value in parameters.items():
        set_start[type(value)](index, _reference(description, name), value)
    for name, column in columns.items():
        execution.real_initial_value(index, _reference(description, name), float(column[0]))
    input_references = [_reference(description, name) for name in columns]
    output_references = [_reference(description, name) for name in outputs]
    table = {name: np.full(len(time), np.nan) for name in outputs}
    for k in range(len(time) - 1):
        if input_references:
            manipulator.slave_real_values(
                index, input_references, [float(column[k]) for column in columns.values()]
            )
        if not execution.step():
            raise RuntimeError(f"libcosim step at {time[k]} s failed: {_libcosim_error()}")
        for name, value in zip(
            outputs, observer.last_real_values(index, output_references), strict=True
        ):
            table[name][k + 1] = value
    return table


def _libcosim_error() -> str:
    from libcosimpy import _internal  # type: ignore[import-untyped]

    return _internal.get_last_error_message()


# --- Ecos
# --------------------------------------------------------------------------------------------------


def preload_tbb() -> None:
    """Make Ecos find ``libtbb`` of the package `tbb`, which installs it where the dynamic linker
    does not look.

    A library that is already in the process satisfies a later one that needs its name: no search
    path, no environment.
    """
    if os.name == "nt":
        return
    for file in importlib.metadata.files("tbb") or []:
        if file.name == "libtbb.so.12":
            ctypes.CDLL(str(Path(str(file.locate())).resolve()), mode=ctypes.RTLD_GLOBAL)
            return


def run_ecos(
    fmu: str | Path,
    times: Times,
    inputs: Series,
    outputs: Sequence[str],
    parameters: Mapping[str, float] | None = None,
    *,
    clean_exit: bool = True,
) -> Result:
    """Run an FMU in Ecos (fixed step), in a process of its own.

    Arguments are those of `run_fmpy` and of `finish_in_subprocess`. Outputs are what Ecos keeps
    after each step, with the inputs of that step; the first row is the end of initialization.

    Ecos ignores every status an FMU returns, whatever it is, and steps on. Here a message that the
    FMU logs with status Discard, Error or Fatal therefore counts as failure; an FMU that fails
    without a word goes unnoticed.

    Raises
    ------
    HostError
        When Ecos reports an error or crashes.
    ValueError
        When times are not equally spaced, or an input or output is not Real.
    """
    if importlib.util.find_spec("ecospy") is None:
        pytest.skip("ecospy is not installed")
    if os.name != "nt" and not _installed("tbb"):
        pytest.skip("ecospy needs the package tbb")
    time, columns = _table(times, inputs)
    step = _uniform_step("Ecos", time)
    description = fmpy.read_model_description(str(fmu), validate=False)
    _real_only("ecos", description, [*columns, *outputs])
    finished = finish_in_subprocess(
        _ecos,
        str(fmu),
        time,
        step,
        columns,
        list(outputs),
        _typed(description, parameters or {}),
        clean_exit=clean_exit,
    )
    if finished.returncode != 0 or ECOS_COMPLAINT.search(finished.output):
        raise HostError("Ecos", finished.returncode, finished.output)
    return finished.result


def _installed(package: str) -> bool:
    try:
        importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def _ecos(
    fmu: str,
    time: np.ndarray,
    step: float,
    columns: Result,
    outputs: list[str],
    parameters: dict[str, float | int | bool],
) -> Result:
    preload_tbb()
    from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure  # type: ignore[import-untyped]

    EcosLib.set_log_level("debug")  # Ecos shows messages of the FMU at this level only
    structure = EcosSimulationStructure()
    structure.add_model("instance", fmu)
    values: dict[str, Any] = {f"instance::{name}": v for name, v in parameters.items()}
    values |= {f"instance::{name}": float(column[0]) for name, column in columns.items()}
    structure.add_parameter_set("start", values)
    simulation = EcosSimulation(structure=structure, step_size=step)
    try:
        if not simulation.init(float(time[0]), "start"):
            raise RuntimeError(f"Ecos initialization failed: {EcosLib.get_last_error()}")
        table = {name: np.empty(len(time)) for name in outputs}
        for k in range(len(time)):
            for name in outputs:
                table[name][k] = simulation.get_real(f"instance::{name}")
            if k + 1 < len(time):
                for name, column in columns.items():
                    simulation.set_real(f"instance::{name}", float(column[k]))
                simulation.step()
        simulation.terminate()
    finally:
        simulation.free()
        structure.free()
    return table


# --- a host without Python
# ------------------------------------------------------------------------------------------


def shared_python() -> str:
    """Shared library of this Python; empty if there is none."""
    path = Path(
        sysconfig.get_config_var("LIBDIR") or "", sysconfig.get_config_var("LDLIBRARY") or ""
    )
    return str(path) if path.suffix != ".a" and path.is_file() else ""


def python_library() -> str:
    """Shared library of this Python, as ``PPY_LIBPYTHON`` wants it."""
    found = shared_python()
    if not found:
        pytest.skip("this Python has no shared library")
    return found


def compiler() -> str:
    """Path of gcc; skips the test when there is none."""
    found = shutil.which("gcc")
    if found is None:
        pytest.skip("gcc is not installed")
    return found


@functools.cache
def _c_host(version: int, machine: Machine) -> Path:
    """Compile the program for a version of FMI and a platform."""
    folder = Path(tempfile.mkdtemp(prefix="c_host_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    program = folder / "c_host.exe"  # a name that every platform runs
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", machine.target]
    command = [*(zig if machine.runners else [compiler()]), "-std=c99", "-O2", f"-DFMI={version}"]
    command += [f"-I{HEADERS}", str(TESTS / "c" / "c_host.c"), "-o", str(program)]
    subprocess.run([*command, *machine.libraries], check=True, capture_output=True)
    return program


def run_c_host(
    fmu: str | Path,
    times: Times,
    inputs: Series,
    outputs: Sequence[str],
    parameters: Mapping[str, float] | None = None,
    *,
    environment: Mapping[str, str] | None = None,
    machine: Machine = MACHINES["linux64"],
) -> Result:
    """Run an FMU of FMI 2.0 or 3.0 in a small C program (`c/c_host.c`), in whose process there is
    no Python unless the FMU brings it.

    Arguments and result are those of `run_fmpy` with its defaults: free spacing, outputs read after
    the inputs are set, stop time announced. `environment` adds variables to those of this process,
    and `machine` is the platform whose binary is run.

    Raises
    ------
    HostError
        With return code 2 when the library does not load, 3 without an instance, 4 when a call
        fails.
    """
    time, columns = _table(times, inputs)
    with extracted(fmu) as folder:
        description = fmpy.read_model_description(str(folder), validate=False)
        variables = _variables(description)

        def word(name: str) -> str:
            return f"{LETTER[variables[name].type]} {variables[name].valueReference}"

        plan = [str(len(parameters or {}))]
        plan += [f"{word(name)} {float(value)!r}" for name, value in (parameters or {}).items()]
        plan += [
            str(len(columns)),
            *map(word, columns),
            str(len(outputs)),
            *map(word, outputs),
            str(len(time)),
        ]
        plan += [
            " ".join(map(repr, row)) for row in np.column_stack([time, *columns.values()]).tolist()
        ]
        version = int(description.fmiVersion[0])
        binaries = folder / "binaries" / (machine.name if version == 2 else machine.tuple)
        library = binaries / f"{description.coSimulation.modelIdentifier}{machine.extension}"
        resources = folder / "resources"
        process = subprocess.run(
            [
                *machine.runner(),
                str(_c_host(version, machine)),
                str(library),
                description.guid,
                resources.as_uri() if version == 2 else f"{resources}/",
            ],
            input="\n".join(plan),
            capture_output=True,
            text=True,
            timeout=120,
            env={**os.environ, **(environment or {})},
        )
    if process.returncode != 0:
        raise HostError("the C host", process.returncode, process.stderr)
    rows = np.array([line.split() for line in process.stdout.splitlines()], dtype=float).reshape(
        len(time), len(outputs)
    )
    return {name: rows[:, i] for i, name in enumerate(outputs)}


# --- small FMUs
# --------------------------------------------------------------------------------------------------

ONE_STATE_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="OneState" guid="one-state" description="tau
    dx/dt = u - x">
  <CoSimulation modelIdentifier="one_state" canHandleVariableCommunicationStepSize="true"
      canGetAndSetFMUstate="true"
    canSerializeFMUstate="true" canNotUseMemoryManagementFunctions="true"
        providesDirectionalDerivative="true"/>
  <UnitDefinitions><Unit name="s"><BaseUnit s="1"/></Unit></UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="continuous"
        description="Input">
      <Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="x" valueReference="1" causality="output" variability="continuous"
        initial="exact"
      description="State"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="tau" valueReference="2" causality="parameter" variability="fixed"
        description="Time constant">
      <Real unit="s" start="1" min="0"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>
"""

MINIMAL_PYTHONFMU_SOURCE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Minimal(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 0.0
        self.x = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("x", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.x += step_size * (self.u - self.x)
        return True
"""


def build_one_state_fmu(directory: str | Path) -> Path:
    """Compile `c/one_state.c` into ``one_state.fmu``: ``tau dx/dt = u - x``, x(0) = 0, exact for
    held inputs.

    Variables: input ``u``, output ``x``, parameter ``tau`` (1 s).
    """
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="one_state_") as folder:
        library = Path(folder, "one_state.so")
        command = [compiler(), "-std=c99", "-O2", "-fPIC", "-shared", f"-I{HEADERS}"]
        command += [str(TESTS / "c" / "one_state.c"), "-o", str(library), "-lm"]
        subprocess.run(command, check=True, capture_output=True)
        path = directory / "one_state.fmu"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", ONE_STATE_DESCRIPTION)
            archive.write(library, f"binaries/{fmpy.platform}/one_state.so")
    return path


def build_pythonfmu(directory: str | Path, module_name: str, source: str, **options: Any) -> Path:
    """Build an FMU with stock pythonfmu from the source text of one module.

    In its own process, because the builder imports the module and extends ``sys.path``.
    """
    if importlib.util.find_spec("pythonfmu") is None:
        pytest.skip("pythonfmu is not installed")
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    script = directory / f"{module_name}.py"
    script.write_text(source)
    returncode, result = in_subprocess(_build_pythonfmu, str(script), str(directory), options)
    if returncode != 0:
        raise HostError("the pythonfmu builder", returncode, result)
    return Path(result)


def _build_pythonfmu(script: str, directory: str, options: dict[str, Any]) -> str:
    from pythonfmu.builder import FmuBuilder

    return str(FmuBuilder.build_FMU(script, dest=directory, **options))


def build_minimal_pythonfmu(directory: str | Path) -> Path:
    """Build the smallest stock pythonfmu slave: input ``u``, output ``x``, explicit Euler of
    ``dx/dt = u - x``.
    """
    return build_pythonfmu(directory, "minimal", MINIMAL_PYTHONFMU_SOURCE)
