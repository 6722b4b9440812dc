"""Compiled libraries that simulate a component over whole records, without FMI.

The engine (``fmi/record.c``) is compiled once for a machine; each model is a library of its laws.
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

_ENGINE = Lock()  # so that one thread compiles the engine and the others wait
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

    @classmethod
    def of(cls, ladder: Ladder) -> _Ladder:
        """Return the structure of a ladder, whose arrays it does not copy."""
        return cls(
            ladder.levels,
            int(ladder.affine),
            ladder.matrix.shape[-1],
            ladder.largest,
            ladder.worth,
            _pointer(ladder.matrix),
            _pointer(ladder.phi),
        )


class RecordLibrary:
    """A component whose compiled code is simulated over records.

    Parameters
    ----------
    engine, model : Path
        Libraries of the engine and of the model, or one library of both.
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
        """Compile a model from its sources, and load it."""
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
        """Simulate the component over a record of n samples.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds, increasing.
        table : ndarray, shape (n, inputs)
            Inputs, SI.
        linear : ndarray, shape (inputs,)
            1 for an input that is interpolated between samples, 0 for one that is constant.
        parameters : ndarray, shape (parameters,)
            SI.
        tolerance : float
            Accuracy of an internal step.
        effort : float
            Largest mean number of internal steps per sample.
        ladder : Ladder or None
            Matrix functions of a component that is stiff over the record.

        Returns
        -------
        outputs : ndarray, shape (n, outputs)
        states : ndarray, shape (n, states)
            Continuous states, then discrete states.
        steps : float
            Number of internal steps.

        Raises
        ------
        UserError
            If the simulation fails.
        """
        outputs = np.empty((len(time), self._outputs))
        states = np.empty((len(time), self._states))
        message = ctypes.create_string_buffer(1024)
        steps = ctypes.c_double()
        failed = self._simulate(
            self._model,
            len(time),
            _pointer(time),
            _pointer(table),
            _pointer(linear),
            _pointer(parameters),
            tolerance,
            effort,
            None if ladder is None else ctypes.byref(_Ladder.of(ladder)),
            ctypes.byref(steps),
            _pointer(outputs),
            _pointer(states),
            message,
            len(message),
        )
        if failed:
            raise UserError(message.value.decode(errors="replace"))
        return outputs, states, steps.value

    def cases(
        self,
        time: Array,
        tables: Array,
        parameters: Array,
        tolerance: float,
        effort: float,
        columns: Sequence[int],
    ) -> tuple[Array, Mask]:
        """Simulate the component over a record once for each row of parameters.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        tables : ndarray, shape (k, n, u) or (1, n, u)
            Inputs of each case, or of all cases, SI; constant from sample to sample.
        parameters : ndarray, shape (k, p)
            SI.
        tolerance, effort : float
            See `simulate`.
        columns : sequence of int
            Indices of m signals to return, in the order outputs, states, discrete states.

        Returns
        -------
        courses : ndarray, shape (k, n, m)
            Signals of each case at the sample times.
        done : ndarray of bool, shape (k,)
            Whether the simulation of each case succeeded; otherwise its signals are meaningless.

        Raises
        ------
        MemoryError
            If there is too little memory.
        """
        indices = np.array(columns, dtype=np.intc)
        courses = np.empty((len(parameters), len(time), len(indices)))
        done = np.zeros(len(parameters), bool)
        failed = self._cases(
            self._model,
            len(parameters),
            len(time),
            _pointer(time),
            _pointer(tables),
            tables[0].size * (len(tables) > 1),  # from the inputs of one case to the next
            _pointer(parameters),
            tolerance,
            effort,
            indices.ctypes,
            len(indices),
            _pointer(courses),
            done.ctypes,
        )
        if failed:
            raise MemoryError
        return courses, done


def compiled(sources: Mapping[str, bytes]) -> Path:
    """Return the library of sources for this machine, compiled unless the cache has it.

    Raises
    ------
    UserError
        If there is no compiler, or it fails.
    """
    target = toolchain.host_platform()
    return cached_library(sources, UNIT, target, () if target == "win64" else ("m",))


def compiled_engine() -> Path:
    """Return the library of the engine for this machine, compiled unless the cache has it.

    Raises
    ------
    UserError
        If there is no compiler, or it fails.
    """
    with _ENGINE:
        return compiled(record_engine_sources())


def _pointer(array: Array) -> object:
    """Return a pointer to the values of an array; the array must outlive the pointer."""
    return array.ctypes.data_as(_DOUBLES)


def _load_engine(path: Path) -> tuple[Any, Any]:
    """Load an engine, and return its functions ``ppy_simulate`` and ``ppy_cases``."""
    library = load_library(path)
    simulate = library.ppy_simulate
    cases = library.ppy_cases
    # as in the prototypes in fmi/record.c
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
    """Load a model, and return the address of its description (``fmi/any_model.h``)."""
    model = load_library(path).ppy_model
    model.argtypes = []
    model.restype = ctypes.c_void_p
    return ctypes.c_void_p(model())
