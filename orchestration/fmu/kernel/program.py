"""Programs of the stepping kernel, which consist of calls of FMUs, and their execution."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from threading import Event, Thread
from typing import Any, NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from orchestration.fmu.isolation import shared_progress
from orchestration.fmu.kernel import library
from orchestration.fmu.kernel.library import Operation, Progress, ValueLink

DOUBLE = ctypes.sizeof(ctypes.c_double)
PULSE_PERIOD = 0.1  # s
_TRANSFERS = {  # operations by FMI function
    "fmi2SetReal": library.SET_REAL,
    "fmi2GetReal": library.GET_REAL,
    "fmi2SetInteger": library.SET_INTEGER,
    "fmi2GetInteger": library.GET_WHOLE,
    "fmi2SetBoolean": library.SET_BOOLEAN,
    "fmi2GetBoolean": library.GET_WHOLE,
}
_REQUESTS = {
    library.STEP: "step",
    library.GET_REAL: "reading",
    library.GET_WHOLE: "reading",
    library.SET_REAL: "setting",
    library.SET_INTEGER: "setting",
    library.SET_BOOLEAN: "setting",
}


class KernelReturn(NamedTuple):
    """A return of the kernel to Python in the middle of a run.

    Attributes
    ----------
    reason : int
        One of the reasons in `library`: a call failed, a value is not finite or not of its type, or
        an operation is a call of Python.
    status : int
        The FMI status of a failed call.
    which : int
        Index of the value that is not finite or not of its type.
    point : int
        Index of the communication point.
    """

    reason: int
    status: int
    which: int
    point: int


Handler = Callable[[KernelReturn], object]  # raises an error, or lets the run continue


class Values(NamedTuple):
    """Numbers in memory; those of the next point are `stride` numbers further.

    Attributes
    ----------
    address : int
        Address of the first number.
    stride : int
        Distance from point to point in numbers; 0 for the same memory at every point.
    """

    address: int
    stride: int = 0

    @classmethod
    def in_rows(cls, array: Array) -> Values:
        """Return the rows of an array, which must be contiguous and stay in memory."""
        return cls(array.ctypes.data, array.strides[0] // DOUBLE)

    def shifted(self, count: int) -> Values:
        """Return the values that start `count` numbers later."""
        return Values(self.address + DOUBLE * count, self.stride)


@dataclass
class Program:
    """The operations at every communication point, in their order.

    Attributes
    ----------
    operations : list of Operation
    handlers : list of callable
        For each operation, the function that is called when the kernel returns from it.
    owners : sequence of str
        Names of the FMUs.
    """

    operations: list[Operation] = field(default_factory=list)
    handlers: list[Handler] = field(default_factory=list)
    owners: Sequence[str] = ()
    _memory: list[object] = field(default_factory=list, init=False)  # of operations

    def add_step(
        self,
        call: partial[int],
        begins: Values,
        ends: Values,
        handler: Handler,
        *,
        owner: int = 0,
        final: bool = True,
    ) -> None:
        """Add an operation that is a step of an FMU.

        Parameters
        ----------
        call : functools.partial
            The bound function ``fmi2DoStep``.
        begins, ends : Values
            Start and end times in s.
        handler : callable
            Raises the error of a failure.
        owner : int
            Index of the FMU.
        final : bool
            Argument noSetFMUStatePriorToCurrentPoint: whether no earlier state will be restored.
        """
        self._add(
            handler,
            library.STEP,
            call,
            owner,
            values=begins.address,
            stride=begins.stride,
            ends=ends.address,
            integers=self._address(ctypes.c_int(final)),
        )

    def add_transfer(
        self,
        call: partial[int],
        references: Sequence[int],
        values: Values,
        places: Sequence[int],
        handler: Handler,
        *,
        owner: int = 0,
    ) -> None:
        """Add an operation that sets or gets variables of one type.

        Parameters
        ----------
        call : functools.partial
            Bound function of the FMU, such as ``fmi2SetReal``.
        references : sequence of int
            Value references, shape (n,).
        values : Values
            Doubles, which the kernel converts from and to integers and booleans.
        places : sequence of int
            Index in the values of each variable, shape (n,); consecutive for reals.
        handler : callable
            Raises the error of a failure.
        owner : int
            Index of the FMU.
        """
        function: Any = call.func
        kind = _TRANSFERS[function.__name__]
        if kind in (library.SET_REAL, library.GET_REAL):
            first = values.shifted(places[0])
            self._add_values(kind, call, references, first, handler, owner)
            return
        count = len(references)
        self._add_values(
            kind,
            call,
            references,
            values,
            handler,
            owner,
            integers=self._address((ctypes.c_int * count)()),
            places=self._address((ctypes.c_size_t * count)(*places)),
        )

    def _add_values(
        self,
        kind: int,
        call: partial[int],
        references: Sequence[int],
        values: Values,
        handler: Handler,
        owner: int = 0,
        **memory: int,
    ) -> None:
        """Append an operation for values of variables; `memory` has the addresses it needs."""
        self._add(
            handler,
            kind,
            call,
            owner,
            references=self._references(references),
            count=len(references),
            values=values.address,
            stride=values.stride,
            **memory,
        )

    def add_links(self, kind: int, links: Sequence[ValueLink], handler: Handler) -> None:
        """Add an operation that copies values to inputs, unless there are no links.

        Parameters
        ----------
        kind : int
            Operation of the library: ``PASS``, ``SCALE``, ``DISTURB`` or ``DRIVE``.
        links : sequence of ValueLink
            Source and target of each value.
        handler : callable
            Raises the error of a value that is not finite.
        """
        if links:
            memory = (ValueLink * len(links))(*links)
            self._add(handler, kind, count=len(links), links=self._address(memory))

    def add_row_copy(self, source: int, count: int, rows: Array) -> None:
        """Add an operation that copies numbers from an address to the next row of an array."""
        self._memory.append(rows)
        self._add(_cannot_fail, library.KEEP, count=count, values=rows.ctypes.data, ends=source)

    def add_python_call(self, handler: Handler) -> None:
        """Add an operation that the kernel leaves to Python: `handler` carries it out."""
        self._add(handler, library.CALL)

    def add_timer_start(self) -> None:
        """Add an operation that starts the timer."""
        self._add(_cannot_fail, library.BEGIN)

    def add_time_spent(self, owner: int) -> None:
        """Add an operation that adds the time since the last one of the timer to that of an FMU."""
        self._add(_cannot_fail, library.SPENT, owner=owner)

    def hold(self, memory: object) -> None:
        """Keep an object, such as an array, whose memory operations use."""
        self._memory.append(memory)

    def _add(
        self,
        handler: Handler,
        kind: int,
        call: partial[int] | None = None,
        owner: int = 0,
        **fields: int,
    ) -> None:
        """Append an operation with its handler, and with the FMI function that it calls."""
        operation = Operation(kind=kind, owner=owner, **fields)
        if call is not None:
            function: Any = call.func
            self._memory.append(call)
            operation.function = ctypes.cast(function, ctypes.c_void_p).value
            operation.component = call.args[0].value
        self.operations.append(operation)
        self.handlers.append(handler)

    def _references(self, references: Sequence[int]) -> int:
        return self._address((ctypes.c_uint * len(references))(*references))

    def _address(self, memory: Any) -> int:
        """Return the address of an object of ctypes, and keep the object."""
        self._memory.append(memory)
        return ctypes.addressof(memory)

    def legend(self) -> list[tuple[str, bool]]:
        """Return descriptions of the operations for the shared progress.

        Returns
        -------
        list of (str, bool)
            For each operation, the FMU and its call, empty without a call, and whether it is a
            step.
        """
        return [
            (self._description(operation), operation.kind == library.STEP)
            for operation in self.operations
        ]

    def _description(self, operation: Operation) -> str:
        if operation.kind not in _REQUESTS or not self.owners:
            return ""
        return f"{self.owners[operation.owner]}: {_REQUESTS[operation.kind]}"


def _cannot_fail(returned: KernelReturn) -> None:
    """Raise the error of a return from an operation that never returns to Python."""
    raise RuntimeError(f"the stepping kernel returned without reason: {returned}")


class Pulse:
    """A thread that interrupts the kernel regularly, so that Python handles Ctrl-C.

    It is a context manager. The kernel does not read a clock itself, because that takes as long as
    a step of a small FMU. Starting a thread takes as long as a thousand small steps, so that
    consecutive runs share one.
    """

    def __init__(self) -> None:
        self._stop = Event()
        self._run: Progress | None = None
        self._thread = Thread(target=self._beat, name="kernel pulse", daemon=True)

    def __enter__(self) -> Pulse:
        self._thread.start()
        return self

    def __exit__(self, *error: Any) -> None:
        self._stop.set()
        self._thread.join()

    @contextmanager
    def interrupting(self, progress: Progress) -> Iterator[None]:
        """Interrupt a run regularly while the context lasts."""
        self._run = progress
        try:
            yield
        finally:
            self._run = None

    def _beat(self) -> None:
        while not self._stop.wait(PULSE_PERIOD):
            run = self._run
            if run is not None:
                run.interrupted = 1


class Execution:
    """The execution of a program by the kernel; a context manager that runs a pulse.

    Parameters
    ----------
    program : Program
    owners : int
        Number of FMUs for which warnings and time are counted.
    first : int
        Index of the first communication point.
    skipped : int
        Number of operations to skip at the first point.
    pulse : Pulse, optional
        A running pulse; default a new one.

    Attributes
    ----------
    seconds, warnings : ndarray, shape (owners,)
        Time in s and number of warnings by FMU.
    """

    def __init__(
        self,
        program: Program,
        owners: int = 1,
        first: int = 0,
        skipped: int = 0,
        pulse: Pulse | None = None,
    ):
        self._program = program
        self._operations = (Operation * len(program.operations))(*program.operations)
        self.seconds = np.zeros(owners)
        self.warnings = np.zeros(owners, dtype=np.int64)
        self._start = (first, skipped)
        self._shared = shared_progress.current
        self._progress = self._allocate_progress()
        run = library.load_stepper()
        if run is None:
            raise RuntimeError("there is no stepping kernel")
        self._run = run
        self._reference = ctypes.byref(self._progress)
        self._pulse = pulse
        self._contexts = ExitStack()

    def _allocate_progress(self) -> Progress:
        """Return the progress of a run before its first point, in shared memory if isolated."""
        progress = Progress()
        if self._shared:
            progress = self._shared.allocate_run(self._program.legend())
        progress.program = ctypes.addressof(self._operations)
        progress.length = len(self._operations)
        progress.point, progress.position = self._start
        progress.row = 0
        progress.interrupted = 0
        progress.seconds = self.seconds.ctypes.data
        progress.warnings = self.warnings.ctypes.data
        return progress

    def __enter__(self) -> Execution:
        pulse = self._pulse or self._contexts.enter_context(Pulse())
        self._contexts.enter_context(pulse.interrupting(self._progress))
        if self._shared:
            self._shared.begin_run(self._progress)
        return self

    def __exit__(self, *error: Any) -> None:
        self._contexts.close()
        if self._shared:
            self._shared.end_run()

    def __del__(self) -> None:
        shared = getattr(self, "_shared", None)
        if shared is not None:
            shared.release_run(self._progress)

    @property
    def point(self) -> int:
        """Index of the next communication point; all before it are complete."""
        return self._progress.point

    @property
    def within_point(self) -> bool:
        """True if some operations of the next point were executed."""
        return self._progress.position > 0

    @property
    def row_count(self) -> int:
        """Number of rows copied since `rewind_rows`."""
        return self._progress.row

    def restart(self) -> None:
        """Return to the first point and set all counts to zero."""
        progress = self._progress
        progress.point, progress.position = self._start
        progress.row = progress.interrupted = 0
        self.seconds[:] = 0.0
        self.warnings[:] = 0

    def rewind_rows(self) -> None:
        """Let the next copied row be the first of its array."""
        self._progress.row = 0

    def advance(self, until: int) -> bool:
        """Execute the program up to a communication point.

        Parameters
        ----------
        until : int
            Index of the point, which is not executed.

        Returns
        -------
        bool
            Whether the point was reached; False after an interruption by the pulse.

        Raises
        ------
        Exception
            Any that the handler of an operation raises.
        """
        progress = self._progress
        while reason := self._run(self._reference, until):
            if reason == library.PAUSED:
                progress.interrupted = 0
                return False
            # the kernel has already advanced its position when it returns for a call of Python
            position = progress.position - (reason == library.CALLING)
            returned = KernelReturn(reason, progress.status, progress.index, progress.point)
            self._program.handlers[position](returned)
        return True
