"""How a member gets from one communication point to the next, where that is more than one call of its step."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from orchestration.master.buffers import Buffer, bind, transfers
from orchestration.master.instances import STEP, Clock, Instance
from orchestration.system.model import Port

_ORDER = 1  # of the input derivatives


class BufferedConnection(NamedTuple):
    """A connection between places in the buffers."""

    target: int
    source: int
    factor: float
    offset: float


@dataclass
class StepHistory:
    """What a member keeps from step to step: the time it has reached (s), and the slopes of its linear inputs."""

    time: float
    slopes: list[float]


@dataclass
class MemberStep:
    """Takes a member over a step in parts, or with inputs that change linearly in time.

    A linear input begins where it is and has the slope of the step before; one whose source has made the step already,
    the slope to its new value. An FMU that can interpolate gets value and slope, any other the value at the middle of
    the step (or part), whose effect on its states differs in the second order only.

    Attributes
    ----------
    member : Instance
    clock : Clock
    inputs, outputs : Buffer
        Of all members.
    linear : sequence of Port
        Inputs that change linearly; none: all are held.
    updated : sequence of BufferedConnection
        Connections to them whose source has made the step already.
    parts : int
    resumes : bool
        Whether the step begins where the member has got to, not where the others are.
    set_at_end : bool
        Whether outputs that depend on inputs are read right after the step: they get the inputs at its end.
    may_go_back : bool
    history : StepHistory
        Of the member, whoever else takes part in a step.
    """

    member: Instance
    clock: Clock
    inputs: Buffer
    outputs: Buffer
    linear: Sequence[Port]
    updated: Sequence[BufferedConnection]
    parts: int
    resumes: bool
    set_at_end: bool
    may_go_back: bool
    history: StepHistory

    def __post_init__(self) -> None:
        self._own = Clock()
        self._step = self.member.stepper(self._own.now, self._own.size, self.may_go_back)
        self._places = [self.inputs.at[port] for port in self.linear]
        index = {place: k for k, place in enumerate(self._places)}
        self._updated = [(index[connection.target], connection) for connection in self.updated]
        fmu, inputs = self.member.fmu, self.inputs
        self._set_linear = [
            bind(moved, fmu, inputs) for moved in transfers("Set", fmu, self.linear, inputs)
        ]
        self._derivatives = (ctypes.c_double * len(self.linear))()
        self._interpolates = self.member.can_interpolate and bool(self.linear)
        if self._interpolates:
            references = [
                self.member.fmu.variables[port.variable].valueReference for port in self.linear
            ]
            count = len(references)
            orders = (ctypes.c_int * count)(*[_ORDER] * count)
            self._set_slopes = self.member.fmu.bound(
                "fmi2SetRealInputDerivatives",
                ctypes.byref((ctypes.c_uint * count)(*references)),
                ctypes.c_size_t(count),
                ctypes.byref(orders),
                ctypes.byref(self._derivatives),
            )
        self._held = [0.0] * len(self._places)
        self._span = 1.0

    def __call__(self) -> int:
        """Make the step; errors name the member's own step, not the system's."""
        clock, inputs, outputs = self.clock, self.inputs.cells, self.outputs.cells
        start = self.history.time if self.resumes else clock.start
        self.history.time = end = clock.end
        span = end - start
        held, slopes = [inputs[place] for place in self._places], self.history.slopes.copy()
        for k, (_, source, factor, offset) in self._updated:
            slopes[k] = (factor * outputs[source] + offset - held[k]) / span
        self._held, self._span = held, span
        begin = start
        for part in range(1, self.parts + 1):
            until = end if part == self.parts else start + span * part / self.parts
            self._own.set(begin, until)
            if self._places:
                at = begin - start if self._interpolates else 0.5 * (begin + until) - start
                self._set(held, slopes, at)
            if self._interpolates:
                self._derivatives[:] = slopes  # type: ignore[assignment]
                self._check(self._set_slopes())
            self._check(self._step())
            begin = until
        if self.set_at_end and self._places:
            self._set(held, slopes, span)
        return 0

    def _set(self, held: list[float], slopes: list[float], after: float) -> None:
        inputs = self.inputs.cells
        for place, value, slope in zip(self._places, held, slopes, strict=True):
            inputs[place] = value + slope * after
        for call in self._set_linear:
            self._check(call())

    def _check(self, status: int) -> None:
        if status:
            self.member.check_status(status, STEP, self._own)

    def update_slopes(self) -> None:
        """Take the slopes over the step just made, for the next one."""
        inputs, span = self.inputs.cells, self._span
        self.history.slopes[:] = [
            (inputs[place] - value) / span
            for place, value in zip(self._places, self._held, strict=True)
        ]
