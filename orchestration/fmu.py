"""Running one co-simulation FMU, anybody's: open it, feed it, read it; every failure is one readable line."""

from __future__ import annotations

import ctypes
import math
import os
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any
from xml.etree import ElementTree

import fmpy
import fmpy.fmi2 as fmi2
import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu_log import MessageLog

Array = NDArray[np.float64]
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")


def read_description(path: Path) -> Any:
    """Read an FMU's model description.

    Parameters
    ----------
    path : Path

    Returns
    -------
    fmpy.model_description.ModelDescription

    Raises
    ------
    UserError
        If the file is missing, no zip, no FMU, or not FMI 2.0 for co-simulation.
    """
    if not path.is_file():
        raise UserError(f"{path}: {'a folder, not an FMU file' if path.is_dir() else 'no such file'}")
    if not zipfile.is_zipfile(path):
        raise UserError(f"{path}: not an FMU (an FMU is a zip archive; this is not one)")
    with zipfile.ZipFile(path) as archive:
        if "modelDescription.xml" not in archive.namelist():
            raise UserError(f"{path}: a zip archive but not an FMU (modelDescription.xml is not in it)")
    try:
        with zipfile.ZipFile(path) as archive:
            version = ElementTree.fromstring(archive.read("modelDescription.xml")).get("fmiVersion", "")
        if not version.startswith("2."):
            raise UserError(f"{path}: FMI version {version or 'not stated'}; this program runs FMI 2.0")
        # the outer form only: `ppy check` is there for the rest
        description = fmpy.read_model_description(str(path), validate=False)
    except UserError:
        raise
    except Exception as error:
        raise UserError(f"{path}: modelDescription.xml cannot be read ({_first_line(error)})") from error
    if description.coSimulation is None:
        raise UserError(f"{path}: an FMU for model exchange only; this program runs co-simulation")
    return description


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


class Fmu:
    """One instance of an FMU; a context manager that frees it and removes its unzipped folder.

    Parameters
    ----------
    path : Path
        The ``.fmu`` file.
    parameters : Mapping[str, float], optional
        Start values by name, in the FMU's units.

    Raises
    ------
    UserError
        If it cannot be opened on this machine, refuses to start, or has no variable of a given name.

    Attributes
    ----------
    description : fmpy.model_description.ModelDescription
    variables : dict
        Scalar variables by name.
    """

    def __init__(self, path: Path, parameters: Mapping[str, float] | None = None):
        self.path = path
        self.parameters = dict(parameters or {})
        self.description = read_description(path)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self._log = MessageLog()
        self._folder: str | None = None
        self._slave: Any = None

    @property
    def messages(self) -> list[str]:
        """What the FMU logged, warnings and worse, newest last."""
        return self._log.messages

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return [v.name for v in self.description.modelVariables if v.causality == "input"]

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return [v.name for v in self.description.modelVariables if v.causality == "output"]

    def __enter__(self) -> Fmu:
        self._check_platform()
        self._folder = tempfile.mkdtemp(prefix="ppy-fmu-")
        here = Path.cwd()
        try:
            fmpy.extract(str(self.path), self._folder)
            self._instantiate()
        except BaseException as error:
            os.chdir(here)  # where loading fails, fmpy leaves the process in the folder that is removed now
            self.close()
            if isinstance(error, UserError) or not isinstance(error, Exception):
                raise
            raise UserError(f"{self.path}: cannot be loaded ({self._reason(error)})") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _check_platform(self) -> None:
        with zipfile.ZipFile(self.path) as archive:
            there = sorted(
                {
                    name.split("/")[1]
                    for name in archive.namelist()
                    if name.startswith("binaries/") and name.count("/") > 1
                }
            )
        if fmpy.platform not in there:
            raise UserError(f"{self.path}: no binary for {fmpy.platform}; it has {', '.join(there) or 'none'}")

    def _instantiate(self) -> None:
        self._slave = fmi2.FMU2Slave(
            guid=self.description.guid, unzipDirectory=self._folder, instanceName=self.description.modelName,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )  # fmt: skip
        self._slave.instantiate(callbacks=self._log.callbacks)

    def start(self, time: float = 0.0, stop: float | None = None) -> None:
        """Set the parameters and initialize.

        Parameters
        ----------
        time, stop : float
            Start time, and stop time if there is one, in seconds.

        Raises
        ------
        UserError
            With the FMU's own message if it refuses.
        """
        self._checked("setup", self._slave.setupExperiment, None, time, stop)
        for name, value in self.parameters.items():
            self._set_parameter(name, value)
        self._checked("initialization", self._slave.enterInitializationMode)
        self._checked("initialization", self._slave.exitInitializationMode)

    def _set_parameter(self, name: str, value: float) -> None:
        variable = self._variable(name)
        if variable.causality not in ("parameter", "input"):
            raise UserError(
                f"{self.path.name}: {name} is {variable.causality or 'local'}, only parameters and inputs can be set"
            )
        self._checked(f"setting {name}", self._setter(variable.type), [variable.valueReference], [value])

    def _setter(self, kind: str) -> Callable[..., None]:
        setters = {"Real": self._slave.setReal, "Boolean": self._slave.setBoolean}
        if kind not in setters:
            return lambda references, values: self._slave.setInteger(references, [int(v) for v in values])
        return setters[kind]

    def _variable(self, name: str) -> Any:
        if name not in self.variables:
            raise UserError(f"{self.path.name}: no variable named {name!r}{suggestion(name, self.variables)}")
        return self.variables[name]

    def _checked(self, doing: str, call: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return call(*arguments)
        except Exception as error:
            raise UserError(f"{self.path.name}: {doing} failed: {self._reason(error)}") from error

    def _reason(self, error: Exception) -> str:
        return self._log.last(otherwise=_first_line(error))

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        outputs: Sequence[str] | None = None,
        progress: Callable[[int], None] = lambda done: None,
    ) -> dict[str, Array]:
        """Simulate over given communication points, from a started instance.

        Inputs are set at every point and held until the next; outputs are read at every point *after* its inputs
        are set, so that a direct feedthrough shows at once.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Communication points in seconds, increasing.
        inputs : Mapping[str, ndarray]
            Values of shape (n,) by input name, in the FMU's units.
        outputs : sequence of str, optional
            Which variables to read; default every output.
        progress : callable
            Told the number of points done, now and then.

        Returns
        -------
        dict of str to ndarray, shape (n,)

        Raises
        ------
        UserError
            If a step fails or is discarded, with the time and the FMU's message; nothing shorter is returned.
        """
        names = list(self.outputs if outputs is None else outputs)
        for name in inputs:
            if self._variable(name).causality != "input":
                raise UserError(
                    f"{self.path.name}: {name} is not an input; inputs are {', '.join(self.inputs) or 'none'}"
                )
        feed, read = self._transfer("Set", list(inputs)), self._transfer("Get", names)
        table = (
            np.column_stack([np.asarray(inputs[n], dtype=float) for n in inputs])
            if inputs
            else np.empty((len(time), 0))
        )
        result = np.full((len(time), len(names)), math.nan)
        step = self._function("fmi2DoStep", ctypes.c_double, ctypes.c_double, ctypes.c_int)
        every = max(1, len(time) // 200)
        points = time.tolist()
        last = len(points) - 1
        for k, now in enumerate(points):
            feed(table[k])
            read(result[k])
            if k == last:
                break
            status = step(self._slave.component, now, points[k + 1] - now, 1)
            if status > fmi2.fmi2Warning:
                label = _STATUS[status] if status < len(_STATUS) else str(status)
                text = self._log.last(otherwise="no message")
                raise UserError(f"{self.path.name}: step from {now:g} s returned {label}: {text}")
            if k % every == 0:
                progress(k)
        progress(len(time))
        return {name: result[:, i] for i, name in enumerate(names)}

    def _function(self, name: str, *arguments: Any) -> Callable[..., int]:
        """Return an FMI function without fmpy's bookkeeping around every call."""
        function = self._slave.dll[name]  # a new object each time, so that argtypes are ours
        function.argtypes = [ctypes.c_void_p, *arguments]
        function.restype = ctypes.c_int
        return function

    def _transfer(self, verb: str, names: list[str]) -> Callable[[Array], None]:
        """Move values between a row of doubles and the FMU, with one call for each type in it."""
        kinds: dict[str, list[int]] = {}
        for position, name in enumerate(names):
            kind = {"Enumeration": "Integer"}.get(self._variable(name).type, self._variable(name).type)
            if kind == "String":
                raise UserError(f"{self.path.name}: {name} is text and cannot be read as a number")
            kinds.setdefault(kind, []).append(position)
        plans = []
        for kind, positions in kinds.items():
            count, ctype = len(positions), ctypes.c_double if kind == "Real" else ctypes.c_int
            references = (ctypes.c_uint * count)(*(self.variables[names[p]].valueReference for p in positions))
            call = self._function(f"fmi2{verb}{kind}", ctypes.c_uint * count, ctypes.c_size_t, ctype * count)
            plans.append((call, kind, positions, references, (ctype * count)()))

        def transfer(row: Array) -> None:
            for call, kind, positions, references, values in plans:
                if verb == "Set":
                    values[:] = [row[p] if kind == "Real" else int(row[p]) for p in positions]
                if call(self._slave.component, references, len(positions), values) > fmi2.fmi2Warning:
                    text = self._log.last(otherwise="no message")
                    raise UserError(
                        f"{self.path.name}: {'setting inputs' if verb == 'Set' else 'reading outputs'} failed: {text}"
                    )
                if verb == "Get":
                    row[positions] = values[:]

        return transfer

    def close(self) -> None:
        """Free the instance and remove the unzipped folder."""
        if self._slave is not None:
            if getattr(self._slave, "component", None) is not None:
                self._slave.fmi2FreeInstance(self._slave.component)
            self._slave.freeLibrary()
            self._slave = None
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None


def suggestion(name: str, known: Mapping[str, Any] | Sequence[str]) -> str:
    """``; did you mean R1?`` if something known is near, else the known names if they are few."""
    import difflib

    near = difflib.get_close_matches(name, list(known), 1, 0.5)
    if near:
        return f"; did you mean {near[0]}?"
    return f"; there are {', '.join(known)}" if len(known) <= 20 else ""
