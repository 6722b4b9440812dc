"""One instance of a co-simulation FMU: loading, initialization, steps, values and freeing.

Every failure is a UserError of one line. FMI functions are called through ctypes directly, because
the overhead of fmpy at every call would slow down thousands of steps.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import fmpy.fmi2 as fmi2
import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from fmus.kit.storage import scratch
from orchestration.fmu import exit_notice
from orchestration.fmu.archive import first_line, read_description, unpack
from orchestration.fmu.isolation import activity, noting
from orchestration.fmu.message_log import MessageLog
from orchestration.fmu.signal import Value, check_type, is_text, type_of
from orchestration.records.tables import Words

_C_TYPES: Mapping[str, Any] = {
    "real": ctypes.c_double,
    "integer": ctypes.c_int,
    "boolean": ctypes.c_int,
    "string": ctypes.c_char_p,
}
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")


class EndRequested(UserError):
    """Raised when an FMU discards a step because it asks to end the simulation.

    Attributes
    ----------
    reached : float or None
        Time in s at which its values are; None if the FMU does not say.
    """

    def __init__(self, message: str, reached: float | None):
        super().__init__(message)
        self.reached = reached


class ValueTransfer(NamedTuple):
    """A call that sets or gets all variables of one type from or into a row of numbers.

    Attributes
    ----------
    call : callable
        The FMI function.
    kind : str
        Type of the variables.
    names : list of str
    row : slice or list of int
        Indices of the values in the row; a slice if they are contiguous, which takes a fifth of
        the time.
    references, values : ctypes array
        Arguments of the call.
    """

    call: Callable[..., int]
    kind: str
    names: list[str]
    row: slice | list[int]
    references: Any
    values: Any


def bind_function(library: Any, name: str, *arguments: Any) -> Callable[..., int]:
    """Return an FMI function of a library, with the types of its arguments after the component."""
    # indexing returns a new object, whose argument types are not shared
    function: Callable[..., int] = library[name]
    function.argtypes = [ctypes.c_void_p, *arguments]  # type: ignore[attr-defined]
    function.restype = ctypes.c_int  # type: ignore[attr-defined]
    return function


def positions_by_type(names: Sequence[str], variables: Mapping[str, Any]) -> dict[str, list[int]]:
    """Return the positions of variables among names by type, in the order of the calls."""
    positions_of: dict[str, list[int]] = {}
    for position, name in enumerate(names):
        positions_of.setdefault(type_of(variables[name]), []).append(position)
    return positions_of


def prepare_transfers(
    library: Any, verb: str, names: Sequence[str], variables: Mapping[str, Any]
) -> list[ValueTransfer]:
    """Return calls that set or get variables, one for each type.

    Parameters
    ----------
    library : ctypes.CDLL
        The shared library of the FMU.
    verb : {"Set", "Get"}
    names : sequence of str
    variables : Mapping[str, fmpy.model_description.ScalarVariable]

    Returns
    -------
    list of ValueTransfer
    """
    transfers = []
    for kind, positions in positions_by_type(names, variables).items():
        count = len(positions)
        typed_names = [names[position] for position in positions]
        value_references = [variables[name].valueReference for name in typed_names]
        references = (ctypes.c_uint * count)(*value_references)
        array = _C_TYPES[kind] * count
        function = f"fmi2{verb}{kind.capitalize()}"
        call = bind_function(library, function, ctypes.c_uint * count, ctypes.c_size_t, array)
        is_contiguous = positions[-1] - positions[0] == count - 1
        row = slice(positions[0], positions[0] + count) if is_contiguous else positions
        transfers.append(ValueTransfer(call, kind, typed_names, row, references, array()))
    return transfers


class Fmu:
    """One instance of an FMU; a context manager that loads and frees it.

    Parameters
    ----------
    path : Path
        The ``.fmu`` file.
    parameters : Mapping[str, float | str], optional
        Start values by name, in the FMU's units; texts for strings.
    name : str, optional
        Name of the instance; default that of the model.
    folder : str, optional
        Folder of the unzipped FMU, shared by several instances and not removed; default a new
        folder.
    tolerance : float, optional
        Relative tolerance of its integration; default the declared one.
    calls : Path, optional
        File to which its calls are appended, a line each.

    Raises
    ------
    UserError
        If the FMU cannot be opened on this machine, refuses to start, or has no variable of a
        given name.

    Attributes
    ----------
    description : fmpy.model_description.ModelDescription
    variables : dict
        Scalar variables by name.
    warnings : int
        Number of calls that returned a warning.
    corrupted : bool
        Whether a call returned fatal, after which the instance must not be called again.
    label : str
        Name of the instance in messages about several FMUs.
    words : Words
        Numbers that stand for texts in rows of values.
    """

    def __init__(
        self,
        path: Path,
        parameters: Mapping[str, Value] | None = None,
        name: str | None = None,
        folder: str | None = None,
        tolerance: float | None = None,
        calls: Path | None = None,
    ):
        self.path = path
        self.parameters = dict(parameters or {})
        self.description = read_description(path)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.name = name or self.description.modelName
        self.label = f"{name}: {path.name}" if name else path.name
        self._log = MessageLog()
        self._working_folder = ""
        self._shared_folder = folder
        self._folder = folder
        self._calls = calls
        self._slave: Any = None
        declared = float(getattr(self.description.defaultExperiment, "tolerance", None) or 0.0)
        self._tolerance = tolerance or declared or None
        self._is_initialized = False
        self.warnings = 0
        self.corrupted = False
        self.words = Words()

    @property
    def complaints(self) -> str:
        """Text with the number of warnings and the last messages; empty if there are none."""
        last = self._log.last("no message" if self.warnings else "")
        return f"{self.warnings} calls ended with a warning ({last})" if self.warnings else last

    @property
    def runs_once(self) -> bool:
        """True if a process can have one instance only (canBeInstantiatedOnlyOncePerProcess)."""
        return bool(self.description.coSimulation.canBeInstantiatedOnlyOncePerProcess)

    @property
    def identity(self) -> tuple[str, str]:
        """The model identifier and the GUID, which are those of every copy of the file."""
        return self.description.coSimulation.modelIdentifier, self.description.guid

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return [v.name for v in self.description.modelVariables if v.causality == "input"]

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return [v.name for v in self.description.modelVariables if v.causality == "output"]

    # --- opening and closing

    def __enter__(self) -> Self:
        try:
            self._working_folder = os.getcwd()
            self._folder = self._shared_folder or unpack(self.path, self._calls)
            exit_notice.note_opened(self.label)
            with activity(f"{self.label}: loading"):
                self._instantiate()
        except BaseException as error:
            self.close()
            if isinstance(error, UserError) or not isinstance(error, Exception):
                raise
            reason = self._log.last(otherwise=first_line(error))
            raise UserError(f"{self.path}: cannot be loaded ({reason})") from error
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()

    def _instantiate(self) -> None:
        try:
            self._slave = self._load()
        finally:
            # fmpy changes it, also if loading fails
            os.chdir(self._working_folder)
        self._slave.instantiate(callbacks=self._log.callbacks)
        # by names; making a setter takes ten times as long as calling it
        self._setters: dict[tuple[str, ...], Callable[[Array], None]] = {}
        self._plain_calls: dict[str, Callable[[], int]] = {}

    def _load(self) -> Any:
        """Return the library as fmpy binds it for the interface of this class."""
        slave = fmi2.FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self._folder,
            instanceName=self.name,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )
        step = bind_function(
            slave.dll, "fmi2DoStep", ctypes.c_double, ctypes.c_double, ctypes.c_int
        )
        self._do_step = noting(step, self.label, "step")
        return slave

    def close(self) -> None:
        """Terminate and free the instance, unless it is corrupted; remove the unzipped folder."""
        with suppress(UserError):  # who wants to know of a refusal has terminated it before
            self.terminate()
        if self.corrupted:
            self._slave = None  # freeing it, or unloading its library, may crash the process
        if self._slave is not None:
            with activity(f"{self.label}: freeing"):
                if getattr(self._slave, "component", None) is not None:
                    self._slave.fmi2FreeInstance(self._slave.component)
                self._slave.freeLibrary()
            self._slave = None
        exit_notice.note_closed(self.label)
        if self._working_folder:
            os.chdir(self._working_folder)  # the FMU may have changed it
        if self._folder is not None and self._folder != self._shared_folder:
            scratch.remove(self._folder)
        self._folder = self._shared_folder

    # --- initialization

    def start(
        self,
        time: float = 0.0,
        stop: float | None = None,
        inputs: Mapping[str, Value] = MappingProxyType({}),
    ) -> None:
        """Set the parameters and the first values of inputs, and initialize.

        Parameters
        ----------
        time, stop : float
            Start time, and stop time if there is one, in seconds.
        inputs : Mapping of str to float or str
            Values at the start time, from which an FMU may compute its start state.

        Raises
        ------
        UserError
            With the FMU's own message if it refuses.
        """
        self.enter_initialization(time, stop)
        if inputs:
            row = [self.in_numbers(name, [value])[0] for name, value in inputs.items()]
            self._setter(tuple(inputs))(np.array(row))
        self.exit_initialization()

    def enter_initialization(self, time: float = 0.0, stop: float | None = None) -> None:
        """Set the parameters and enter initialization mode, in which values can be exchanged.

        Inputs are set in that mode, and not before (FMI 2.0.4, table of 4.2.4).
        """
        self._checked("setup", self._slave.setupExperiment, self._tolerance, time, stop)
        inputs = [name for name in self.parameters if self._causality(name) == "input"]
        for name in self.parameters:
            if name not in inputs:
                self._set_start_value(name)
        self._changed_mode("fmi2EnterInitializationMode")
        for name in inputs:
            self._set_start_value(name)

    def _causality(self, name: str) -> str:
        """Return the causality of a variable that is to be set; UserError if it cannot be."""
        variable = self.variable(name)
        causality = str(variable.causality or "local")
        is_start = variable.initial in ("exact", "approx") and variable.variability != "constant"
        if causality not in ("parameter", "input") and not is_start:
            raise UserError(
                f"{self.path.name}: {name} is {causality}, only parameters, inputs and start values"
                " can be set"
            )
        return causality

    def _set_start_value(self, name: str) -> None:
        """Set a parameter or input to its start value; UserError if it is of another type."""
        self._setter((name,))(self.in_numbers(name, [self.parameters[name]]))

    def _setter(self, names: tuple[str, ...]) -> Callable[[Array], None]:
        """Return the function that sets variables, which is kept."""
        if names not in self._setters:
            self._setters[names] = self.writer(names)
        return self._setters[names]

    def exit_initialization(self) -> None:
        """Exit initialization mode."""
        self._changed_mode("fmi2ExitInitializationMode")
        self._is_initialized = True

    def _changed_mode(self, function: str) -> None:
        """Enter or exit initialization mode; UserError with the FMU's message if it refuses."""
        status = self._plain(function)()
        if status > fmi2.fmi2Warning:
            self._note_failure(status)
            reason = self._log.last(otherwise=f"{function} failed with status {status}")
            raise UserError(f"{self.path.name}: initialization failed: {reason}")
        self.warnings += status

    def _plain(self, function: str) -> Callable[[], int]:
        """Return a function without arguments, which is bound once: many runs call it."""
        if function not in self._plain_calls:
            self._plain_calls[function] = self.bound(function)
        return self._plain_calls[function]

    # --- end of a run

    def terminate(self) -> None:
        """End the run of an initialized instance, which may write its last results then.

        After an error FMI allows only a reset and the freeing (FMI 2.0.4, table of 4.2.4), and
        nothing is called.

        Raises
        ------
        UserError
            If the FMU refuses.
        """
        if not self._is_initialized:
            return
        self._is_initialized = False
        status = self._plain("fmi2Terminate")()
        if status > fmi2.fmi2Warning:
            raise self.failed("termination", status)
        self.warnings += status

    def reset(self) -> bool:
        """Terminate a run and reset the instance; return whether the FMU has accepted that."""
        with suppress(UserError):
            self.terminate()
        if self.corrupted:
            return False
        status = self._plain("fmi2Reset")()
        if status > fmi2.fmi2Warning:
            self.failed("reset", status)
            return False
        return True

    # --- steps and states

    def step(self, time: float, size: float) -> None:
        """Make a communication step.

        Parameters
        ----------
        time, size : float
            Start and size of the step in seconds.

        Raises
        ------
        UserError
            If the FMU fails or discards the step, with the FMU's message.
        """
        status = self._do_step(self._slave.component, time, size, 1)
        if status > fmi2.fmi2Warning:
            raise self.step_failed(time, status)
        self.warnings += status

    def step_failed(self, time: float, status: int) -> UserError:
        """Return the error for a step from a time in s that returned discard, error or fatal."""
        if status != fmi2.fmi2Discard or not self.asks_to_end():
            return self.failed(f"step from {time:g} s", status)
        return EndRequested(
            f"{self.path.name}: asks to end the simulation in place of a step from {time:g} s:"
            f" {self._log.last('no message')}",
            self.last_time(),
        )

    def last_time(self) -> float | None:
        """Return the time in s that the FMU says it has reached; None if it does not say."""
        time = ctypes.c_double()
        return self._status("fmi2GetRealStatus", fmi2.fmi2LastSuccessfulTime, time)

    def asks_to_end(self) -> bool:
        """Return whether the FMU discarded the last step to end the simulation."""
        return bool(self._status("fmi2GetBooleanStatus", fmi2.fmi2Terminated, ctypes.c_int()))

    def _status(self, function: str, kind: int, memory: Any) -> Any:
        """Return what the FMU says of the last step; None if it does not say."""
        get_status = self.bound(function, ctypes.c_int(kind), ctypes.byref(memory))
        return memory.value if get_status() <= fmi2.fmi2Warning else None

    def save(self) -> Any:
        """Return a copy of the FMU state for `restore`, to be freed by `release`.

        Raises
        ------
        UserError
            If the FMU cannot save its state.
        """
        if self.description.coSimulation.canGetAndSetFMUstate:
            return self._checked("saving the state", self._slave.getFMUstate)
        raise UserError(f"{self.path.name}: cannot save its state (canGetAndSetFMUstate is false)")

    def restore(self, state: Any) -> None:
        """Set the FMU to a saved state; UserError if it refuses."""
        self._checked("restoring a state", self._slave.setFMUstate, state)

    def release(self, state: Any) -> None:
        """Free a saved state; UserError if the FMU refuses."""
        self._checked("releasing a state", self._slave.freeFMUstate, state)

    def serialized_state(self) -> bytes:
        """Return the FMU state as bytes; UserError if the FMU refuses."""
        state = self.save()
        contents: bytes = self._checked("writing the state", self._slave.serializeFMUstate, state)
        self.release(state)
        return contents

    def resume(self, contents: bytes) -> None:
        """Set an FMU that is not initialized to a state as bytes; UserError if it refuses."""
        state = self._checked("reading a state", self._slave.deSerializeFMUstate, contents)
        self.restore(state)
        self.release(state)
        self._is_initialized = True

    # --- values

    def variable(self, name: str) -> Any:
        """Return a scalar variable by its name; UserError if there is none."""
        if name not in self.variables:
            raise UserError(
                f"{self.path.name}: no variable named {name!r}{suggestion(name, self.variables)}"
            )
        return self.variables[name]

    def in_numbers(self, name: str, values: Sequence[Value] | Array) -> Array:
        """Return values (n,) of a variable as numbers, which stand for them if they are texts.

        Raises
        ------
        UserError
            If one is a number for a text, or a text for another variable.
        """
        kind = type_of(self.variable(name))
        if kind != "string" and isinstance(values, np.ndarray) and values.dtype.kind in "biuf":
            return values
        where = f"{self.path.name}: {name}"
        found = []
        for value in values:
            is_word = is_text(kind, value if isinstance(value, str) else float(value), where)
            found.append(self.words[str(value)] if is_word else float(value))
        return np.array(found)

    def as_values(self, name: str, numbers: Array) -> Any:
        """Return numbers (n,) of a row as values of a variable: texts (n,) if it is one."""
        is_word = type_of(self.variable(name)) == "string"
        return self.words.texts(numbers) if is_word else numbers

    def writer(self, names: Sequence[str]) -> Callable[[Array], None]:
        """Return a function that sets variables to a row of numbers.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        callable
            Takes an array of shape (n,), a number for each name; UserError if the FMU refuses, or
            a value is not of its variable's type.
        """
        transfers = self._transfers("Set", names)

        def write(row: Array) -> None:
            for call, kind, typed_names, indices, references, values in transfers:
                numbers = row[indices].tolist()
                if kind == "string":
                    numbers = [text.encode() for text in self.words.texts(row[indices]).tolist()]
                elif kind != "real":
                    for name, value in zip(typed_names, numbers, strict=True):
                        check_type(kind, value, f"{self.path.name}: {name}")
                    numbers = [int(value) for value in numbers]
                values[:] = numbers
                status = call(self._slave.component, references, len(values), values)
                if status > fmi2.fmi2Warning:
                    raise self.failed(f"setting {', '.join(names)}", status)
                self.warnings += status

        return write

    def reader(self, names: Sequence[str]) -> Callable[[Array], None]:
        """Return a function that reads variables into a row of numbers.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        callable
            Takes an array of shape (n,) and fills it; UserError if the FMU refuses.
        """
        transfers = self._transfers("Get", names)

        def read(row: Array) -> None:
            for call, kind, _, indices, references, values in transfers:
                status = call(self._slave.component, references, len(values), values)
                if status > fmi2.fmi2Warning:
                    raise self.failed(f"reading {', '.join(names)}", status)
                self.warnings += status
                read_now = values[:]
                if kind == "string":
                    read_now = [self.words[(text or b"").decode()] for text in read_now]
                row[indices] = read_now

        return read

    def directional_derivatives(self, unknowns: Sequence[str], knowns: Sequence[str]) -> Array:
        """Return the FMU's partial derivatives of unknowns by knowns (FMI 2.0, 2.1.9).

        Parameters
        ----------
        unknowns, knowns : sequence of str
            Real variables.

        Returns
        -------
        ndarray, shape (unknowns, knowns)
            In the FMU's units.

        Raises
        ------
        UserError
            If the FMU refuses.
        """
        rows = [self.variable(name).valueReference for name in unknowns]
        columns = [
            self._checked(
                f"the derivative by {name}",
                self._slave.getDirectionalDerivative,
                rows,
                [self.variable(name).valueReference],
                [1.0],
            )
            for name in knowns
        ]
        return np.array(columns, dtype=float).reshape(len(knowns), len(rows)).T

    def _transfers(self, verb: str, names: Sequence[str]) -> list[ValueTransfer]:
        """Return calls that set or get variables and are noted in the progress of the process."""
        variables = {name: self.variable(name) for name in names}
        transfers = prepare_transfers(self._slave.dll, verb, names, variables)
        request = f"{'setting' if verb == 'Set' else 'reading'} {', '.join(names)}"
        return [
            transfer._replace(call=noting(transfer.call, self.label, request))
            for transfer in transfers
        ]

    # --- calls and their failures

    def bound(self, function: str, *arguments: Any) -> partial[int]:
        """Return an FMI function of this instance with its arguments bound, for fast calls.

        Parameters
        ----------
        function : str
            Name in the FMI standard.
        *arguments
            Arguments after the component: ctypes objects of exactly the right types, whose values
            are read at each call. They are neither converted nor checked.

        Returns
        -------
        functools.partial
            Takes no arguments and returns the FMI status; see `failed`.

        Raises
        ------
        UserError
            If the FMU lacks the function.
        """
        try:
            bound = self._slave.dll[function]  # a new object, whose argument types are not set
        except AttributeError as error:
            raise UserError(
                f"{self.path.name}: its library lacks the function {function}"
            ) from error
        call = partial(bound, ctypes.c_void_p(self._slave.component), *arguments)
        return noting(call, self.label, function)

    def _checked(self, request: str, call: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of fmpy; UserError with the request and the FMU's message if it fails."""
        try:
            with activity(f"{self.label}: {request}"):
                result = call(*arguments)
            self.warnings += result == fmi2.fmi2Warning
            return result
        except Exception as error:
            self._note_failure(getattr(error, "status", fmi2.fmi2Discard))
            reason = self._log.last(otherwise=first_line(error))
            raise UserError(f"{self.path.name}: {request} failed: {reason}") from error

    def failed(self, request: str, status: int, remark: str = "") -> UserError:
        """Return the error for a status worse than a warning; a fatal one sets `corrupted`.

        Parameters
        ----------
        request : str
            Description of the call in the message, such as ``setting current``.
        status : int
            The FMI status that it returned.
        remark : str
            A remark on the status.

        Returns
        -------
        UserError
        """
        self._note_failure(status)
        returned = dict(enumerate(_STATUS)).get(status, f"status {status}")
        return UserError(
            f"{self.path.name}: {request} failed ({returned}{remark}):"
            f" {self._log.last('no message')}"
        )

    def _note_failure(self, status: int) -> None:
        """Note what may be called after a failure: all after a discard, nothing after a fatal."""
        self.corrupted |= status == fmi2.fmi2Fatal
        self._is_initialized &= status == fmi2.fmi2Discard
