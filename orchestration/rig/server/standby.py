"""Standby guard: it watches the guard on duty, and ends it if it is silent."""

from __future__ import annotations

import os
from time import monotonic

from orchestration.rig.server.processes import OtherProcess
from orchestration.rig.server.settings import BUSY, ServerSettings
from orchestration.rig.server.shared_memory import (
    OPENING,
    RESCUING,
    RETIRED,
    SharedMemory,
    SignOfLife,
    Watch,
)

# s; a guard that hangs for longer in the backend ends itself, and the other takes its place. Where
# the first opening took longer, it may take twice as long again
_LEAST_ATTEMPT = 5.0
_OPENINGS = 2.0
# s for which a killed process is waited for: the kernel may hold it for longer, and a device that
# it still has is tried for again
LONGEST_DYING = 0.1


class Standby:
    """The watch over the guard on duty.

    Parameters
    ----------
    settings : ServerSettings
    shared : SharedMemory
    """

    def __init__(self, settings: ServerSettings, shared: SharedMemory) -> None:
        self._settings = settings
        self._shared = shared
        self._guard: OtherProcess | None = None

    def is_idle(self) -> bool:
        """Return True if there is no guard on duty, or it left the rig in its safe state."""
        watch = self._shared.watch.read()
        return watch is None or watch.at == RETIRED

    def check(self) -> str:
        """Check the guard on duty once, and show a sign of life.

        Returns
        -------
        str
            Why the guard on duty, which has ended now, cannot go on; empty if it can.
        """
        self._shared.standby.write(SignOfLife(monotonic(), os.getpid()))
        watch = self._shared.watch.read()
        return "" if watch is None else self._end_if_silent(watch)

    def _end_if_silent(self, watch: Watch) -> str:
        """End the guard on duty if it is silent for too long; return why it cannot go on."""
        if self._guard is None or self._guard.number != watch.process:
            self._guard = OtherProcess(watch.process)
        if not self._guard.is_alive():
            return "the guard process has ended"
        silent = monotonic() - watch.time
        if watch.at == RETIRED or silent <= longest_silence(watch.at, self._settings, self._shared):
            return ""
        self._guard.kill()
        self._guard.join(LONGEST_DYING)
        return f"the guard shows no sign of life for {silent:.3g} s; {BUSY}"


def longest_attempt(shared: SharedMemory) -> float:
    """Return the time in s that one attempt at the safe state may take, with the opening in it.

    Parameters
    ----------
    shared : SharedMemory
    """
    description = shared.description.read()
    opening = 0.0 if description is None else description.opening
    return max(_LEAST_ATTEMPT, _OPENINGS * opening)


def longest_silence(at: int, settings: ServerSettings, shared: SharedMemory) -> float:
    """Return the time in s after which a guard on duty without a sign of life counts as hung.

    Parameters
    ----------
    at : int
        Its present action, as in `shared_memory`. A call of the driver may take as long as an
        attempt at the safe state; and a machine that opens a device, when nothing is commanded
        yet, is busy.
    settings : ServerSettings
    shared : SharedMemory
    """
    return settings.silence + (longest_attempt(shared) if at in (OPENING, RESCUING) else 0.0)
