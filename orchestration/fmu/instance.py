"""Running one co-simulation FMU, anybody's: open it, feed it, read it; every failure is one readable line."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

import fmpy.fmi2 as fmi2
import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError, suggestion
from fmus.kit.storage import scratch
from orchestration.fmu.archive import first_line, read_description, unpack
from orchestration.fmu.calls import Transfer, bind, transfers
from orchestration.fmu.log import MessageLog
from orchestration.fmu.signal import Value, check_type, is_text, type_of

Array = NDArray[np.float64]
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")


class Fmu:
    """One instance of an FMU; a context manager that frees it and removes its unzipped folder.

    Parameters
    ----------
    path : Path
        The ``.fmu`` file.
    parameters : Mapping[str, float | str], optional
        Start values by name, in the FMU's units; texts for strings.
    name : str, optional
        Of the instance; default the model's.
    folder : str, optional
        Where it is unzipped already, for several instances; it stays.

    Raises
    ------
    UserError
        If it cannot be opened on this machine, refuses to start, or has no variable of a given name.

    Attributes
    ----------
    description : fmpy.model_description.ModelDescription
    variables : dict
        Scalar variables by name.
    warnings : int
        How many calls ended with a warning.
    corrupted : bool
        Whether one ended as fatal: it must not be called again.
    """

    def __init__(
        self,
        path: Path,
        parameters: Mapping[str, Value] | None = None,
        name: str | None = None,
        folder: str | None = None,
    ):
        self.path = path
        self.parameters = dict(parameters or {})
        self.description = read_description(path)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.name = name or self.description.modelName
        self._log = MessageLog()
        self._shared, self._folder = folder, folder
        self._slave: Any = None
        self.warnings = 0
        self.corrupted = False

    @property
    def complaints(self) -> str:
        """What the FMU had to say although no call failed, in one line; empty if nothing."""
        last = self._log.last("no message" if self.warnings else "")
        return f"{self.warnings} calls ended with a warning ({last})" if self.warnings else last

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return [v.name for v in self.description.modelVariables if v.causality == "input"]

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return [v.name for v in self.description.modelVariables if v.causality == "output"]

    def __enter__(self) -> Fmu:
        try:
            self._folder = self._shared or unpack(self.path)
            self._instantiate()
        except BaseException as error:
            self.close()
            if isinstance(error, UserError) or not isinstance(error, Exception):
                raise
            reason = self._log.last(otherwise=first_line(error))
            raise UserError(f"{self.path}: cannot be loaded ({reason})") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _instantiate(self) -> None:
        here = Path.cwd()
        try:
            self._slave = fmi2.FMU2Slave(
                guid=self.description.guid, unzipDirectory=self._folder, instanceName=self.name,
                modelIdentifier=self.description.coSimulation.modelIdentifier,
            )  # fmt: skip
        finally:
            os.chdir(here)  # where loading fails, fmpy leaves the process in the unzipped folder
        self._slave.instantiate(callbacks=self._log.callbacks)
        self._setters: dict[str, Callable[[Array], None]] = {}  # to make one costs ten times what setting a value does
        self._do_step = bind(self._slave.dll, "fmi2DoStep", ctypes.c_double, ctypes.c_double, ctypes.c_int)

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
        self.enter_initialization(time, stop)
        self.exit_initialization()

    def enter_initialization(self, time: float = 0.0, stop: float | None = None) -> None:
        """Do the first part of `start`; until `exit_initialization`, inputs and outputs can be exchanged."""
        self._checked("setup", self._slave.setupExperiment, None, time, stop)
        for name, value in self.parameters.items():
            variable, where = self.variable(name), f"{self.path.name}: {name}"
            if (role := variable.causality or "local") not in ("parameter", "input"):
                raise UserError(f"{where} is {role}, only parameters and inputs can be set")
            if is_text(type_of(variable), value, where):
                self._checked(f"setting {name}", self._slave.setString, [variable.valueReference], [value])
            else:
                (self._setters.get(name) or self._setters.setdefault(name, self.writer([name])))(np.array([value]))
        self._checked("initialization", self._slave.enterInitializationMode)

    def exit_initialization(self) -> None:
        """Do the second part of `start`."""
        self._checked("initialization", self._slave.exitInitializationMode)

    def bound(self, function: str, *arguments: Any) -> partial[int]:
        """Return a call of an FMI function of this instance that costs as little as Python can make it.

        Parameters
        ----------
        function : str
            Name in the FMI standard.
        *arguments
            All arguments but the component: ctypes objects of exactly the right types, whose values are read anew at
            each call. Nothing is converted or checked.

        Returns
        -------
        functools.partial
            Returns the FMI status, which `failed` puts into words.

        Raises
        ------
        UserError
            If the FMU lacks the function.
        """
        try:
            bound = self._slave.dll[function]  # a new object each time, without types to convert to
        except AttributeError as error:
            raise UserError(f"{self.path.name}: its library lacks the function {function}") from error
        return partial(bound, ctypes.c_void_p(self._slave.component), *arguments)

    def variable(self, name: str) -> Any:
        """Scalar variable of a name; UserError if there is none."""
        if name not in self.variables:
            raise UserError(f"{self.path.name}: no variable named {name!r}{suggestion(name, self.variables)}")
        return self.variables[name]

    def _checked(self, doing: str, call: Callable[..., Any], *arguments: Any) -> Any:
        try:
            result = call(*arguments)
            self.warnings += result == fmi2.fmi2Warning
            return result
        except Exception as error:
            self.corrupted |= getattr(error, "status", None) == fmi2.fmi2Fatal
            reason = self._log.last(otherwise=first_line(error))
            raise UserError(f"{self.path.name}: {doing} failed: {reason}") from error

    def step(self, time: float, size: float) -> None:
        """Make a communication step.

        Parameters
        ----------
        time, size : float
            Where it begins and how long it is, in seconds.

        Raises
        ------
        UserError
            If the FMU fails or discards it, with the FMU's message.
        """
        status = self._do_step(self._slave.component, time, size, 1)
        if status > fmi2.fmi2Warning:
            raise self.failed(f"step from {time:g} s", status)
        self.warnings += status

    def save(self) -> Any:
        """Return a copy of the whole state, to `restore` any number of times and to `release` in the end.

        Raises
        ------
        UserError
            If the FMU cannot.
        """
        if self.description.coSimulation.canGetAndSetFMUstate:
            return self._checked("saving the state", self._slave.getFMUstate)
        raise UserError(f"{self.path.name}: cannot save its state (canGetAndSetFMUstate is false)")

    def restore(self, state: Any) -> None:
        """Go back to a saved state; UserError if the FMU refuses."""
        self._checked("restoring a state", self._slave.setFMUstate, state)

    def release(self, state: Any) -> None:
        """Free a saved state; UserError if the FMU refuses."""
        self._checked("releasing a state", self._slave.freeFMUstate, state)

    def writer(self, names: Sequence[str]) -> Callable[[Array], None]:
        """Return a function that sets variables to a row of numbers, one for each name.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        callable
            Takes an array of shape (n,); UserError if the FMU refuses, or a type cannot hold its value.
        """
        prepared = self._transfers("Set", names)

        def write(row: Array) -> None:
            for call, kind, own, where, references, values in prepared:
                chosen = row[where].tolist()
                if kind != "real":
                    for name, value in zip(own, chosen, strict=True):
                        check_type(kind, value, f"{self.path.name}: {name}")
                    chosen = [int(value) for value in chosen]
                values[:] = chosen
                status = call(self._slave.component, references, len(values), values)
                if status > fmi2.fmi2Warning:
                    raise self.failed(f"setting {', '.join(names)}", status)
                self.warnings += status

        return write

    def reader(self, names: Sequence[str]) -> Callable[[Array], None]:
        """Return a function that fills a row of numbers with the values of variables.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        callable
            Takes an array of shape (n,); UserError if the FMU refuses.
        """
        prepared = self._transfers("Get", names)

        def read(row: Array) -> None:
            for call, _, _, where, references, values in prepared:
                status = call(self._slave.component, references, len(values), values)
                if status > fmi2.fmi2Warning:
                    raise self.failed(f"reading {', '.join(names)}", status)
                self.warnings += status
                row[where] = values[:]

        return read

    def slope_writer(self, names: Sequence[str]) -> Callable[[Array], None]:
        """Return a function that lets real inputs change linearly over the next step, given their slopes.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        callable
            Takes an array of shape (n,) in the FMU's units per second; UserError if the FMU refuses.
        """
        count = len(names)
        references = (ctypes.c_uint * count)(*(self.variable(name).valueReference for name in names))
        orders, slopes = (ctypes.c_int * count)(*[1] * count), (ctypes.c_double * count)()
        types = ctypes.c_uint * count, ctypes.c_size_t, ctypes.c_int * count, ctypes.c_double * count
        call = bind(self._slave.dll, "fmi2SetRealInputDerivatives", *types)

        def write(row: Array) -> None:
            slopes[:] = row.tolist()
            status = call(self._slave.component, references, count, orders, slopes)
            if status > fmi2.fmi2Warning:
                raise self.failed(f"setting the slopes of {', '.join(names)}", status)
            self.warnings += status

        return write

    def _transfers(self, verb: str, names: Sequence[str]) -> list[Transfer]:
        return transfers(self._slave.dll, verb, names, {name: self.variable(name) for name in names})

    def failed(self, doing: str, status: int, remark: str = "") -> UserError:
        """Say what a status worse than a warning means; after `fatal` the instance is never called again.

        Parameters
        ----------
        doing : str
            What it was asked to do.
        status : int
            What it returned.
        remark : str
            More about it.

        Returns
        -------
        UserError
        """
        self.corrupted |= status == fmi2.fmi2Fatal
        returned = dict(enumerate(_STATUS)).get(status, f"status {status}")
        return UserError(f"{self.path.name}: {doing} failed ({returned}{remark}): {self._log.last('no message')}")

    def close(self) -> None:
        """Free the instance, unless it is corrupted, and remove the unzipped folder."""
        if self.corrupted:
            self._slave = None  # freeing it, or unloading its library, may crash the process
        if self._slave is not None:
            if getattr(self._slave, "component", None) is not None:
                self._slave.fmi2FreeInstance(self._slave.component)
            self._slave.freeLibrary()
            self._slave = None
        if self._folder is not None and self._folder != self._shared:
            scratch.remove(self._folder)
        self._folder = self._shared
