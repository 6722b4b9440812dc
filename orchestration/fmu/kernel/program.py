"""What the kernel does at every communication point, put together from calls of FMUs, and how it is carried out."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.isolation import box
from orchestration.fmu.kernel import library
from orchestration.fmu.kernel.library import Link, Operation
from orchestration.fmu.kernel.pulse import Pulse

Array = NDArray[np.float64]
DOUBLE = ctypes.sizeof(ctypes.c_double)
WHOLE_NUMBERS = {"integer": library.SET_INTEGER, "boolean": library.SET_BOOLEAN}
_SETTING = (library.SET_REAL, library.SET_INTEGER, library.SET_BOOLEAN, library.SET_SLOPES)
_ASKED = {
    library.STEP: "step",
    library.GET_REAL: "reading",
    library.GET_WHOLE: "reading",
} | dict.fromkeys(_SETTING, "setting")


class Return(NamedTuple):
    """Why the kernel came back.

    Attributes
    ----------
    reason : int
        One of `library`: a call failed, a value is no number or not of its type, or Python has to do something.
    status : int
        What a call that failed has answered.
    which : int
        Of the values, if it is one of them.
    point : int
        At which communication point.
    """

    reason: int
    status: int
    which: int
    point: int


Handler = Callable[[Return], object]  # raises, unless the run shall go on


class Values(NamedTuple):
    """Numbers in memory: those of point k are `stride` numbers after those of the point before."""

    address: int
    stride: int = 0

    def shifted(self, by: int) -> Values:
        """The same, so many numbers further on."""
        return Values(self.address + DOUBLE * by, self.stride)


def in_array(array: Array) -> Values:
    """Rows of an array, which has to be contiguous and to stay where it is."""
    return Values(array.ctypes.data, array.strides[0] // DOUBLE)


@dataclass
class Program:
    """Operations in the order in which they are carried out, and what is done when one comes back.

    Attributes
    ----------
    operations : list of Operation
    handlers : list of callable
        One for each operation.
    owners : sequence of str
        What they are called.
    """

    operations: list[Operation] = field(default_factory=list)
    handlers: list[Handler] = field(default_factory=list)
    owners: Sequence[str] = ()
    _kept: list[object] = field(default_factory=list, init=False)  # memory that operations point to

    def step(
        self,
        call: partial[int],
        begins: Values,
        ends: Values,
        handler: Handler,
        owner: int = 0,
        final: bool = True,
    ) -> None:
        """Add a step of an FMU from `begins` to `ends`, in s; `final` if no state before it will be set again."""
        self._add(
            handler,
            library.STEP,
            call,
            owner,
            values=begins.address,
            stride=begins.stride,
            ends=ends.address,
            integers=self._keep(ctypes.c_int(final)),
        )

    def real(
        self,
        kind: int,
        call: partial[int],
        references: Sequence[int],
        values: Values,
        handler: Handler,
        owner: int = 0,
    ) -> None:
        """Add setting or getting reals, or the slopes of inputs, whose values stand together."""
        orders = self._keep((ctypes.c_int * len(references))(*[1] * len(references)))
        self._add(
            handler,
            kind,
            call,
            owner,
            references=self._references(references),
            count=len(references),
            values=values.address,
            stride=values.stride,
            integers=orders,
        )

    def whole(
        self,
        kind: int,
        call: partial[int],
        references: Sequence[int],
        values: Values,
        places: Sequence[int],
        handler: Handler,
        owner: int = 0,
    ) -> None:
        """Add setting or getting integers or booleans, which are at these places among the values."""
        count = len(references)
        self._add(
            handler,
            kind,
            call,
            owner,
            references=self._references(references),
            count=count,
            values=values.address,
            stride=values.stride,
            integers=self._keep((ctypes.c_int * count)()),
            places=self._keep((ctypes.c_size_t * count)(*places)),
        )

    def links(self, kind: int, links: Sequence[Link], handler: Handler) -> None:
        """Add passing values on, if there are any."""
        if links:
            self._add(
                handler, kind, count=len(links), links=self._keep((Link * len(links))(*links))
            )

    def keep(self, source: int, count: int, rows: Array) -> None:
        """Add copying a row of numbers into the next of `rows`."""
        self._kept.append(rows)
        self._add(_goes_on, library.KEEP, count=count, values=rows.ctypes.data, ends=source)

    def hold(self, memory: object) -> None:
        """Keep what values are moved from or to, such as an array, from being freed."""
        self._kept.append(memory)

    def call(self, handler: Handler) -> None:
        """Add something that Python does."""
        self._add(handler, library.CALL)

    def begin(self) -> None:
        """Take the time from here."""
        self._add(_goes_on, library.BEGIN)

    def spent(self, owner: int) -> None:
        """Count the time since it was taken last as an owner's."""
        self._add(_goes_on, library.SPENT, owner=owner)

    def _add(
        self,
        handler: Handler,
        kind: int,
        call: partial[int] | None = None,
        owner: int = 0,
        **fields: int,
    ) -> None:
        operation = Operation(kind=kind, owner=owner, **fields)
        if call is not None:
            function: Any = call.func
            self._kept.append(call)
            operation.function = ctypes.cast(function, ctypes.c_void_p).value
            operation.component = call.args[0].value
        self.operations.append(operation)
        self.handlers.append(handler)

    def _references(self, references: Sequence[int]) -> int:
        return self._keep((ctypes.c_uint * len(references))(*references))

    def _keep(self, memory: Any) -> int:
        self._kept.append(memory)
        return ctypes.addressof(memory)

    def legend(self) -> list[tuple[str, bool]]:
        """What is asked of whom in each operation, empty where it is no FMU, and whether that is a step."""
        return [
            (
                f"{self.owners[o.owner]}: {_ASKED[o.kind]}"
                if o.kind in _ASKED and self.owners
                else "",
                o.kind == library.STEP,
            )
            for o in self.operations
        ]


def _goes_on(why: Return) -> None:
    raise RuntimeError(
        f"the stepping kernel came back for nothing: {why}"
    )  # such an operation cannot fail


class Execution:
    """A program that is carried out; a context manager, for there is a thread that calls the kernel back.

    Parameters
    ----------
    program : Program
    owners : int
        How many there are to count warnings and time for.
    first : int
        Communication point to begin with.
    skipped : int
        Operations that are left out at that one.
    pulse : Pulse, optional
        That beats already; else it has its own.

    Attributes
    ----------
    seconds, warnings : ndarray, shape (owners,)
        Time in s and calls that ended with a warning, by owner.
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
        self.seconds, self.warnings = np.zeros(owners), np.zeros(owners, dtype=np.int64)
        self._box = box.current
        self._progress = self._box.run(program.legend()) if self._box else library.Progress()
        for name, value in {
            "program": ctypes.addressof(self._operations),
            "length": len(program.operations),
            "point": first,
            "position": skipped,
            "row": 0,
            "interrupted": 0,
            "seconds": self.seconds.ctypes.data,
            "warnings": self.warnings.ctypes.data,
        }.items():
            setattr(self._progress, name, value)
        run = library.stepper()
        if run is None:
            raise RuntimeError("there is no stepping kernel")
        self._run, self._here = run, ctypes.byref(self._progress)
        self._pulse, self._felt = pulse, ExitStack()
        self._begins_with = (first, skipped)

    def __enter__(self) -> Execution:
        pulse = self._pulse or self._felt.enter_context(Pulse())
        self._felt.enter_context(pulse.of(self._progress))
        if self._box:
            self._box.begin(self._progress)
        return self

    def __exit__(self, *error: Any) -> None:
        self._felt.close()
        if self._box:
            self._box.end()

    def __del__(self) -> None:
        there = getattr(self, "_box", None)
        if there is not None:
            there.give_back(self._progress)

    @property
    def point(self) -> int:
        """The communication point that is next; all before it are complete."""
        return self._progress.point

    @property
    def inside(self) -> bool:
        """Whether something was done at it already."""
        return self._progress.position > 0

    @property
    def kept(self) -> int:
        """How many rows were kept since `rewind`."""
        return self._progress.row

    def again(self) -> None:
        """Carry it out from where it began; nothing is counted yet."""
        progress = self._progress
        progress.point, progress.position = self._begins_with
        progress.row = progress.interrupted = 0
        self.seconds[:], self.warnings[:] = 0.0, 0

    def rewind(self) -> None:
        """Keep the next row as the first."""
        self._progress.row = 0

    def carry_on(self, until: int) -> bool:
        """Go on up to a communication point, which is left out.

        Parameters
        ----------
        until : int

        Returns
        -------
        bool
            Whether it got there; false if some time has passed and Python should look around.

        Raises
        ------
        Exception
            Whatever the handler of an operation raises.
        """
        progress = self._progress
        while reason := self._run(self._here, until):
            if reason == library.PAUSED:
                progress.interrupted = 0
                return False
            position = progress.position - (
                reason == library.CALLING
            )  # a call is behind it when it comes back
            self._program.handlers[position](
                Return(reason, progress.status, progress.index, progress.point)
            )
        return True
