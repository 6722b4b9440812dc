"""What goes on in a process, in memory that outlives it: which call of which FMU it is in, and what it has computed."""

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
from numpy.typing import NDArray

from fmus.kit import files
from fmus.kit.errors import UserError
from orchestration.fmu.kernel.library import Progress

Array = NDArray[np.float64]
_BOX, _LEGEND, _ABOUT, _ROWS = "box", "legend", "about", "rows"
_TEXT, _SLOTS = 500, 16
_NONE = -1
_STEPS = ("step", "fmi2DoStep")


class _Head(ctypes.Structure):
    """What stands before the runs of the kernel."""

    _fields_ = (
        ("beat", ctypes.c_int64),
        ("point", ctypes.c_int64),
        ("length", ctypes.c_int32),
        ("slot", ctypes.c_int32),
        ("text", ctypes.c_char * _TEXT),
    )


class State(NamedTuple):
    """Where a process is.

    Attributes
    ----------
    doing : str
        What an FMU is asked to do; empty if none is asked anything.
    point, row : int
        Of a run, also one that is over: the communication point that is next, and how many rows the kernel has kept
        since they were taken.
    beat : int
        Another one whenever something was begun or ended.
    listed : bool
        Whether what it does is an operation of the kernel, which is the same at every point.
    step : bool
        Whether that is a step to the point.
    """

    doing: str
    point: int
    row: int
    beat: tuple[int, int, int]
    listed: bool = False
    step: bool = False

    def words(self, time: Sequence[float] | Array, otherwise: str) -> str:
        """What an FMU was asked to do, and where in time (n,)."""
        if not self.listed or not 0 <= self.point < len(time):
            return self.doing or otherwise
        if self.step:
            return f"{self.doing} from {time[self.point - 1]:g} s"
        return f"{self.doing} at {time[self.point]:g} s"


class Box:
    """The memory of one process, in a folder that another one can read.

    Parameters
    ----------
    folder : Path
        There already.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        path, size = folder / _BOX, ctypes.sizeof(_Head) + _SLOTS * ctypes.sizeof(Progress)
        if not path.exists():
            path.write_bytes(bytes(size))
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), size)
        if hasattr(
            mmap, "MADV_DONTFORK"
        ):  # a copy of the process that an FMU makes would count in it, too
            self._memory.madvise(mmap.MADV_DONTFORK)
        self._head = _Head.from_buffer(self._memory)
        self._runs = (Progress * _SLOTS).from_buffer(self._memory, ctypes.sizeof(_Head))
        self._taken: set[int] = set()

    # ---- in the process ------------------------------------------------------------------------------------------

    def clear(self) -> None:
        """Nothing goes on."""
        self._head.length, self._head.slot = 0, _NONE

    def do(self, what: bytes) -> None:
        """Note what an FMU is asked to do, in UTF-8."""
        head, what = self._head, what[:_TEXT]
        head.text, head.length = what, len(what)
        head.beat += 1

    def done(self) -> None:
        """Note that it has answered."""
        self._head.length = 0
        self._head.beat += 1

    def run(self, legend: list[tuple[str, bool]]) -> Progress:
        """Memory of a run of the kernel; of this process alone, if there is no room.

        The legend tells of each of its operations what is asked, and whether it is a step.
        """
        free = next((k for k in range(_SLOTS) if k not in self._taken), None)
        if free is None:
            return Progress()
        self._taken.add(free)
        files.write(self.folder / f"{_LEGEND}{free}", pickle.dumps(legend))
        return self._runs[free]

    def give_back(self, run: Progress) -> None:
        """Let another run have the memory of this one."""
        self._taken.discard(self._slot(run))

    def begin(self, run: Progress) -> None:
        """Note that the kernel carries it out."""
        self._head.slot = self._slot(run)

    def end(self) -> None:
        """Note that it does not any more."""
        if self._head.slot != _NONE:
            self._head.point = self._runs[self._head.slot].point
        self._head.slot = _NONE

    def _slot(self, run: Progress) -> int:
        at, size = ctypes.addressof(run) - ctypes.addressof(self._runs), ctypes.sizeof(Progress)
        return at // size if 0 <= at < _SLOTS * size else _NONE

    def keep(self, about: Any) -> None:
        """Keep what whoever reads the rows has to know of them."""
        files.write(self.folder / _ABOUT, pickle.dumps(about))

    def rows(self, shape: tuple[int, int], name: str = _ROWS) -> Array:
        """As the function of that name."""
        path = self.folder / name
        array: Array = (
            np.lib.format.open_memmap(path, "w+", np.dtype("f8"), shape)
            if 0 not in shape
            else np.empty(shape)
        )
        return array

    # ---- afterwards ----------------------------------------------------------------------------------------------

    def state(self) -> State:
        """Where the process is; an FMU that writes where it should not may have been in this memory too."""
        head = self._head
        doing, slot = (
            head.text[: max(0, head.length)].decode(errors="replace"),
            head.slot,
        )  # it goes on meanwhile
        if not 0 <= slot < _SLOTS:
            return State(doing, head.point, 0, (head.beat, 0, 0))
        run = self._runs[slot]
        try:
            legend = pickle.loads((self.folder / f"{_LEGEND}{slot}").read_bytes())
        except Exception:  # it is gone, or damaged
            legend = [("an FMU", False)]
        operation, step = (
            legend[max(0, min(run.position, len(legend) - 1))] if legend else ("", False)
        )
        beat = (head.beat, run.point, run.position)
        return State(
            doing or operation, run.point, run.row, beat, bool(operation and not doing), step
        )

    def about(self) -> Any:
        """What was kept; None without, or where it is damaged."""
        with suppress(Exception):
            return pickle.loads((self.folder / _ABOUT).read_bytes())
        return None

    def filled(self, count: int, name: str = _ROWS) -> Array | None:
        """Rows, of which so many were filled; None without, where they are damaged, or cannot be so many."""
        with suppress(OSError, ValueError):
            found = np.array(np.load(self.folder / name))
            return found[:count] if 0 < count <= len(found) else None
        return None


current: Box | None = None  # of this process, if it is one beside another


def rows(shape: tuple[int, int], name: str = _ROWS) -> Array:
    """An array that is filled row by row, which outlives this process if it is one beside another.

    Raises
    ------
    UserError
        If there is no room for it.
    """
    if current is None:
        return np.empty(shape)
    try:
        return current.rows(shape, name)
    except OSError as error:
        raise UserError(
            f"{current.folder}: cannot be written ({error.strerror or error})"
        ) from error


class doing:  # in place of a generator, which takes as long as some calls do
    """Note what an FMU is asked to do, while it does it."""

    __slots__ = ("_what",)

    def __init__(self, what: str):
        self._what = what

    def __enter__(self) -> None:
        if current is not None:
            current.do(self._what.encode())

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        if current is not None and kind is None:  # else the next call notes itself
            current.done()


@contextmanager
def running() -> Iterator[Progress]:
    """Note how far a run is that is made in Python: its point."""
    box = current
    if box is None:
        yield Progress()
        return
    run = box.run([])
    run.point = run.position = run.row = 0
    box.begin(run)
    try:
        yield run
    finally:
        box.end()
        box.give_back(run)


def keep(about: Any) -> None:
    """Let whoever reads the rows know what they are."""
    if current is not None:
        current.keep(about)


class _Noted(partial[int]):
    """A call of an FMI function that is noted while it lasts."""

    box: Box
    words: bytes  # an FMU is asked a dozen times to begin anew, which must not take as long as what follows
    step: bool  # whose time the words leave open

    def __call__(self, /, *more: Any, **options: Any) -> int:
        words = self.words
        if self.step:
            at = [*self.args, *more][1]
            words = b"%s from %s s" % (words, f"{getattr(at, 'value', at):g}".encode())
        self.box.do(words)
        status = super().__call__(*more, **options)
        self.box.done()
        return status


def noted(call: Callable[..., int], whose: str, what: str) -> Any:
    """Return a call of an FMI function that is noted while it lasts; where there is nobody to read it, itself."""
    if current is None:
        return call
    one = _Noted(call)
    one.box, one.step = current, what in _STEPS
    one.words = f"{whose}: {'step' if one.step else what}".encode()
    return one
