"""What a process with an FMU in it may take."""

from __future__ import annotations

import os
from dataclasses import dataclass

STEP_TIMEOUT = 60.0


@dataclass(frozen=True)
class Limits:
    """Limits of a process beside this one.

    Attributes
    ----------
    step_timeout : float
        Seconds that one call of an FMU, such as a step, may take.
    memory : float, optional
        Bytes that the process may take, where the platform has such a limit (Linux); else what the machine has.
    """

    step_timeout: float = STEP_TIMEOUT
    memory: float | None = None

    @property
    def bytes(self) -> int:
        """Of memory; 0 for as many as there are."""
        if self.memory is not None:
            return int(self.memory)
        try:
            return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        except (AttributeError, ValueError, OSError):
            return 0


def isolation(asked: bool | Limits) -> Limits | None:
    """Limits as a caller in Python asks for them: the usual ones, others, or none at all."""
    return asked if isinstance(asked, Limits) else Limits() if asked else None
