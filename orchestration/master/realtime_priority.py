"""Measures against delays of a run in real time: no garbage collection, own processor, priority."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

_NICENESS = -10  # of -20 to 19; the drivers of a rig wait for kernel threads with lower values
_HIGH_PRIORITY_CLASS = 0x80  # of Windows; the class above it is for the system itself


@contextmanager
def realtime_priority(processor: int | None = None, priority: bool = False) -> Iterator[list[str]]:
    """Keep the calling thread from being delayed within this context, as far as the system allows.

    Garbage is not collected meanwhile, so reference cycles that a run makes stay in memory until
    its end.

    Parameters
    ----------
    processor : int, optional
        The only processor to run on.
    priority : bool
        Whether to raise the priority.

    Yields
    ------
    list of str
        Measures that were not possible, and why.
    """
    notes: list[str] = []
    with ExitStack() as cleanup:
        _stop_garbage_collection(cleanup)
        measures: list[tuple[str, Callable[[], Callable[[], object]]]] = []
        if processor is not None:
            measures.append((f"running on processor {processor}", lambda: _bind(processor)))
        if priority:
            measures.append(("a higher priority", _raise_priority))
        for name, apply in measures:  # which returns a function that undoes it
            try:
                cleanup.callback(apply())
            except OSError as error:
                notes.append(f"{name} is not to be had here: {error.strerror or error}")
        yield notes


def _stop_garbage_collection(cleanup: ExitStack) -> None:
    """Collect garbage once, freeze what remains, and collect no more until the cleanup."""
    if gc.isenabled():
        cleanup.callback(gc.enable)
    if gc.get_freeze_count() == 0:  # else objects are frozen for another purpose
        gc.collect()
        gc.freeze()
        cleanup.callback(gc.unfreeze)
    gc.disable()


def _bind(processor: int) -> Callable[[], object]:
    """Bind the calling thread to a processor; return a function that undoes it."""
    if sys.platform != "linux":
        raise OSError("the system does not let a program choose")
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {processor})
    return lambda: os.sched_setaffinity(0, before)


def _raise_priority() -> Callable[[], object]:
    """Raise the priority of this process; return a function that undoes it."""
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        process = kernel.GetCurrentProcess()
        before = kernel.GetPriorityClass(process)
        if not kernel.SetPriorityClass(process, _HIGH_PRIORITY_CLASS):
            raise ctypes.WinError()
        return lambda: kernel.SetPriorityClass(process, before)
    niceness = os.getpriority(os.PRIO_PROCESS, 0)
    os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
    return lambda: os.setpriority(os.PRIO_PROCESS, 0, niceness)
