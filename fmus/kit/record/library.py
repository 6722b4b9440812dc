"""Compiled libraries that run a component over whole records: the native engine without FMI.

The engine (``fmi/record.c``) is compiled once for a machine; of a model only its laws are.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from fmus.kit.arrays import Array, Mask
from fmus.kit.build import (
    UNIT,
    cached_library,
    load_library,
    record_engine_sources,
    toolchain,
)
from fmus.kit.errors import UserError
from fmus.kit.layout import Layout
from fmus.kit.record.linearisation import Ladder

_ENGINE = Lock()  # threads that need the engine at once wait for the one that compiles it
_DOUBLES = ctypes.POINTER(ctypes.c_double)


class _Ladder(ctypes.Structure):
    """The structure of ``exponential.c`` for a `Ladder`."""

    _fields_ = (
        ("levels", ctypes.c_int),
        ("affine", ctypes.c_int),
        ("states", ctypes.c_int),
        ("largest", ctypes.c_double),
        ("worth", ctypes.c_double),
        ("matrix", _DOUBLES),
        ("phi", _DOUBLES),
    )


class RecordLibrary:
    """A component that is run over records by compiled code.

    Parameters
    ----------
    engine, model : Path
        Libraries of the engine and of the model, or one that is both.
    outputs, states : int
        Number of outputs, and of states and discrete states together.

    Raises
    ------
    UserError
        If a library cannot be loaded.
    """

    def __init__(self, engine: Path, model: Path, outputs: int, states: int):
        self._simulate, self._cases = _load_engine(engine)
        self._model = _load_model(model)
        self._outputs = outputs
        self._states = states

    @classmethod
    def from_sources(cls, layout: Layout, sources: Mapping[str, bytes]) -> RecordLibrary:
        """Compile a model with this layout, of which these are the sources, and load it."""
        states = len(layout.states) + len(layout.discretes)
        return cls(compiled_engine(), compiled(sources), len(layout.outputs), states)

    def simulate(
        self,
        time: Array,
        table: Array,
        linear: Array,
        parameters: Array,
        *,
        tolerance: float,
        effort: float,
        ladder: Ladder | None,
    ) -> tuple[Array, Array, float]:
        """Run over a record, as :meth:`Interpreted.simulate`."""
        outputs = np.empty((len(time), self._outputs))
        states = np.empty((len(time), self._states))
        message = ctypes.create_string_buffer(1024)
        made = ctypes.c_double()
        steps = None  # of the exponential integrator; without them by Runge and Kutta
        if ladder is not None:
            steps = _Ladder(
                ladder.levels,
                int(ladder.affine),
                ladder.matrix.shape[-1],
                ladder.largest,
                ladder.worth,
                _pointer(ladder.matrix),
                _pointer(ladder.phi),
            )
        failed = self._simulate(
            self._model,
            len(time),
            _pointer(time),
            _pointer(table),
            _pointer(linear),
            _pointer(parameters),
            tolerance,
            effort,
            None if steps is None else ctypes.byref(steps),
            ctypes.byref(made),
            _pointer(outputs),
            _pointer(states),
            message,
            len(message),
        )
        if failed:
            raise UserError(message.value.decode(errors="replace"))
        return outputs, states, made.value

    def cases(
        self,
        time: Array,
        tables: Array,
        parameters: Array,
        tolerance: float,
        effort: float,
        columns: Sequence[int],
    ) -> tuple[Array, Mask]:
        """Run over a record once for each row of parameters.

        Parameters
        ----------
        time : ndarray, shape (n,)
        tables : ndarray, shape (k, n, u) or (1, n, u)
            Inputs of each case, or of all of them; held between the points.
        parameters : ndarray, shape (k, p)
        tolerance, effort : float
            As for `simulate`.
        columns : sequence of int
            The m signals that are returned: numbers of outputs, then states and discrete states.

        Returns
        -------
        courses : ndarray, shape (k, n, m)
            In rows as those of an FMU.
        done : ndarray of bool, shape (k,)
            Whether each could be run; otherwise its course means nothing.

        Raises
        ------
        MemoryError
            If there is too little memory.
        """
        kept = np.array(columns, dtype=np.intc)
        courses = np.empty((len(parameters), len(time), len(kept)))
        done = np.zeros(len(parameters), bool)
        failed = self._cases(
            self._model,
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


def compiled(sources: Mapping[str, bytes]) -> Path:
    """Compile sources for this machine, or return the library from the cache.

    Raises
    ------
    UserError
        If there is no compiler, or it fails.
    """
    target = toolchain.host_platform()
    return cached_library(sources, UNIT, target, () if target == "win64" else ("m",))


def compiled_engine() -> Path:
    """Compile the engine for this machine, or return it from the cache.

    Raises
    ------
    UserError
        If there is no compiler, or it fails.
    """
    with _ENGINE:
        return compiled(record_engine_sources())


def _pointer(array: Array) -> object:
    """Return a pointer to the values of an array, which must outlive it."""
    return array.ctypes.data_as(_DOUBLES)


def _load_engine(path: Path) -> tuple[Any, Any]:
    """Load an engine, and return its functions ``ppy_simulate`` and ``ppy_cases``."""
    loaded = load_library(path)
    simulate = loaded.ppy_simulate
    cases = loaded.ppy_cases
    simulate.argtypes = [
        ctypes.c_void_p,
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
        _DOUBLES,
        ctypes.c_char_p,
        ctypes.c_size_t,
    ]
    cases.argtypes = [
        ctypes.c_void_p,
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
    simulate.restype = ctypes.c_int
    cases.restype = ctypes.c_int
    return simulate, cases


def _load_model(path: Path) -> ctypes.c_void_p:
    """Load a model, and return where its description is (``fmi2/any_model.h``)."""
    model = load_library(path).ppy_model
    model.argtypes = []
    model.restype = ctypes.c_void_p
    return ctypes.c_void_p(model())
