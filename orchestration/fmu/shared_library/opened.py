"""An FMU opened and closed: unpacked, loaded, instantiated; its functions, and its failures in words."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import fmpy.fmi2 as fmi2
import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError, suggestion
from fmus.kit.storage import scratch
from orchestration.fmu.archive import first_line, read_description, unpack
from orchestration.fmu.isolation.box import doing, noted
from orchestration.fmu.shared_library import endings
from orchestration.fmu.shared_library.calls import bind
from orchestration.fmu.shared_library.log import MessageLog
from orchestration.fmu.signal import Value

Array = NDArray[np.float64]
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")


class OpenedFmu:
    """An instance of an FMU, and what it takes to have one; a context manager.

    Its parameters, attributes and errors are those of :class:`orchestration.fmu.instance.Fmu`.
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
        self.label = f"{name}: {path.name}" if name else path.name
        self._log, self._here = MessageLog(), ""
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

    def __enter__(self) -> Self:
        try:
            self._here = os.getcwd()
            self._folder = self._shared or unpack(self.path)
            endings.opened(self.label)
            with doing(f"{self.label}: loading"):
                self._instantiate()
        except BaseException as error:
            self.close()
            if isinstance(error, UserError) or not isinstance(error, Exception):
                raise
            reason = self._log.last(otherwise=first_line(error))
            raise UserError(f"{self.path}: cannot be loaded ({reason})") from error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _instantiate(self) -> None:
        try:
            self._slave = fmi2.FMU2Slave(
                guid=self.description.guid,
                unzipDirectory=self._folder,
                instanceName=self.name,
                modelIdentifier=self.description.coSimulation.modelIdentifier,
            )
        finally:
            os.chdir(
                self._here
            )  # where loading fails, fmpy leaves the process in the unzipped folder
        self._slave.instantiate(callbacks=self._log.callbacks)
        self._setters: dict[
            str, Callable[[Array], None]
        ] = {}  # to make one costs ten times what setting a value does
        step = bind(self._slave.dll, "fmi2DoStep", ctypes.c_double, ctypes.c_double, ctypes.c_int)
        self._do_step = noted(step, self.label, "step")

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
            raise UserError(
                f"{self.path.name}: its library lacks the function {function}"
            ) from error
        return noted(
            partial(bound, ctypes.c_void_p(self._slave.component), *arguments), self.label, function
        )

    def variable(self, name: str) -> Any:
        """Scalar variable of a name; UserError if there is none."""
        if name not in self.variables:
            raise UserError(
                f"{self.path.name}: no variable named {name!r}{suggestion(name, self.variables)}"
            )
        return self.variables[name]

    def _checked(self, what: str, call: Callable[..., Any], *arguments: Any) -> Any:
        try:
            with doing(f"{self.label}: {what}"):
                result = call(*arguments)
            self.warnings += result == fmi2.fmi2Warning
            return result
        except Exception as error:
            self.corrupted |= getattr(error, "status", None) == fmi2.fmi2Fatal
            reason = self._log.last(otherwise=first_line(error))
            raise UserError(f"{self.path.name}: {what} failed: {reason}") from error

    def failed(self, what: str, status: int, remark: str = "") -> UserError:
        """Say what a status worse than a warning means; after `fatal` the instance is never called again.

        Parameters
        ----------
        what : str
            It was asked to do.
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
        return UserError(
            f"{self.path.name}: {what} failed ({returned}{remark}): {self._log.last('no message')}"
        )

    def close(self) -> None:
        """Free the instance, unless it is corrupted, and remove the unzipped folder."""
        if self.corrupted:
            self._slave = None  # freeing it, or unloading its library, may crash the process
        if self._slave is not None:
            with doing(f"{self.label}: freeing"):
                if getattr(self._slave, "component", None) is not None:
                    self._slave.fmi2FreeInstance(self._slave.component)
                self._slave.freeLibrary()
            self._slave = None
        endings.closed(self.label)
        if self._here:
            os.chdir(self._here)  # where the FMU may have gone to, nobody else wants to be
        if self._folder is not None and self._folder != self._shared:
            scratch.remove(self._folder)
        self._folder = self._shared
