"""What is done in a step and at its end, prepared once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from orchestration.master.buffers import FmiCall, Transfer
from orchestration.master.dependency_graph import Plan
from orchestration.master.instances import Instance
from orchestration.master.stepping import BufferedConnection, MemberStep


class PlainStep(NamedTuple):
    """A step that is one call; `final` if no state before it will be set again."""

    final: bool


class MemberCall(NamedTuple):
    """A call to a member, what to say of it if it fails, and what it is, for who can do it without Python.

    An `ExchangeStage` is that of the point at which the step begins; None is known to Python only.
    """

    call: FmiCall
    member: Instance
    doing: str
    what: Transfer | PlainStep | ExchangeStage | None = None


class ExchangeStage(NamedTuple):
    """Values that are copied to inputs, and then the calls that need them."""

    copies: list[tuple[int, int]]  # index of the input, index of the output
    scaled: list[BufferedConnection]  # the same with factor and offset
    disturbances: list[
        tuple[int, list[float]]
    ]  # index of a connected input, what is added to it at all points
    external: list[tuple[int, list[float]]]  # index of the input, values from outside at all points
    calls: list[MemberCall]


@dataclass(frozen=True)
class Settings:
    """How to run; see `orchestration.master.run`."""

    sequential: bool
    extrapolation: int
    feedthrough: bool
    adaptive: bool
    rates: Mapping[str, Fraction]


@dataclass
class Schedule:
    """What happens in a step and at its end, for those members that take part.

    Attributes
    ----------
    plan : Plan
    steps : list of tuple
        Number of a member, and what it does to get to the next point.
    stages : list of ExchangeStage
        The exchange of values at the communication point.
    extrapolating : list of MemberStep
        Those that follow the slopes of their inputs.
    count : int
        How often it was carried out.
    """

    plan: Plan
    steps: list[tuple[int, list[MemberCall]]]
    stages: list[ExchangeStage]
    extrapolating: list[MemberStep]
    count: int = 0
