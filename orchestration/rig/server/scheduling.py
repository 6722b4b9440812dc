"""Scheduling in real time, as far as the system allows it.

Deadlines are absolute, a process has a priority and a core of its own, and garbage is collected by
hand. Where no priority is permitted, the watchdog time is that of a busy machine.
"""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import ceil, floor

# real-time priorities of a client and of the processes of a server: who watches comes before who is
# watched
CLIENT, FRONT, DEVICE, GUARD = 5, 10, 20, 30
WATCHDOG = 0.2  # s, unless processes wake too late for it
_LONGEST_WATCHDOG = 2.0  # s
_STEPS = 20  # of a measured watchdog time in a second
_MEASURING = 0.5  # s
_NAP = 0.005  # s
_WORK = 0.01  # s of processor time after it, as a call of the backend takes
_BUSY = 2  # processes that compete for each core meanwhile, as an opened browser does
# the watchdog time has to be as many times the latest wake-up of a process: half of it is there for
# late wake-ups, which may become twice as late as those seen so far
WAKE_UPS = 4.0
_RAN = 0.5  # share of a silence in which a process has to have run, if it hangs by itself
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
        reason = "" if value is None else _refusal(apply, value)
        if reason:
            notes.append(f"--device-{option} {value}: {reason}; it goes on without")
    return notes


def prefer_to_others(priority: int) -> str:
    """Give this process a real-time priority by default, where that is permitted.

    Parameters
    ----------
    priority : int
        1 to 99, of the first-in first-out class.

    Returns
    -------
    str
        Why it has none; empty if it has.
    """
    return _refusal(_set_priority, priority)


def _refusal(apply: Callable[[int], object], value: int) -> str:
    """Apply a setting; return why it is refused, which is empty if it is not."""
    try:
        apply(value)
    except AttributeError:
        return "this system has no such thing"
    except OSError as error:
        return str(error.strerror or error)
    return ""


@contextmanager
def preferred(priority: int) -> Iterator[str]:
    """Give this thread a real-time priority while the context lasts, where that is permitted.

    Threads that it starts meanwhile have the same, and keep it.

    Parameters
    ----------
    priority : int

    Yields
    ------
    str
        Why it has none; empty if it has.
    """
    refusal = prefer_to_others(priority)
    try:
        yield refusal
    finally:
        if not refusal:
            go_without_priority()


def go_without_priority() -> None:
    """Take the real-time priority from this thread, and what it starts from now on."""
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def keep_libraries_to_one_thread() -> None:
    """Let libraries of linear algebra in processes that are started from now on have no threads.

    Theirs would begin before the process has its priority, and it would wait for them.
    """
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")


def default_watchdog(tell: Callable[[str], None]) -> float:
    """Return the watchdog time in s for the server in this process, which was given none.

    Parameters
    ----------
    tell : callable
        Called with a line on how it was chosen, where other programs may delay the server.
    """
    with preferred(FRONT) as refusal:
        if not refusal:
            return WATCHDOG
    withheld = _longest_withheld()
    needed = ceil(_STEPS * WAKE_UPS * withheld) / _STEPS
    watchdog = min(max(WATCHDOG, needed), _LONGEST_WATCHDOG)
    tell(
        f"real-time priority: {refusal}; other programs may delay this rig. Beside {_BUSY} busy"
        f" processes on each core, this machine withheld up to {1e3 * withheld:.3g} ms of its time:"
        f" the watchdog time is {watchdog:g} s (--watchdog)"
    )
    return watchdog


def _longest_withheld() -> float:
    """Return the longest time that a machine with busy cores withholds from a little work, s."""
    cores = os.cpu_count() or 1
    busy = [sys.executable, "-S", "-c", "while True: pass"]
    others = [subprocess.Popen(busy) for _ in range(_BUSY * cores)]
    longest = 0.0
    until = time.monotonic() + _MEASURING
    try:
        while (begun := time.monotonic()) < until:
            before = time.process_time()
            time.sleep(_NAP)
            while (worked := time.process_time() - before) < _WORK:
                pass
            longest = max(longest, time.monotonic() - begun - _NAP - worked)
    finally:
        for other in others:
            other.kill()
        for other in others:
            other.wait()
    return longest


class ProcessorTime:
    """Processor time of another process, as Linux has it (proc(5)); its files stay open.

    Parameters
    ----------
    process : int
        Number of the process.
    """

    def __init__(self, process: int) -> None:
        self._files: list[int] = []
        self._ran = 0.0
        self._since = 0.0
        with suppress(OSError):
            for name in ("stat", "schedstat"):
                self._files.append(os.open(f"/proc/{process}/{name}", os.O_RDONLY))

    def __del__(self) -> None:
        for file in self._files:
            os.close(file)

    def note(self, since: float) -> None:
        """Note what the process has had when it showed a sign of life, at a time in s."""
        if since != self._since:
            self._since = since
            self._ran = self._total()

    def was_withheld(self, silence: float) -> bool:
        """Return True if the process is ready to run, and was not run in most of a silence in s."""
        return self._is_ready() and self._total() - self._ran < _RAN * silence

    def _is_ready(self) -> bool:
        return self._read(0).rpartition(b")")[2].split()[:1] == [b"R"]

    def _total(self) -> float:
        return 1e-9 * int((self._read(1).split() or [b"0"])[0])

    def _read(self, file: int) -> bytes:
        """Return the contents of a file of the process; empty if there is none, or it has ended."""
        try:
            return os.pread(self._files[file], 4096, 0)
        except (OSError, IndexError):
            return b""


def _set_priority(priority: int) -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def _lock_memory(_: int) -> None:
    """Keep all memory of this process in the memory of the machine; raise OSError if not."""
    if not sys.platform.startswith("linux"):
        raise OSError("this system cannot lock memory")
    if ctypes.CDLL(None, use_errno=True).mlockall(_ALL_MEMORY):
        raise OSError(f"memory cannot be locked: {os.strerror(ctypes.get_errno())}")
