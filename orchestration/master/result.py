"""Results of a run: signals, statistics, and the error of a run that was stopped."""

from __future__ import annotations

from dataclasses import dataclass

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.master.pacing import Pacing


@dataclass(frozen=True)
class MemberStatistics:
    """The effort of a member.

    Attributes
    ----------
    steps : int
        Number of its steps, including those that were taken back.
    seconds : float
        Time in its steps.
    share : float
        Share of the time of all steps and exchanges.
    """

    steps: int
    seconds: float
    share: float


@dataclass(frozen=True)
class Statistics:
    """The effort of a run.

    Attributes
    ----------
    components : dict of str to MemberStatistics
    steps : int
        Number of steps of the system, without those that were taken back.
    rollbacks : int
        Number of steps that were repeated with a shorter one.
    evaluations : int
        Number of evaluations of algebraic loops.
    wall : float
        Seconds for steps and exchanges, without opening and initialization; in real time including
        waiting.
    pacing : Pacing or None
        Lateness of a run in real time.
    """

    components: dict[str, MemberStatistics]
    steps: int
    rollbacks: int
    evaluations: int
    wall: float
    pacing: Pacing | None = None


@dataclass(frozen=True)
class Run:
    """The result of a run.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Communication points that were reached, in s.
    signals : dict of str to ndarray, shape (n,)
        By ``member.variable``, in the FMU's units.
    units : dict of str to str
        Units of the signals.
    complete : bool
        Whether every member reached the last of the requested communication points.
    message : str
        Why not; empty if complete.
    statistics : Statistics
    guids : dict of str to str
        GUID of each member's FMU.
    notes : tuple of str
        Remarks on the run: algebraic loops, warnings of members.
    """

    time: Array
    signals: dict[str, Array]
    units: dict[str, str]
    complete: bool
    message: str
    statistics: Statistics
    guids: dict[str, str]
    notes: tuple[str, ...] = ()


class Stopped(UserError):
    """The error that a member has stopped a run, or that it could not keep pace with real time.

    Attributes
    ----------
    run : Run
        The result until then, marked incomplete.
    """

    run: Run

    def __init__(self, message: str, run: Run):
        super().__init__(message)
        self.run = run
