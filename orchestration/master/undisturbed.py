"""What may come between two steps of a run in real time, kept away while it lasts: collection of garbage, others."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

_NICENESS = -10  # of -20 to 19; below are threads of the kernel that a rig's drivers wait for
_HIGH_PRIORITY_CLASS = 0x80  # of Windows; above is its own work only


@contextmanager
def undisturbed(processor: int | None = None, priority: bool = False) -> Iterator[list[str]]:
    """Do what the system allows so that the calling thread runs when it wants to; undone in the end.

    Garbage is not collected meanwhile, so circles of objects that a run makes stay in memory until its end.

    Parameters
    ----------
    processor : int, optional
        The only one to run on.
    priority : bool
        Whether to ask for a higher one.

    Yields
    ------
    list of str
        What could not be done, and why.
    """
    notes: list[str] = []
    with ExitStack() as undone:
        _hold_garbage(undone)
        wishes: list[tuple[str, Callable[[], Callable[[], object]]]] = []
        if processor is not None:
            wishes.append((f"running on processor {processor}", lambda: _bind(processor)))
        if priority:
            wishes.append(("a higher priority", _raise_priority))
        for what, act in wishes:
            try:
                undone.callback(act())
            except OSError as error:
                notes.append(f"{what} is not to be had here: {error.strerror or error}")
        yield notes


def _hold_garbage(undone: ExitStack) -> None:
    if gc.isenabled():
        undone.callback(gc.enable)
    if gc.get_freeze_count() == 0:  # else somebody has frozen objects for reasons of their own
        gc.collect()
        gc.freeze()
        undone.callback(gc.unfreeze)
    gc.disable()


def _bind(processor: int) -> Callable[[], object]:
    """Bind the calling thread to a processor; return what undoes it."""
    if sys.platform != "linux":
        raise OSError("the system does not let a program choose")
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {processor})
    return lambda: os.sched_setaffinity(0, before)


def _raise_priority() -> Callable[[], object]:
    """Raise the priority; return what undoes it."""
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        process, before = (
            kernel.GetCurrentProcess(),
            kernel.GetPriorityClass(kernel.GetCurrentProcess()),
        )
        if not kernel.SetPriorityClass(process, _HIGH_PRIORITY_CLASS):
            raise ctypes.WinError()
        return lambda: kernel.SetPriorityClass(process, before)
    niceness = os.getpriority(os.PRIO_PROCESS, 0)
    os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
    return lambda: os.setpriority(os.PRIO_PROCESS, 0, niceness)
