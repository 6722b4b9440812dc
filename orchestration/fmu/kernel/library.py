"""The stepping kernel as a library: compiled once on a machine, as records are, and its structures in ctypes."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fmus.kit.build import toolchain
from fmus.kit.build.library_cache import library, load
from fmus.kit.errors import UserError

# What an operation does, and why the kernel came back, as `kernel.c` has them.
(
    STEP,
    SET_REAL,
    GET_REAL,
    SET_INTEGER,
    SET_BOOLEAN,
    GET_WHOLE,
    SET_SLOPES,
    PASS,
    SCALE,
    DRIVE,
    DISTURB,
    KEEP,
    CALL,
    BEGIN,
    SPENT,
) = range(15)
DONE, PAUSED, FAILED, NO_NUMBER, NOT_OF_TYPE, CALLING = range(6)
_SOURCE = "kernel.c"


class Link(ctypes.Structure):
    """A value that is passed on."""

    _fields_ = (
        ("target", ctypes.c_void_p),
        ("source", ctypes.c_void_p),
        ("stride", ctypes.c_size_t),
        ("factor", ctypes.c_double),
        ("offset", ctypes.c_double),
    )


class Operation(ctypes.Structure):
    """One thing to do at every point."""

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
    """Where a run stands; ``run`` in `kernel.c`."""

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
    """Compile the kernel, or take it from the cache; None if there is no compiler, or it cannot be kept or loaded."""
    source = (Path(__file__).parent / _SOURCE).read_bytes()
    try:
        return load(library({_SOURCE: source}, _SOURCE, toolchain.host_platform()))
    except UserError:
        return None


@functools.cache
def stepper() -> Callable[[Any, int], int] | None:
    """Return what carries out a program.

    Returns
    -------
    callable or None
        Takes a reference to a `Progress` and the point to stop before, and returns why it came back. None without a
        kernel: it can all be done without.
    """
    function = getattr(_kernel(), "ppy_run", None)
    if function is not None:
        function.argtypes = [ctypes.c_void_p, ctypes.c_size_t]
        function.restype = ctypes.c_int
    return function


def exit_watch() -> Callable[[Any, Any], None] | None:
    """Return what has the process end with words and a status of failure, as long as a count is above zero.

    Returns
    -------
    callable or None
        Takes a reference to the count, and the words, both to be kept for good. None without a kernel.
    """
    function = getattr(_kernel(), "ppy_watch_exit", None)
    if function is not None:
        function.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
        function.restype = None
    return function
