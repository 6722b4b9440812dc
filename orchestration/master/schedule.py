"""The schedule of a system: the calls and copies of a step and of the exchange at its end."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from orchestration.master.buffers import Buffer, BufferTransfer, FmiCall, bind, list_transfers
from orchestration.master.dependency_graph import EvaluationOrder
from orchestration.master.instances import STEP, CommunicationStep, Instance
from orchestration.system import Port

_DERIVATIVE_ORDER = 1


@dataclass(frozen=True)
class MasterSettings:
    """The options of a run; see `orchestration.master.run`."""

    sequential: bool
    extrapolation: int
    feedthrough: bool
    adaptive: bool
    rates: Mapping[str, Fraction]


class BufferedConnection(NamedTuple):
    """A connection between places in the buffers."""

    target: int
    source: int
    factor: float
    offset: float


class PlainStep(NamedTuple):
    """A step that is one call; `final` if no earlier state will be restored."""

    final: bool


class MemberCall(NamedTuple):
    """A call of a member.

    Attributes
    ----------
    call : callable
        Returns the FMI status.
    member : Instance
    request : str
        The request to the member in words, for the message if it fails.
    operation : BufferTransfer, PlainStep or ExchangeStage, optional
        The operation of the call, for the kernel. An `ExchangeStage` has the values of the point
        at which the step begins; None can be done by Python only.
    """

    call: FmiCall
    member: Instance
    request: str
    operation: BufferTransfer | PlainStep | ExchangeStage | None = None


class ExchangeStage(NamedTuple):
    """Values that are copied to inputs, and then the calls that need them.

    Attributes
    ----------
    copies : list of (int, int)
        Places of an input and of the output whose value it receives.
    scaled : list of BufferedConnection
        The same with factor and offset.
    disturbances : list of (int, sequence of float)
        Place of a connected input, and the value that is added to it at each point.
    external : list of (int, sequence of float)
        Place of an input, and its value from outside at each point.
    calls : list of MemberCall
    """

    copies: list[tuple[int, int]]
    scaled: list[BufferedConnection]
    disturbances: list[tuple[int, Sequence[float]]]
    external: list[tuple[int, Sequence[float]]]
    calls: list[MemberCall]


@dataclass
class Schedule:
    """The calls of a step and of the exchange at its end, for the members that take part.

    Attributes
    ----------
    order : EvaluationOrder
    steps : list of tuple
        Number of a member, and its calls to get to the next point.
    stages : list of ExchangeStage
        The exchange of values at the communication point.
    extrapolating : list of MemberStep
        Steps that follow the slopes of their inputs.
    count : int
        Number of steps in which it was used.
    """

    order: EvaluationOrder
    steps: list[tuple[int, list[MemberCall]]]
    stages: list[ExchangeStage]
    extrapolating: list[MemberStep]
    count: int = 0


@dataclass
class StepHistory:
    """The time that a member has reached (s), and the slopes of its linear inputs."""

    time: float
    slopes: list[float]


@dataclass
class MemberStep:
    """A step of a member in parts, or with inputs that change linearly in time.

    A linear input begins at its present value and has the slope of the step before; one whose
    source has made the step already, the slope to its new value. An FMU that can interpolate gets
    value and slope, any other the value at the middle of the step (or part), whose effect on its
    states differs in the second order only.

    Attributes
    ----------
    member : Instance
    present_step : CommunicationStep
    inputs, outputs : Buffer
        Inputs and outputs of all members.
    linear : sequence of Port
        Inputs that change linearly; the others are held.
    updated : sequence of BufferedConnection
        Connections to linear inputs whose source has made the step already.
    parts : int
    resumes : bool
        Whether the step begins at the time that the member has reached, not at that of the others.
    set_at_end : bool
        Whether inputs are set to their values at the end of the step, for outputs that depend on
        them and are read then.
    may_go_back : bool
        Whether an earlier state may be restored.
    history : StepHistory
        History of the member, shared by all its steps.
    """

    member: Instance
    present_step: CommunicationStep
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
        fmu = self.member.fmu
        self._own_step = CommunicationStep()
        self._step = self.member.bind_step(
            self._own_step.now, self._own_step.size, self.may_go_back
        )
        self._places = [self.inputs.at[port] for port in self.linear]
        index = {place: k for k, place in enumerate(self._places)}
        self._updated = [(index[connection.target], connection) for connection in self.updated]
        self._set_linear = [
            bind(transfer, fmu, self.inputs)
            for transfer in list_transfers("Set", fmu, self.linear, self.inputs)
        ]
        self._slopes = (ctypes.c_double * len(self.linear))()
        self._interpolates = self.member.can_interpolate and bool(self.linear)
        if self._interpolates:
            self._set_slopes = self._bind_slopes()
        self._start_values = [0.0] * len(self._places)
        self._span = 1.0

    def _bind_slopes(self) -> FmiCall:
        """Return the call that sets the first time derivatives of the linear inputs."""
        variables = self.member.fmu.variables
        references = [variables[port.variable].valueReference for port in self.linear]
        count = len(references)
        orders = (ctypes.c_int * count)(*[_DERIVATIVE_ORDER] * count)
        return self.member.fmu.bound(
            "fmi2SetRealInputDerivatives",
            ctypes.byref((ctypes.c_uint * count)(*references)),
            ctypes.c_size_t(count),
            ctypes.byref(orders),
            ctypes.byref(self._slopes),
        )

    def __call__(self) -> int:
        """Make the step, part by part; return status 0.

        Raises
        ------
        UserError
            If the member fails, with the times of the part, not of the system's step.
        """
        end = self.present_step.end
        start = self.history.time if self.resumes else self.present_step.start
        self.history.time = end
        span = end - start
        inputs = self.inputs.cells
        outputs = self.outputs.cells
        values = [inputs[place] for place in self._places]
        slopes = self.history.slopes.copy()
        for k, (_, source, factor, offset) in self._updated:
            slopes[k] = (factor * outputs[source] + offset - values[k]) / span
        self._start_values = values
        self._span = span
        # the last part ends at the very end, without rounding
        ends = [*(start + span * part / self.parts for part in range(1, self.parts)), end]
        part_start = start
        for part_end in ends:
            self._own_step.set(part_start, part_end)
            if self._places:
                middle = 0.5 * (part_start + part_end)
                instant = part_start if self._interpolates else middle
                self._set_inputs(values, slopes, instant - start)
            if self._interpolates:
                self._slopes[:] = slopes  # type: ignore[assignment]
                self._check(self._set_slopes())
            self._check(self._step())
            part_start = part_end
        if self.set_at_end and self._places:
            self._set_inputs(values, slopes, span)
        return 0

    def _set_inputs(self, values: list[float], slopes: list[float], after: float) -> None:
        """Set linear inputs to their values some seconds after the start of the step."""
        inputs = self.inputs.cells
        for place, value, slope in zip(self._places, values, slopes, strict=True):
            inputs[place] = value + slope * after
        for call in self._set_linear:
            self._check(call())

    def _check(self, status: int) -> None:
        if status:
            self.member.check_status(status, STEP, self._own_step)

    def update_slopes(self) -> None:
        """Save the slopes over the step just made, for the next one."""
        inputs = self.inputs.cells
        self.history.slopes[:] = [
            (inputs[place] - value) / self._span
            for place, value in zip(self._places, self._start_values, strict=True)
        ]
