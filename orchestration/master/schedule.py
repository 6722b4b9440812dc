"""What is done in a step and at its end, prepared once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from orchestration.master.buffers import Call
from orchestration.master.dependency_graph import Plan
from orchestration.master.instances import Instance
from orchestration.master.stepping import Move, Wire


class Action(NamedTuple):
    """A call to a member, and what to say of it if it fails."""

    call: Call
    member: Instance
    doing: str


class Station(NamedTuple):
    """Values that are copied, and then the calls that need them."""

    copies: list[tuple[int, int]]  # place on the feed, place on the board
    wires: list[Wire]  # the same with factor and offset
    columns: list[tuple[int, list[float]]]  # place on the feed, values from outside at all points
    actions: list[Action]


@dataclass(frozen=True)
class Settings:
    """How to run; see `orchestration.master.run`."""

    sequential: bool
    extrapolation: int
    feedthrough: bool
    adaptive: bool
    rates: Mapping[str, Fraction]


@dataclass
class Program:
    """What happens in a step and at its end, for those members that take part.

    Attributes
    ----------
    steps : list of tuple
        Number of a member, and what it does to get to the next point.
    stations : list of Station
        The exchange of values at the communication point.
    moves : list of Move
        Those that extrapolate.
    """

    plan: Plan
    steps: list[tuple[int, list[Action]]]
    stations: list[Station]
    moves: list[Move]
    count: int = 0
