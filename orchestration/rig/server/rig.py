"""Interface of a rig as the front sees it, whether its time is real or the client's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from fmus.kit import UserError
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.settings import ServerSettings


@dataclass(frozen=True)
class RigState:
    """The newest sample of a rig.

    Attributes
    ----------
    number : int
        Number of the sample, counted from the start.
    applied : tuple of float or None
        Value of each input; the safe value in the safe state, None where it is unknown.
    read_back : tuple of float or None
        Value of each input as the device reports it; None where it does not.
    values : tuple of float or None
        The newest finite value of every output.
    taken : tuple of float
        Time of each of these values, in s of the rig's clock.
    missed : int
        Deadlines missed so far.
    """

    number: int
    applied: tuple[float | None, ...]
    read_back: tuple[float | None, ...]
    values: tuple[float | None, ...]
    taken: tuple[float, ...]
    missed: int

    def ages(self, now: float) -> list[float | None]:
        """Return the age of each value.

        Parameters
        ----------
        now : float
            Present time in s of the rig's clock.

        Returns
        -------
        list of float or None
            Ages in s; None for an output without a value.
        """
        return [
            None if value is None else max(0.0, now - then)
            for value, then in zip(self.values, self.taken, strict=True)
        ]


class Notice(NamedTuple):
    """A message for the operator on a signal; the rig continues to run."""

    source: str
    text: str


class Rig(Protocol):
    """A rig in real time or in lockstep.

    Attributes
    ----------
    mode : str
        Mode of the protocol: real time or lockstep.
    watchdog : float
        Watchdog time in s; 0 if there is none.
    bound : float
        Longest that going safe may take, s; beyond it the safe state counts as not reached.
    signals : BackendSignals
    """

    mode: str
    watchdog: float
    bound: float
    signals: BackendSignals

    def clock(self) -> float:
        """Return the time of the rig, s."""

    def apply(self, values: Sequence[float], now: float) -> None:
        """Command every input from now on."""

    def advance(self, step: float) -> None:
        """Let time pass, if it is the client's."""

    def beat(self) -> None:
        """Show that the front is alive; to be called in every turn of its loop."""

    def go_safe(self) -> None:
        """Order the safe state, again even if the rig is believed to be in it."""

    def safe_since(self) -> float | None:
        """Return the time from which the rig is confirmed to be in its safe state, s of its clock.

        It is None while this is not confirmed.
        """

    def denial(self) -> str:
        """Return what the device reports in place of its safe values; empty if it does not."""

    def release(self) -> None:
        """Begin to serve again after a latched safe state.

        It may take a while, until :meth:`opening` returns an empty text.
        """

    def opening(self) -> str:
        """Return the reason for which the rig cannot be used yet; empty if it can."""

    def troubles(self) -> list[str]:
        """Return the reasons for going safe by itself since the last call, the newest last."""

    def alarms(self) -> list[Notice]:
        """Return messages for the operator since the last call."""

    def state(self) -> RigState:
        """Return the newest sample."""

    def close(self) -> str:
        """End in the safe state.

        Returns
        -------
        str
            The reason for which it has not been reached in time; empty if it was. It is tried for
            until another call finds it reached, or :meth:`kill`.
        """

    def kill(self) -> None:
        """Give up trying for the safe state."""


def cannot_open(settings: ServerSettings, reason: str) -> UserError:
    """Return the error that a backend cannot be served; the caller raises it."""
    named = f"backend {settings.backend}: "
    return UserError(named + reason.removeprefix(named))
