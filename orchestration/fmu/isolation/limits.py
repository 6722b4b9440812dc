"""What a process with an FMU in it may take."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from math import isfinite

STEP_TIMEOUT = 60.0


@dataclass(frozen=True)
class Limits:
    """Limits of a process beside this one.

    Attributes
    ----------
    step_timeout : float
        Seconds that one call of an FMU, such as a step, may take.
    memory : float, optional
        Bytes that the process may take, where the platform has such a limit (Linux); infinite for no limit; default
        what the machine has.
    """

    step_timeout: float = STEP_TIMEOUT
    memory: float | None = None

    @property
    def bytes(self) -> int:
        """Of memory; 0 for as many as there are."""
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
    """Have FMUs that somebody gave run in processes of their own wherever many runs of them are made."""
    token = _foreign.set(limits)
    try:
        yield
    finally:
        _foreign.reset(token)


def limits_of(foreign: bool) -> Limits | None:
    """Limits for a model, as `isolating` has it."""
    return _foreign.get() if foreign else None


def isolation(asked: bool | Limits) -> Limits | None:
    """Limits as a caller in Python asks for them: the usual ones, others, or none at all."""
    return asked if isinstance(asked, Limits) else Limits() if asked else None
