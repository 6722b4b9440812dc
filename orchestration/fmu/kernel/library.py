"""The shared library of the stepping kernel, which is compiled and cached, and its structures."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fmus.kit import UserError
from fmus.kit.build import cached_library, load_library, toolchain

# Kinds of operations, as in `kernel.c`.
(
    STEP,
    SET_REAL,
    GET_REAL,
    SET_INTEGER,
    SET_BOOLEAN,
    GET_WHOLE,
    PASS,
    SCALE,
    DRIVE,
    DISTURB,
    KEEP,
    CALL,
    BEGIN,
    SPENT,
) = range(14)
# Reasons for which the kernel returns, as in `kernel.c`.
DONE, PAUSED, FAILED, NO_NUMBER, NOT_OF_TYPE, CALLING = range(6)
_SOURCE = "kernel.c"


class ValueLink(ctypes.Structure):
    """A value that is copied from an output to an input; ``link`` in `kernel.c`."""

    _fields_ = (
        ("target", ctypes.c_void_p),
        ("source", ctypes.c_void_p),
        ("stride", ctypes.c_size_t),
        ("factor", ctypes.c_double),
        ("offset", ctypes.c_double),
    )


class Operation(ctypes.Structure):
    """One operation at every communication point; ``operation`` in `kernel.c`."""

    _fields_ = (
        ("kind", ctypes.c_int),
        ("owner", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("component", ctypes.c_void_p),
        ("references", ctypes.c_void_p),
        ("count", ctypes.c_size_t),
        ("values", ctypes.c_void_p),
        ("stride", ctypes.c_size_t),
        ("ends", ctypes.c_void_p),
        ("integers", ctypes.c_void_p),
        ("places", ctypes.c_void_p),
        ("links", ctypes.c_void_p),
    )


class Progress(ctypes.Structure):
    """The progress of a run; ``run`` in `kernel.c`."""

    _fields_ = (
        ("program", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("point", ctypes.c_size_t),
        ("position", ctypes.c_size_t),
        ("row", ctypes.c_size_t),
        ("status", ctypes.c_int),
        ("index", ctypes.c_int),
        ("interrupted", ctypes.c_int),
        ("then", ctypes.c_double),
        ("seconds", ctypes.c_void_p),
        ("warnings", ctypes.c_void_p),
    )


@functools.cache
def _kernel() -> Any:
    """Return the kernel, compiled if it is not in the cache; None without a C compiler."""
    source = (Path(__file__).parent / _SOURCE).read_bytes()
    try:
        return load_library(cached_library({_SOURCE: source}, _SOURCE, toolchain.host_platform()))
    except UserError:
        return None


@functools.cache
def load_stepper() -> Callable[[Any, int], int] | None:
    """Return the function of the kernel that executes a program.

    Returns
    -------
    callable or None
        Takes a reference to a `Progress` and the point to stop before; returns the reason for
        stopping. None without a C compiler, where Python steps instead.
    """
    function = getattr(_kernel(), "ppy_run", None)
    if function is not None:
        function.argtypes = [ctypes.c_void_p, ctypes.c_size_t]
        function.restype = ctypes.c_int
    return function


def load_exit_watch() -> Callable[[Any, Any], None] | None:
    """Return the function that turns an exit of the process into a failure while FMUs are open.

    Returns
    -------
    callable or None
        Takes a reference to the number of open FMUs, and the message to print at the exit; both
        must stay in memory. None without a C compiler.
    """
    function = getattr(_kernel(), "ppy_watch_exit", None)
    if function is not None:
        function.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
        function.restype = None
    return function
