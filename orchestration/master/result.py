"""Results of a run: signals, statistics, and the error of a run that was stopped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.master.pacing import Pacing
from orchestration.reporting import Displayable, one_line, plain_table

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType


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
class Run(Displayable):
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
        Reason if it is not complete; else empty.
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

    def __repr__(self) -> str:
        return one_line(f"Run {self.extent} of {len(self.signals)} signals")

    @property
    def extent(self) -> str:
        """Its points and its end."""
        end = f" to {self.time[-1]:g} s" if self.time.size else ""
        return f"{self.time.size} points{end}{'' if self.complete else ', incomplete'}"

    def overview(self) -> Iterator[RenderableType]:
        """Yield the extent in time, tables of signals and of the members' effort, and remarks."""
        yield self.extent + (f": {self.message}" if self.message else "")
        columns = ("smallest", "largest", "last")
        signals = plain_table(None, "signal", *columns, "unit", right=columns)
        for name, values in self.signals.items():
            ends = (values.min(), values.max(), values[-1]) if values.size else ()
            signals.add_row(name, *(f"{x:.6g}" for x in ends), self.units[name])
        yield signals
        effort = ("steps", "share of the time")
        members = plain_table(None, "member", *effort, right=effort)
        for name, one in self.statistics.components.items():
            members.add_row(name, f"{one.steps:,}", f"{100.0 * one.share:.0f} %")
        yield members
        yield from self.notes

    def to_frame(self) -> pandas.DataFrame:
        """Return the signals as a table over time.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        return pandas.DataFrame(self.signals, index=pandas.Index(self.time, name="time"))


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
