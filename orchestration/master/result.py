"""What a run delivers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.master.pacing import Pacing

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MemberStatistics:
    """What a component took.

    Attributes
    ----------
    steps : int
        Steps it made, those that were taken back included.
    seconds : float
        Time in its steps.
    share : float
        Of the time of all steps and exchanges.
    """

    steps: int
    seconds: float
    share: float


@dataclass(frozen=True)
class Statistics:
    """Where the time went.

    Attributes
    ----------
    components : dict of str to MemberStatistics
    steps : int
        Steps of the system that count.
    rollbacks : int
        Steps that were repeated with a shorter one.
    evaluations : int
        Of algebraic loops.
    wall : float
        Seconds for steps and exchanges, without opening and initialization; in real time for waiting, too.
    pacing : Pacing or None
        How well a run in real time kept pace.
    """

    components: dict[str, MemberStatistics]
    steps: int
    rollbacks: int
    evaluations: int
    wall: float
    pacing: Pacing | None = None


@dataclass(frozen=True)
class Run:
    """What a run delivered.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Communication points that were reached, in s.
    signals : dict of str to ndarray, shape (n,)
        By ``member.variable``, in the FMU's units.
    units : dict of str to str
        Of the signals.
    complete : bool
        Whether every member reached the last of the communication points asked for.
    message : str
        Why not; empty if complete.
    statistics : Statistics
    guids : dict of str to str
        Of each member's FMU.
    notes : tuple of str
        What should be known of the run: algebraic loops, warnings of members.
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
    """A run that a member has stopped, or that could not keep pace with real time.

    Attributes
    ----------
    run : Run
        What was computed until then, marked incomplete.
    """

    run: Run

    def __init__(self, message: str, run: Run):
        super().__init__(message)
        self.run = run
