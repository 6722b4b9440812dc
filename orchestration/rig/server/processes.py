"""Processes of the server: each in a session of its own, and handles on processes of others.

A terminal sends signals to all processes of its foreground group: Ctrl-C, Ctrl+backslash, Ctrl-Z,
and the hang-up when it is closed. Of the server's processes only the front must receive them.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from time import monotonic, sleep

import psutil

# signals that concern the front alone
_FOR_FRONT_ALONE = (
    "SIGINT",
    "SIGQUIT",
    "SIGHUP",
    "SIGTSTP",
    "SIGTTIN",
    "SIGTTOU",
    "SIGUSR1",
    "SIGUSR2",
    "SIGBREAK",
)
_LOOK = 0.001  # s between two looks whether a process has ended


def detach() -> None:
    """Leave the terminal: a session of its own, in which signals for the front are ignored."""
    numbers = _available_signals()
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
    No signal is lost: those that arrive here are delivered after the context.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _available_signals())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _available_signals() -> list[signal.Signals]:
    """Return the signals for the front alone that this platform has."""
    return [getattr(signal, name) for name in _FOR_FRONT_ALONE if hasattr(signal, name)]


class OtherProcess:
    """A process of the server that another process started.

    A later process with the same number is not taken for it.

    Parameters
    ----------
    number : int
        Number of the process.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self._process: psutil.Process | None = None
        with suppress(psutil.Error):
            self._process = psutil.Process(number)

    def is_alive(self) -> bool:
        """Return True if the process has not ended, even if it does not run."""
        try:
            return (
                self._process is not None
                and self._process.is_running()
                and self._process.status() != psutil.STATUS_ZOMBIE
            )
        except psutil.Error:
            return False

    def kill(self) -> None:
        """End the process at once."""
        with suppress(psutil.Error):
            if self._process is not None:
                self._process.kill()

    def join(self, timeout: float) -> None:
        """Wait until the process has ended, at most `timeout` in s."""
        until = monotonic() + timeout
        while self.is_alive() and monotonic() < until:
            sleep(_LOOK)
