"""Processes of the server: each in a session of its own, and handles on processes of others.

A terminal sends signals to all processes of its foreground group, and an operator may send one to
all processes of the server. Only the front must receive them: the others end by SIGTERM, by
SIGKILL, or with the front.
"""

from __future__ import annotations

import io
import mmap
import os
import select
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from time import monotonic, sleep
from typing import TYPE_CHECKING

import psutil

# by which the others learn of their children and are ended, or which no process can ignore
_FOR_ALL = ("SIGTERM", "SIGCHLD", "SIGKILL", "SIGSTOP")
_LOOK = 0.001  # s between two looks whether a process has ended
_MEMORY = 2**26  # bytes of address space that opening a backend may take
_DESCRIPTORS = 16
_HAS_PIPES = os.name == "posix"  # that can be told not to block
_PRINTED = 65536  # bytes, what a pipe holds
_LONGEST_PRINTED = 900  # characters of a line of the log

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


def detach() -> None:
    """Leave the terminal: a session of its own, in which signals for the front are ignored.

    A fault of the process itself, such as SIGSEGV, ends it in spite of that.
    """
    numbers = _for_front_alone()
    for number in numbers:
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)
    if hasattr(os, "setsid"):
        with suppress(PermissionError):  # it leads a group already
            os.setsid()


@contextmanager
def undisturbed() -> Iterator[None]:
    """Block the signals for the front while processes are started in this context.

    A new process inherits the blocked signals, so that none reaches it before it detaches itself.
    No signal is lost: those that arrive here are delivered after the context. It does not inherit
    the priority, which its start would use up.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _for_front_alone())
    _reset_priority_of_children(True)
    try:
        yield
    finally:
        _reset_priority_of_children(False)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _reset_priority_of_children(resets: bool) -> None:
    """Let processes that this thread starts begin without its real-time priority, or with it."""
    if not hasattr(os, "SCHED_RESET_ON_FORK"):
        return
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    flag = os.SCHED_RESET_ON_FORK if resets else 0
    with suppress(OSError):  # who has no priority may not set what is there already
        os.sched_setscheduler(0, policy | flag, os.sched_getparam(0))


def _for_front_alone() -> set[signal.Signals]:
    """Return the signals of this platform that are for the front alone."""
    for_all = {getattr(signal, name) for name in _FOR_ALL if hasattr(signal, name)}
    return signal.valid_signals() - for_all


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """End this process, even inside a driver, if the context lasts too long.

    The kernel keeps the time: nothing is started or opened for it.

    Parameters
    ----------
    seconds : float
        Infinity for no end.
    """
    if seconds == float("inf") or not hasattr(signal, "setitimer"):
        yield  # without such a timer, the other guard ends a process that hangs
        return
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, signal.SIG_IGN)


class Output:
    """Pipe for what backends print in processes of the server: nobody who writes to it waits.

    What does not fit in it before the front reads it is lost.
    """

    def __init__(self) -> None:
        self._reader, self._writer = Pipe(duplex=False)
        for end in (self._reader, self._writer) if _HAS_PIPES else ():
            os.set_blocking(end.fileno(), False)

    def redirect(self) -> None:
        """Let standard output and standard error of this process go into the pipe."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        descriptor = self._writer.fileno() if _HAS_PIPES else nowhere
        for standard in (1, 2):
            os.dup2(descriptor, standard)
        os.close(nowhere)
        sys.stdout = io.TextIOWrapper(_Lossy(1), errors="backslashreplace", write_through=True)
        sys.stderr = io.TextIOWrapper(_Lossy(2), errors="backslashreplace", write_through=True)

    def read(self) -> str:
        """Return the last of what was printed since the last call, in one line."""
        try:
            printed = os.read(self._reader.fileno(), _PRINTED) if _HAS_PIPES else b""
        except OSError:  # there is nothing
            return ""
        return " ".join(printed.decode(errors="replace").split())[-_LONGEST_PRINTED:]


class _Lossy(io.RawIOBase):
    """A stream that loses what its descriptor does not take at once."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._descriptor

    def write(self, data: ReadableBuffer) -> int:
        with suppress(OSError):
            os.write(self._descriptor, data)
        return memoryview(data).nbytes


class Reserve:
    """Address space and descriptors that are kept for the way to the safe state."""

    def __init__(self) -> None:
        self._memory: list[mmap.mmap] = []
        self._descriptors: list[int] = []
        self.fill()

    def fill(self) -> None:
        """Take what is there; nothing of it costs memory of the machine."""
        with suppress(OSError, MemoryError):
            while not self._memory:
                self._memory.append(mmap.mmap(-1, _MEMORY))
            while len(self._descriptors) < _DESCRIPTORS:
                self._descriptors.append(os.open(os.devnull, os.O_RDONLY))

    def release(self) -> None:
        """Give it back to whatever this process does next."""
        while self._memory:
            self._memory.pop().close()
        while self._descriptors:
            os.close(self._descriptors.pop())


class OtherProcess:
    """A process of the server that another process started.

    A later process with the same number is not taken for it. Where the system has descriptors of
    processes, it is held by one from now on: nothing is opened to look at it or to end it.

    Parameters
    ----------
    number : int
        Number of the process.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self._process: psutil.Process | None = None
        self._ended: select.poll | None = None
        self._descriptor = -1
        self._is_number_valid = True
        try:
            if hasattr(os, "pidfd_open"):
                self._descriptor = os.pidfd_open(number)
                self._ended = select.poll()
                self._ended.register(self._descriptor, select.POLLIN)
            else:
                self._process = psutil.Process(number)
        except (OSError, psutil.Error) as error:
            # without a descriptor that is left, the number has to do
            has_ended = isinstance(error, (ProcessLookupError, psutil.Error)) or os.name == "nt"
            self._is_number_valid = not has_ended

    def __del__(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)

    def is_alive(self) -> bool:
        """Return True if the process has not ended, even if it does not run."""
        if self._ended is not None:
            return not self._ended.poll(0)
        try:
            if self._process is None:
                if self._is_number_valid:
                    os.kill(self.number, 0)
                return self._is_number_valid
            return self._process.is_running() and self._process.status() != psutil.STATUS_ZOMBIE
        except (psutil.Error, ProcessLookupError):
            return False

    def kill(self) -> None:
        """End the process at once."""
        with suppress(psutil.Error, OSError):
            if self._ended is not None:
                signal.pidfd_send_signal(self._descriptor, signal.SIGKILL)
            elif self._process is not None:
                self._process.kill()
            elif self._is_number_valid:
                os.kill(self.number, signal.SIGKILL)

    def join(self, timeout: float) -> None:
        """Wait until the process has ended, at most `timeout` in s."""
        until = monotonic() + timeout
        while self.is_alive() and monotonic() < until:
            sleep(_LOOK)
