"""A component over a whole record as a library for this machine: the engine of the native FMU without FMI around it."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.build import toolchain
from fmus.kit.build.library_cache import library, load
from fmus.kit.build.sources import FOLDER, UNIT, fmi_headers, unit
from fmus.kit.errors import UserError
from fmus.kit.layout import Layout
from fmus.kit.record.linearisation import Ladder
from fmus.kit.symbolic import codegen
from fmus.kit.symbolic.trace import Graph

Array = NDArray[np.float64]
_DOUBLES = ctypes.POINTER(ctypes.c_double)


class _Ladder(ctypes.Structure):
    """`Ladder` as ``exponential.c`` has it."""

    _fields_ = (
        ("levels", ctypes.c_int),
        ("affine", ctypes.c_int),
        ("largest", ctypes.c_double),
        ("worth", ctypes.c_double),
        ("matrix", _DOUBLES),
        ("phi", _DOUBLES),
    )


class RecordLibrary:
    """A library that runs a component over records.

    Parameters
    ----------
    path : Path
        See `compiled`.
    outputs, remembered : int
        How many outputs there are, and how many states and discrete states.
    """

    def __init__(self, path: Path, outputs: int, remembered: int):
        self._function, self._cases = _load(path)
        self._outputs, self._states = outputs, remembered

    @classmethod
    def of(cls, layout: Layout, made: Mapping[str, bytes]) -> RecordLibrary:
        """Compile the sources of a graph with this layout."""
        return cls(compiled(made), len(layout.outputs), len(layout.states) + len(layout.discretes))

    def simulate(
        self,
        time: Array,
        table: Array,
        linear: Array,
        parameters: Array,
        tolerance: float,
        effort: float,
        ladder: Ladder | None,
    ) -> tuple[Array, Array]:
        """Run over a record, as :meth:`Interpreted.simulate`."""
        outputs, states = (np.empty((len(time), size)) for size in (self._outputs, self._states))
        message = ctypes.create_string_buffer(1024)
        given = ladder and _Ladder(
            ladder.levels,
            int(ladder.affine),
            ladder.largest,
            ladder.worth,
            _pointer(ladder.matrix),
            _pointer(ladder.phi),
        )
        failed = self._function(
            len(time),
            _pointer(time),
            _pointer(table),
            _pointer(linear),
            _pointer(parameters),
            tolerance,
            effort,
            given and ctypes.byref(given),
            _pointer(outputs),
            _pointer(states),
            message,
            len(message),
        )
        if failed:
            raise UserError(message.value.decode(errors="replace"))
        return outputs, states

    def cases(
        self,
        time: Array,
        tables: Array,
        parameters: Array,
        tolerance: float,
        effort: float,
        columns: Sequence[int],
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Run over a record with other parameters each time.

        Parameters
        ----------
        time : ndarray, shape (n,)
        tables : ndarray, shape (k, n, u) or (1, n, u)
            Inputs of each case, or of all of them; held between the points.
        parameters : ndarray, shape (k, p)
        tolerance, effort : float
            As for `simulate`.
        columns : sequence of int
            What is kept, m of outputs, then states and discrete states.

        Returns
        -------
        courses : ndarray, shape (k, n, m)
            In rows as those of an FMU.
        done : ndarray of bool, shape (k,)
            Whether each could be run; else its course means nothing.

        Raises
        ------
        MemoryError
            If there is too little.
        """
        kept = np.array(columns, dtype=np.intc)
        courses, done = (
            np.empty((len(parameters), len(time), len(kept))),
            np.zeros(len(parameters), bool),
        )
        failed = self._cases(
            len(parameters),
            len(time),
            _pointer(time),
            _pointer(tables),
            tables[0].size * (len(tables) > 1),
            _pointer(parameters),
            tolerance,
            effort,
            kept.ctypes,
            len(kept),
            _pointer(courses),
            done.ctypes,
        )
        if failed:
            raise MemoryError
        return courses, done


def sources(graph: Graph, states: int) -> dict[str, bytes]:
    """C files of a graph, of whose states the first are those of the component."""
    written = {p.name: p.read_bytes() for p in FOLDER.iterdir() if p.is_file()} | fmi_headers()
    written |= {k: v.encode() for k, v in codegen.native_sources(graph, "", hosted=False).items()}
    written["record.h"] = f"#define RECORD_STATES {states}\n".encode()
    return written | {UNIT: unit("record.c", "native.c", "laws.c")}


def compiled(made: Mapping[str, bytes]) -> Path:
    """Compile sources, or find the library in the cache.

    Raises
    ------
    UserError
        If there is no compiler, or it fails.
    """
    target = toolchain.host_platform()
    return library(made, UNIT, target, () if target == "win64" else ("m",))


def _pointer(array: Array) -> object:
    return array.ctypes.data_as(_DOUBLES)


def _load(path: Path) -> tuple[Any, Any]:
    """Bind ``ppy_simulate`` and ``ppy_cases``."""
    there = load(path)
    one, many = there.ppy_simulate, there.ppy_cases
    one.argtypes = [
        ctypes.c_size_t,
        _DOUBLES,
        _DOUBLES,
        _DOUBLES,
        _DOUBLES,
        ctypes.c_double,
        ctypes.c_double,
        ctypes.POINTER(_Ladder),
        _DOUBLES,
        _DOUBLES,
        ctypes.c_char_p,
        ctypes.c_size_t,
    ]
    many.argtypes = [
        ctypes.c_size_t,
        ctypes.c_size_t,
        _DOUBLES,
        _DOUBLES,
        ctypes.c_size_t,
        _DOUBLES,
        ctypes.c_double,
        ctypes.c_double,
        ctypes.c_void_p,
        ctypes.c_size_t,
        _DOUBLES,
        ctypes.c_void_p,
    ]
    one.restype = many.restype = ctypes.c_int
    return one, many
