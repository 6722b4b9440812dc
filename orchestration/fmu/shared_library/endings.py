"""An FMU that ends this process, noticed: without that, it would end with the status of success, and without a word."""

from __future__ import annotations

import atexit
import ctypes
import functools
from collections import Counter

from orchestration.fmu.isolation import box
from orchestration.fmu.kernel.library import exit_watch

_ROOM = 500
_count = ctypes.c_int(0)
_words = ctypes.create_string_buffer(_ROOM)
_open: Counter[str] = Counter()


def opened(label: str) -> None:
    """Watch for the end of this process from now on, as long as an FMU is open."""
    if box.current is None and _watched():  # what ends a process beside another is told by that
        _open[label] += 1
        _tell()


def closed(label: str) -> None:
    """Watch no more, if it was the last."""
    if _open[label]:
        _open[label] -= 1
        _tell()


def _tell() -> None:
    names = ", ".join(sorted(+_open))
    _words.value = f"error: {names}: the FMU has ended this process; give --isolate\n".encode()[
        : _ROOM - 1
    ]
    _count.value = _open.total()


@functools.cache
def _watched() -> bool:
    watch = exit_watch()
    if watch is None:
        return False
    watch(ctypes.byref(_count), _words)
    atexit.register(_disarm)  # an end by Python is none by an FMU
    return True


def _disarm() -> None:
    _count.value = 0
