"""How a member gets from one communication point to the next, where that is more than one call of its step."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from orchestration.master.buffers import Board, bind
from orchestration.master.instances import STEP, Clock, Instance
from orchestration.system.model import Port

_ORDER = 1  # of the input derivatives


class Wire(NamedTuple):
    """A connection between places on the boards."""

    target: int
    source: int
    factor: float
    offset: float


@dataclass
class Past:
    """What a member remembers from step to step: where it is, and the slopes of its linear inputs."""

    time: float
    slopes: list[float]


@dataclass
class Move:
    """Takes a member over a step in parts, or with inputs that change linearly in time.

    A linear input begins where it is and has the slope of the step before; one whose source has made the step already,
    the slope to its new value. An FMU that can interpolate gets value and slope, any other the value at the middle of
    the step (or part), whose effect on its states differs in the second order only.

    Attributes
    ----------
    member : Instance
    clock : Clock
    feed, board : Board
        Inputs and outputs of all members.
    linear : sequence of Port
        Inputs that change linearly; none: all are held.
    fresh : sequence of Wire
        Connections to them whose source has made the step already.
    parts : int
    lasting : bool
        Whether the step begins where the member is, not where the others are.
    settle : bool
        Whether outputs that depend on inputs are read right after the step: they get the inputs at its end.
    may_go_back : bool
    past : Past
        Of the member, whoever else takes part in a step.
    """

    member: Instance
    clock: Clock
    feed: Board
    board: Board
    linear: Sequence[Port]
    fresh: Sequence[Wire]
    parts: int
    lasting: bool
    settle: bool
    may_go_back: bool
    past: Past

    def __post_init__(self) -> None:
        self._own = Clock()
        self._step = self.member.stepper(self._own.now, self._own.size, self.may_go_back)
        self._places = [self.feed.at[port] for port in self.linear]
        index = {place: k for k, place in enumerate(self._places)}
        self._arrived = [(index[wire.target], wire) for wire in self.fresh]
        self._set_linear = bind("Set", self.member.fmu, self.linear, self.feed)
        self._derivatives = (ctypes.c_double * len(self.linear))()
        self._interpolates = self.member.can_interpolate and bool(self.linear)
        if self._interpolates:
            references = [self.member.fmu.variables[port.variable].valueReference for port in self.linear]
            count = len(references)
            orders = (ctypes.c_int * count)(*[_ORDER] * count)
            self._set_slopes = self.member.fmu.bound(
                "fmi2SetRealInputDerivatives", ctypes.byref((ctypes.c_uint * count)(*references)),
                ctypes.c_size_t(count), ctypes.byref(orders), ctypes.byref(self._derivatives),
            )  # fmt: skip
        self._held = [0.0] * len(self._places)
        self._span = 1.0

    def __call__(self) -> int:
        """Make the step; what goes wrong is told with the member's own step, not the system's."""
        clock, feed, board = self.clock, self.feed.cells, self.board.cells
        start = self.past.time if self.lasting else clock.start
        self.past.time = end = clock.end
        span = end - start
        held, slopes = [feed[place] for place in self._places], self.past.slopes.copy()
        for k, (_, source, factor, offset) in self._arrived:
            slopes[k] = (factor * board[source] + offset - held[k]) / span
        self._held, self._span = held, span
        begin = start
        for part in range(1, self.parts + 1):
            until = end if part == self.parts else start + span * part / self.parts
            self._own.set(begin, until)
            if self._places:
                at = begin - start if self._interpolates else 0.5 * (begin + until) - start
                self._give(held, slopes, at)
            if self._interpolates:
                self._derivatives[:] = slopes  # type: ignore[assignment]
                self._judge(self._set_slopes())
            self._judge(self._step())
            begin = until
        if self.settle and self._places:
            self._give(held, slopes, span)
        return 0

    def _give(self, held: list[float], slopes: list[float], after: float) -> None:
        feed = self.feed.cells
        for place, value, slope in zip(self._places, held, slopes, strict=True):
            feed[place] = value + slope * after
        for call in self._set_linear:
            self._judge(call())

    def _judge(self, status: int) -> None:
        if status:
            self.member.judge(status, STEP, self._own)

    def learn(self) -> None:
        """Take the slopes over the step just made, for the next one."""
        feed, span = self.feed.cells, self._span
        self.past.slopes[:] = [
            (feed[place] - value) / span for place, value in zip(self._places, self._held, strict=True)
        ]
