"""Members while a system runs: the instance of each, what its FMU says of its structure, its failures in words."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Sequence

from fmpy.fmi2 import (
    fmi2Discard,
    fmi2DoStepStatus,
    fmi2LastSuccessfulTime,
    fmi2Pending,
    fmi2Terminated,
    fmi2Warning,
)

from fmus.kit.errors import UserError
from orchestration.fmu.instance import Fmu
from orchestration.fmu.signal import read_signal
from orchestration.master.buffers import FmiCall
from orchestration.system.model import Port

STEP = "step"  # what a member is asked to do, where that is a step


class Clock:
    """The step that is being made, from `start` to `end`; as ctypes objects its beginning and its size."""

    def __init__(self) -> None:
        self.start = self.end = 0.0
        self.now, self.size = ctypes.c_double(), ctypes.c_double()

    def set(self, start: float, end: float) -> None:
        """Begin a step."""
        self.start, self.end = start, end
        self.now.value, self.size.value = start, end - start


class Instance:
    """An FMU as a member of a system.

    Parameters
    ----------
    name : str
        Of the member.
    fmu : Fmu
    """

    def __init__(self, name: str, fmu: Fmu):
        self.name, self.fmu = name, fmu
        can = fmu.description.coSimulation
        self.can_restore = bool(can.canGetAndSetFMUstate)
        self.can_interpolate = bool(can.canInterpolateInputs)
        self.can_vary_step = bool(can.canHandleVariableCommunicationStepSize)
        self.may_be_pending = bool(can.canRunAsynchronuously)

    def dependencies(self, variable: str) -> list[str] | None:
        """Inputs on which an output depends at once; None if the FMU does not say."""
        for unknown in self.fmu.description.outputs:
            if unknown.variable.name == variable and unknown.dependencies is not None:
                return [v.name for v in unknown.dependencies if v.causality == "input"]
        return None

    def is_continuous(self, variable: str) -> bool:
        """Whether it is an output that changes continuously."""
        scalar = self.fmu.variables[variable]
        return (
            scalar.causality == "output"
            and scalar.type == "Real"
            and scalar.variability in (None, "continuous")
        )

    def nominal(self, variable: str) -> float:
        """Nominal value of a variable; 1 if it has none."""
        scalar = self.fmu.variables[variable]
        text = getattr(scalar, "nominal", None) or getattr(scalar.declaredType, "nominal", None)
        return abs(float(text)) or 1.0 if text else 1.0

    def start(self, variable: str) -> float:
        """Start value of an input as set, or as the FMU declares it."""
        return float(
            self.fmu.parameters.get(variable, read_signal(self.fmu.variables[variable]).start)
        )

    def stepper(self, now: ctypes.c_double, size: ctypes.c_double, may_go_back: bool) -> FmiCall:
        """Bind the step to its beginning and its size; a step that is pending is waited for."""
        step = self.fmu.bound("fmi2DoStep", now, size, ctypes.c_int(not may_go_back))
        if not self.may_be_pending:
            return step
        status = ctypes.c_int()
        ask = self.fmu.bound("fmi2GetStatus", ctypes.c_int(fmi2DoStepStatus), ctypes.byref(status))

        def step_and_wait() -> int:
            status.value = step()
            while status.value == fmi2Pending:
                time.sleep(1e-4)
                if (answer := ask()) > fmi2Warning:
                    return answer
            return status.value

        return step_and_wait

    def check_status(self, status: int, doing: str, clock: Clock) -> None:
        """Count a warning; raise on anything worse.

        Raises
        ------
        UserError
            Component, time, what it was asked to do, what it answered and its own message.
        """
        if status == fmi2Warning:
            self.fmu.warnings += 1
            return
        stepping = doing == STEP
        doing = (
            f"step from {clock.start:.10g} s to {clock.end:.10g} s"
            if stepping
            else f"{doing} at {clock.end:.10g} s"
        )
        remark = self._about_discard() if stepping and status == fmi2Discard else ""
        raise UserError(f"{self.name}: {self.fmu.failed(doing, status, remark)}")

    def _about_discard(self) -> str:
        """How far a discarded step got, and whether the FMU asks for the end."""
        reached, ended = self.last_time(), ctypes.c_int()
        ask = self.fmu.bound(
            "fmi2GetBooleanStatus", ctypes.c_int(fmi2Terminated), ctypes.byref(ended)
        )
        return (f", it reached {reached:.10g} s" if reached is not None else "") + (
            ", it asks to end the simulation" if ask() <= fmi2Warning and ended.value else ""
        )

    def last_time(self) -> float | None:
        """Time that the FMU says it has reached; None if it does not say."""
        reached = ctypes.c_double()
        ask = self.fmu.bound(
            "fmi2GetRealStatus", ctypes.c_int(fmi2LastSuccessfulTime), ctypes.byref(reached)
        )
        return reached.value if ask() <= fmi2Warning else None

    def terminate(self, clock: Clock) -> None:
        """End the simulation properly."""
        if status := self.fmu.bound("fmi2Terminate")():
            self.check_status(status, "termination", clock)


class SavedState:
    """States of several members, to go back to any number of times."""

    def __init__(self, members: Sequence[Instance], clock: Clock):
        self._clock = clock
        self._calls: list[tuple[Instance, FmiCall, FmiCall, FmiCall]] = []
        self._states: list[ctypes.c_void_p] = []
        for member in members:
            state = ctypes.c_void_p()
            there = ctypes.byref(state)
            bound = member.fmu.bound
            calls = (
                bound("fmi2GetFMUstate", there),
                bound("fmi2SetFMUstate", state),
                bound("fmi2FreeFMUstate", there),
            )
            self._calls.append((member, *calls))
            self._states.append(state)

    def save(self) -> None:
        """Keep the states as they are now; UserError if a member refuses."""
        for member, save, _, _ in self._calls:
            if status := save():
                member.check_status(status, "saving the state", self._clock)

    def restore(self) -> None:
        """Go back to what was saved last; UserError if a member refuses."""
        for member, _, restore, _ in self._calls:
            if status := restore():
                member.check_status(status, "restoring the state", self._clock)

    def free(self) -> None:
        """Release what is saved; UserError if a member refuses."""
        for member, _, _, free in self._calls:
            if status := free():
                member.check_status(status, "releasing a state", self._clock)

    def release(self) -> None:
        """Release what there still is of it, of members that may be called, whatever they answer."""
        for (member, _, _, free), state in zip(self._calls, self._states, strict=True):
            if state and not member.fmu.corrupted:
                free()


def listed(ports: Sequence[Port]) -> str:
    """Names of a member's variables, for a message."""
    names = [port.variable for port in ports]
    return ", ".join(names if len(names) <= 4 else [*names[:3], f"{len(names) - 3} more"])
