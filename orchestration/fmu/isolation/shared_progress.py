"""Progress of a process in shared memory that outlives it: current call of an FMU and point."""

from __future__ import annotations

import ctypes
import mmap
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import UserError, files
from fmus.kit.arrays import Array
from orchestration.fmu.kernel import Progress

# names of the files in the folder of a process
_MEMORY = "progress"
_LEGEND = "legend"
_DESCRIPTION = "description"
_ROWS = "rows"
_TEXT_SIZE = 500  # bytes
_SLOTS = 16  # runs of the kernel that can be tracked at the same time
_NO_SLOT = -1
_STEP_CALLS = ("step", "fmi2DoStep")


class _Head(ctypes.Structure):
    """The first part of the shared memory, before the runs of the kernel."""

    _fields_ = (
        ("beat", ctypes.c_int64),
        ("point", ctypes.c_int64),
        ("length", ctypes.c_int32),
        ("slot", ctypes.c_int32),
        ("text", ctypes.c_char * _TEXT_SIZE),
    )


class ProgressState(NamedTuple):
    """A snapshot of the progress of a process.

    Attributes
    ----------
    doing : str
        The current call of an FMU; empty if there is none.
    point : int
        The next communication point of the current run, or the last one of a finished run.
    row : int
        Number of rows that the kernel has copied and Python has not read yet.
    beat : tuple of int
        Counters that differ after any begin or end of a call since the last snapshot.
    in_kernel : bool
        Whether the call is an operation of the kernel, executed at every point.
    is_step : bool
        Whether this operation is a step to the point.
    """

    doing: str
    point: int
    row: int
    beat: tuple[int, int, int]
    in_kernel: bool = False
    is_step: bool = False

    def describe(self, time: Sequence[float] | Array, otherwise: str) -> str:
        """Return a description of the current call with its time.

        Parameters
        ----------
        time : sequence of float, shape (n,)
            Communication points in s.
        otherwise : str
            Description if there is no current call.
        """
        if not self.in_kernel or not 0 <= self.point < len(time):
            return self.doing or otherwise
        if self.is_step:
            return f"{self.doing} from {time[self.point - 1]:g} s"
        return f"{self.doing} at {time[self.point]:g} s"


class SharedProgress:
    """Shared memory and files of one process, in a folder that another process can read.

    Parameters
    ----------
    folder : Path
        An existing folder.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        path = folder / _MEMORY
        size = ctypes.sizeof(_Head) + _SLOTS * ctypes.sizeof(Progress)
        if not path.exists():
            path.write_bytes(bytes(size))
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), size)
        if hasattr(mmap, "MADV_DONTFORK"):
            # else a fork of the process, which an FMU may make, would write to this memory too
            self._memory.madvise(mmap.MADV_DONTFORK)
        self._head = _Head.from_buffer(self._memory)
        self._runs = (Progress * _SLOTS).from_buffer(self._memory, ctypes.sizeof(_Head))
        self._used_slots: set[int] = set()

    # ---- written by the process

    def clear(self) -> None:
        """Note that no call and no run is in progress."""
        self._head.length = 0
        self._head.slot = _NO_SLOT

    def begin_call(self, description: bytes) -> None:
        """Note the beginning of a call of an FMU, described in UTF-8."""
        text = description[:_TEXT_SIZE]
        head = self._head
        head.text = text
        head.length = len(text)
        head.beat += 1

    def end_call(self) -> None:
        """Note that the call of the FMU has returned."""
        self._head.length = 0
        self._head.beat += 1

    def allocate_run(self, legend: list[tuple[str, bool]]) -> Progress:
        """Return shared memory for a run of the kernel, or private memory if all slots are in use.

        Parameters
        ----------
        legend : list of (str, bool)
            For each operation of the run, its description and whether it is a step.
        """
        free = next((k for k in range(_SLOTS) if k not in self._used_slots), None)
        if free is None:
            return Progress()
        self._used_slots.add(free)
        files.write(self.folder / f"{_LEGEND}{free}", pickle.dumps(legend))
        return self._runs[free]

    def release_run(self, run: Progress) -> None:
        """Free the memory of a run for other runs."""
        self._used_slots.discard(self._slot(run))

    def begin_run(self, run: Progress) -> None:
        """Note that the kernel begins or continues a run."""
        self._head.slot = self._slot(run)

    def end_run(self) -> None:
        """Note that the kernel has stopped or paused its run."""
        if self._head.slot != _NO_SLOT:
            self._head.point = self._runs[self._head.slot].point
        self._head.slot = _NO_SLOT

    def _slot(self, run: Progress) -> int:
        """Return the index of a run's shared memory; `_NO_SLOT` for private memory."""
        offset = ctypes.addressof(run) - ctypes.addressof(self._runs)
        size = ctypes.sizeof(Progress)
        return offset // size if 0 <= offset < _SLOTS * size else _NO_SLOT

    def describe_rows(self, description: Any) -> None:
        """Save a description of the rows, such as the names of columns, for the reading process."""
        files.write(self.folder / _DESCRIPTION, pickle.dumps(description))

    def allocate_rows(self, shape: tuple[int, int], name: str = _ROWS) -> Array:
        """Return an array in a file of the folder; see the function of the same name."""
        if 0 in shape:  # an empty file cannot be mapped
            return np.empty(shape)
        path = self.folder / name
        array: Array = np.lib.format.open_memmap(path, "w+", np.dtype("f8"), shape)
        return array

    # ---- read by its parent

    def state(self) -> ProgressState:
        """Return a snapshot of the progress while the process runs.

        All numbers are checked, because the FMU may have overwritten the memory.
        """
        head = self._head
        call = head.text[: max(0, head.length)].decode(errors="replace")
        slot = head.slot
        if not 0 <= slot < _SLOTS:  # no run is in progress
            return ProgressState(call, head.point, 0, (head.beat, 0, 0))
        run = self._runs[slot]
        position = run.position
        operation, is_step = self._operation(slot, position)
        return ProgressState(
            doing=call or operation,
            point=run.point,
            row=run.row,
            beat=(head.beat, run.point, position),
            in_kernel=bool(operation and not call),
            is_step=is_step,
        )

    def _operation(self, slot: int, position: int) -> tuple[str, bool]:
        """Return the description of a run's operation and whether it is a step.

        The description is empty for a run in Python, whose calls are noted one by one.
        """
        try:
            legend = pickle.loads((self.folder / f"{_LEGEND}{slot}").read_bytes())
        except Exception:  # missing or damaged
            legend = [("an FMU", False)]
        if not legend:
            return "", False
        operation, is_step = legend[max(0, min(position, len(legend) - 1))]
        return operation, is_step

    def rows_description(self) -> Any:
        """Return the saved description of the rows; None if there is none or it is damaged."""
        with suppress(Exception):
            return pickle.loads((self.folder / _DESCRIPTION).read_bytes())
        return None

    def read_rows(self, count: int, name: str = _ROWS) -> Array | None:
        """Return the first `count` rows; None if `count` is 0, or they are missing or damaged."""
        with suppress(OSError, ValueError):
            rows = np.array(np.load(self.folder / name))
            return rows[:count] if 0 < count <= len(rows) else None
        return None


current: SharedProgress | None = None  # of this process, if it is isolated


def allocate_rows(shape: tuple[int, int], name: str = _ROWS) -> Array:
    """Return an array to be filled with results, which outlives an isolated process.

    Raises
    ------
    UserError
        If there is no space for it on the disk.
    """
    if current is None:
        return np.empty(shape)
    try:
        return current.allocate_rows(shape, name)
    except OSError as error:
        raise UserError(
            f"{current.folder}: cannot be written ({error.strerror or error})"
        ) from error


class activity:  # a generator would take as long as some calls of an FMU
    """A context that describes the current call of an FMU in the shared progress."""

    __slots__ = ("_description",)

    def __init__(self, description: str):
        self._description = description

    def __enter__(self) -> None:
        if current is not None:
            current.begin_call(self._description.encode())

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        # after an error the description remains until the next call
        if current is not None and kind is None:
            current.end_call()


@contextmanager
def tracked_run() -> Iterator[Progress]:
    """Yield the progress of a run in Python, in shared memory if this process is isolated."""
    shared = current
    if shared is None:
        yield Progress()
        return
    run = shared.allocate_run([])
    run.point = run.position = run.row = 0
    shared.begin_run(run)
    try:
        yield run
    finally:
        shared.end_run()
        shared.release_run(run)


def describe_rows(description: Any) -> None:
    """Save a description of the rows for the parent process, if this process is isolated."""
    if current is not None:
        current.describe_rows(description)


class _NotedCall(partial[int]):
    """A call of an FMI function that is described in the shared progress while it lasts."""

    progress: SharedProgress
    description: bytes  # encoded in advance, which saves time at every call
    is_step: bool  # whether the time is added to the description

    def __call__(self, /, *more: Any, **options: Any) -> int:
        if self.is_step:
            time = (*self.args, *more)[1]  # arguments of fmi2DoStep: component, time, step, ...
            seconds = f"{getattr(time, 'value', time):g}".encode()
            self.progress.begin_call(b"%s from %s s" % (self.description, seconds))
        else:
            self.progress.begin_call(self.description)
        status = super().__call__(*more, **options)
        self.progress.end_call()
        return status


def noting(call: Callable[..., int], label: str, request: str) -> Any:
    """Return a call of an FMI function that is also described in the shared progress.

    Parameters
    ----------
    call : callable
        Function that returns the FMI status.
    label : str
        Name of the FMU.
    request : str
        Description of the call; ``step`` for a step, to which the time is added.

    Returns
    -------
    callable
        `call` itself if this process is not isolated.
    """
    if current is None:
        return call
    noted = _NotedCall(call)
    noted.progress = current
    noted.is_step = request in _STEP_CALLS
    noted.description = f"{label}: {'step' if noted.is_step else request}".encode()
    return noted
