"""Limits of time and memory for a process in which an FMU runs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from math import isfinite

STEP_TIMEOUT = 60.0  # s


@dataclass(frozen=True)
class Limits:
    """Limits of an isolated process.

    Attributes
    ----------
    step_timeout : float
        Seconds that one call of an FMU, such as a step, may take.
    memory : float, optional
        Bytes that the process may take, on platforms with such a limit (Linux); infinite for no
        limit; default the memory of the machine.
    """

    step_timeout: float = STEP_TIMEOUT
    memory: float | None = None

    @property
    def bytes(self) -> int:
        """The memory limit in bytes; 0 for no limit."""
        if self.memory is not None:
            return int(self.memory) if isfinite(self.memory) else 0
        try:
            return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        except (AttributeError, ValueError, OSError):
            return 0


DEFAULT = Limits()
_foreign: ContextVar[Limits | None] = ContextVar("limits of foreign FMUs", default=None)


@contextmanager
def isolating(limits: Limits | None) -> Iterator[None]:
    """Set the limits that `limits_of` returns for foreign FMUs while the context lasts.

    Parameters
    ----------
    limits : Limits or None
        Limits of each process; None for no isolation.
    """
    token = _foreign.set(limits)
    try:
        yield
    finally:
        _foreign.reset(token)


def limits_of(foreign: bool) -> Limits | None:
    """Return the limits set by :func:`isolating` for a foreign FMU; None for one of ours."""
    return _foreign.get() if foreign else None


def isolation(isolate: bool | Limits) -> Limits | None:
    """Return the limits for the argument `isolate` of functions in Python.

    Parameters
    ----------
    isolate : bool or Limits
        True for the default limits, False for no isolation.

    Returns
    -------
    Limits or None
        None for no isolation.
    """
    if isinstance(isolate, Limits):
        return isolate
    return Limits() if isolate else None
