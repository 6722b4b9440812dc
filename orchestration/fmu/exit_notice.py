"""A notice that is printed if an FMU exits this process, whose exit status may mean success."""

from __future__ import annotations

import atexit
import ctypes
import functools
from collections import Counter

from orchestration.fmu.isolation import shared_progress
from orchestration.fmu.kernel import load_exit_watch
from orchestration.reporting import option

_NOTICE_SIZE = 500  # bytes
_open_count = ctypes.c_int(0)
_notice = ctypes.create_string_buffer(_NOTICE_SIZE)
_open_fmus: Counter[str] = Counter()


def note_opened(label: str) -> None:
    """Watch for an exit of this process until the FMU, whose name is `label`, is closed."""
    # the parent of an isolated process notices its exit
    if shared_progress.current is None and _start_watch():
        _open_fmus[label] += 1
        _update_notice()


def note_closed(label: str) -> None:
    """Stop watching for an exit if this was the last open FMU."""
    if _open_fmus[label]:
        _open_fmus[label] -= 1
        _update_notice()


def _update_notice() -> None:
    """Write the names of the open FMUs, and their number, into the memory of the watch."""
    names = ", ".join(sorted(+_open_fmus))
    notice = f"error: {names}: the FMU has ended this process; give {option('isolate', True)}\n"
    _notice.value = notice.encode()[: _NOTICE_SIZE - 1]
    _open_count.value = _open_fmus.total()


@functools.cache
def _start_watch() -> bool:
    """Install the watch at the first call; return False if it cannot be compiled."""
    watch = load_exit_watch()
    if watch is None:
        return False
    # the watch reads this memory after Python has freed its objects
    for memory in (_open_count, _notice):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(memory))
    watch(ctypes.byref(_open_count), _notice)
    atexit.register(_stop_watch)  # Python's own exit is no failure
    return True


def _stop_watch() -> None:
    _open_count.value = 0
