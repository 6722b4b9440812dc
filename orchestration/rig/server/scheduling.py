"""Scheduling in real time, as far as the system allows it.

Deadlines are absolute, a process has a priority and a core of its own, and garbage is collected by
hand.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from math import floor

_ALL_MEMORY = 3  # MCL_CURRENT | MCL_FUTURE of mlockall


class Deadlines:
    """Deadlines a period apart, which never drift; those that are missed are skipped and counted.

    Parameters
    ----------
    period : float
        Period in s.
    start : float
        The first one.

    Attributes
    ----------
    next : float
        The next one: always a whole number of periods from the start.
    missed : int
        Number of deadlines that were skipped.
    """

    def __init__(self, period: float, start: float) -> None:
        self._period = period
        self._start = start
        self._number = 0
        self.next = start
        self.missed = 0

    def advance(self, now: float) -> None:
        """Go on to the next deadline that is not over yet; those in between are missed.

        Parameters
        ----------
        now : float
            The time in s.
        """
        due = max(self._number + 1, floor((now - self._start) / self._period) + 1)
        self.missed += due - self._number - 1
        self._number = due
        self.next = self._start + due * self._period


class Suspension:
    """Detector of suspensions of the computer, during which the clock of deadlines stops.

    Only Linux has a clock that continues meanwhile.
    """

    def __init__(self) -> None:
        self._ahead = _boot_time_ahead()

    def since(self) -> float:
        """Return a lower bound in s of the suspended time since the last call."""
        _, most_before = self._ahead
        self._ahead = _boot_time_ahead()
        least_now, _ = self._ahead
        return max(0.0, least_now - most_before)


def _boot_time_ahead() -> tuple[float, float]:
    """Return the least and the largest lead of the boot-time clock over the monotonic one, s.

    The boot-time clock also runs during a suspension. The two are read one after the other, and the
    process may have to wait in between.
    """
    if not hasattr(time, "CLOCK_BOOTTIME"):
        return 0.0, 0.0
    before = time.monotonic()
    boot = time.clock_gettime(time.CLOCK_BOOTTIME)
    return boot - time.monotonic(), boot - before


class Collector:
    """Garbage collection by hand, between two deadlines.

    Objects that exist when it is made are exempt.
    """

    _EVERY = 1.0  # s: so few objects are made in between that it takes some 10 microseconds

    def __init__(self) -> None:
        gc.collect()
        gc.freeze()
        gc.disable()
        self._last = 0.0

    def collect(self, now: float) -> None:
        """Collect garbage, once a second at most.

        Parameters
        ----------
        now : float
            The time in s.
        """
        if now - self._last > self._EVERY:
            self._last = now
            gc.collect()


def prefer(priority: int | None, cpu: int | None) -> list[str]:
    """Give this process a real-time priority and a core, where that is possible and allowed.

    With a priority its memory is locked, too: it never waits for a page from the disk.

    Parameters
    ----------
    priority : int or None
        1 to 99, of the first-in first-out class.
    cpu : int or None
        Number of the core.

    Returns
    -------
    list of str
        Lines about each setting that was refused, with the reason.
    """
    notes = []
    for option, value, apply in (
        ("priority", priority, _set_priority),
        ("priority", priority, _lock_memory),
        ("cpu", cpu, lambda core: os.sched_setaffinity(0, {core})),
    ):
        if value is None:
            continue
        reason = ""
        try:
            apply(value)
        except AttributeError:
            reason = "this system has no such thing"
        except OSError as error:
            reason = str(error.strerror or error)
        if reason:
            notes.append(f"--device-{option} {value}: {reason}; it goes on without")
    return notes


def _set_priority(priority: int) -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def _lock_memory(_: int) -> None:
    """Keep all memory of this process in the memory of the machine; raise OSError if not."""
    if not sys.platform.startswith("linux"):
        raise OSError("this system cannot lock memory")
    if ctypes.CDLL(None, use_errno=True).mlockall(_ALL_MEMORY):
        raise OSError(f"memory cannot be locked: {os.strerror(ctypes.get_errno())}")
