"""The rig as the front sees it, whether its time is real or the client's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from fmus.kit.errors import UserError
from orchestration.rig.server.calls import Signals
from orchestration.rig.server.settings import Settings


@dataclass(frozen=True)
class State:
    """The newest sample.

    Attributes
    ----------
    number : int
        Counts the samples.
    applied : tuple of float
        What is commanded, by input; zero in the safe state.
    values : tuple of float or None
        The newest finite value of every output.
    taken : tuple of float
        When that was, in s of the rig's clock.
    missed : int
        Deadlines missed so far.
    """

    number: int
    applied: tuple[float, ...]
    values: tuple[float | None, ...]
    taken: tuple[float, ...]
    missed: int

    def ages(self, now: float) -> list[float | None]:
        """How old each value is.

        Parameters
        ----------
        now : float
            In s of the rig's clock.

        Returns
        -------
        list of float or None
            In s; None for a value that there is not.
        """
        return [
            None if value is None else max(0.0, now - then)
            for value, then in zip(self.values, self.taken, strict=True)
        ]


class Rig(Protocol):
    """What the front asks of a rig.

    Attributes
    ----------
    mode : str
        Of the protocol.
    watchdog : float
        In s; 0 if there is none.
    signals : Signals
    """

    mode: str
    watchdog: float
    signals: Signals

    def clock(self) -> float:
        """Time of the rig in s."""
        ...

    def apply(self, values: Sequence[float], now: float) -> None:
        """Command every input from now on."""
        ...

    def advance(self, step: float) -> None:
        """Let time pass, if it is the client's."""
        ...

    def rest(self) -> None:
        """Go to the safe state."""
        ...

    def release(self) -> None:
        """Serve again after a safe state that was latched; it may take a while until :meth:`opening` is empty."""
        ...

    def opening(self) -> str:
        """Why the rig cannot be used yet; empty if it can."""
        ...

    def troubles(self) -> list[str]:
        """Say what made the rig go safe by itself since this was last asked, the newest last."""
        ...

    def state(self) -> State:
        """Take the newest sample."""
        ...

    def close(self) -> str:
        """End in the safe state.

        Returns
        -------
        str
            Why that was not reached; empty if it was.
        """
        ...


def cannot_open(settings: Settings, reason: str) -> UserError:
    """Say that a backend cannot be served."""
    named = f"backend {settings.backend}: "
    return UserError(named + reason.removeprefix(named))
