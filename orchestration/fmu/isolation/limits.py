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
        Bytes that the process may take, where the platform has such a limit (Linux); infinite for
        no limit; default what the machine has.
    """

    step_timeout: float = STEP_TIMEOUT
    memory: float | None = None

    @property
    def bytes(self) -> int:
        """The limit of memory in bytes; 0 for no limit."""
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
    """Isolate foreign FMUs wherever many runs of them are made, within this context.

    Parameters
    ----------
    limits : Limits or None
        Limits of each process; None: do not isolate.
    """
    token = _foreign.set(limits)
    try:
        yield
    finally:
        _foreign.reset(token)


def limits_of(foreign: bool) -> Limits | None:
    """Return the limits of :func:`isolating` for a foreign FMU; None for a component of ours."""
    return _foreign.get() if foreign else None


def isolation(asked: bool | Limits) -> Limits | None:
    """Return limits as a caller in Python requests them.

    Parameters
    ----------
    asked : bool or Limits
        True for the default limits, False for no isolation.
    """
    if isinstance(asked, Limits):
        return asked
    return Limits() if asked else None
