"""The members of a system during a run: their instances, capabilities, states, and failures."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Iterable, Sequence
from typing import Any

from fmpy.fmi2 import (
    fmi2Discard,
    fmi2DoStepStatus,
    fmi2Pending,
    fmi2Warning,
)

from fmus.kit import UserError
from orchestration.fmu import Fmu, RemoteFmu
from orchestration.fmu.signal import read_signal
from orchestration.master.buffers import FmiCall
from orchestration.system import Port

STEP = "step"  # the request to make a step


class CommunicationStep:
    """The times of the communication step that the members make.

    Attributes
    ----------
    start, end : float
        Start and end of the step, s.
    now, size : ctypes double
        Start and length of the step, as arguments of FMI functions.
    """

    def __init__(self) -> None:
        self.start = 0.0
        self.end = 0.0
        self.now = ctypes.c_double()
        self.size = ctypes.c_double()

    def set(self, start: float, end: float) -> None:
        """Set the start and the end of the step, s."""
        self.start = start
        self.end = end
        self.now.value = start
        self.size.value = end - start


class Instance:
    """An FMU as a member of a system.

    Parameters
    ----------
    name : str
        Name of the member.
    fmu : Fmu
    """

    def __init__(self, name: str, fmu: Fmu):
        self.name = name
        self.fmu = fmu
        flags = fmu.description.coSimulation
        self.can_restore = bool(flags.canGetAndSetFMUstate)
        self.can_interpolate = bool(flags.canInterpolateInputs)
        self.can_vary_step = bool(flags.canHandleVariableCommunicationStepSize)
        self.may_be_pending = bool(flags.canRunAsynchronuously)
        self.is_remote = isinstance(fmu, RemoteFmu)

    def dependencies(self, variable: str) -> list[str] | None:
        """Return the inputs on which an output depends without delay; None if not stated."""
        for unknown in self.fmu.description.outputs:
            if unknown.variable.name == variable and unknown.dependencies is not None:
                return [v.name for v in unknown.dependencies if v.causality == "input"]
        return None

    def is_continuous(self, variable: str) -> bool:
        """Return whether a variable is an output that changes continuously."""
        scalar = self.fmu.variables[variable]
        return (
            scalar.causality == "output"
            and scalar.type == "Real"
            and scalar.variability in (None, "continuous")
        )

    def is_tunable(self, variable: str) -> bool:
        """Return whether a variable is a parameter that may be set between steps."""
        return read_signal(self.fmu.variables[variable]).is_tunable

    def nominal(self, variable: str) -> float:
        """Return the nominal value of a variable; 1 if it has none."""
        scalar = self.fmu.variables[variable]
        text = getattr(scalar, "nominal", None) or getattr(scalar.declaredType, "nominal", None)
        return abs(float(text)) or 1.0 if text else 1.0

    def start(self, variable: str) -> float:
        """Return the start value of an input as set, or as the FMU declares it."""
        declared = read_signal(self.fmu.variables[variable]).start
        return float(self.fmu.parameters.get(variable, declared))

    def bind_step(self, now: ctypes.c_double, size: ctypes.c_double, may_go_back: bool) -> FmiCall:
        """Return the call of a step, which waits for a pending step.

        Parameters
        ----------
        now, size : ctypes double
            Start and length of the step in s, read at each call.
        may_go_back : bool
            Whether an earlier state may be restored.
        """
        step = self.fmu.bound("fmi2DoStep", now, size, ctypes.c_int(not may_go_back))
        if not self.may_be_pending:
            return step
        status = ctypes.c_int()
        get_status = self.fmu.bound(
            "fmi2GetStatus", ctypes.c_int(fmi2DoStepStatus), ctypes.byref(status)
        )

        def step_and_wait() -> int:
            status.value = step()
            while status.value == fmi2Pending:
                time.sleep(1e-4)
                answer = get_status()
                if answer > fmi2Warning:
                    return answer
            return status.value

        return step_and_wait

    def check_status(self, status: int, request: str, step: CommunicationStep) -> None:
        """Count a warning; raise an error on anything worse.

        Parameters
        ----------
        status : int
            The FMI status.
        request : str
            The request to the member, in words.
        step : CommunicationStep

        Raises
        ------
        UserError
            With the member, the time, the request, the status and the FMU's own message.
        """
        if status == fmi2Warning:
            self.fmu.warnings += 1
            return
        remark = ""
        if request == STEP:
            timed_request = f"step from {step.start:.10g} s to {step.end:.10g} s"
            if status == fmi2Discard:
                remark = self._discard_remark()
        else:
            timed_request = f"{request} at {step.end:.10g} s"
        raise UserError(f"{self.name}: {self.fmu.failed(timed_request, status, remark)}")

    def _discard_remark(self) -> str:
        """Return how far a discarded step got, and whether the FMU asks to end the simulation."""
        remark = ""
        reached = self.fmu.last_time()
        if reached is not None:
            remark = f", it reached {reached:.10g} s"
        if self.fmu.asks_to_end():
            remark += ", it asks to end the simulation"
        return remark


class SavedState:
    """The saved states of several members, which can be restored any number of times."""

    def __init__(self, members: Sequence[Instance], step: CommunicationStep):
        self._step = step
        self._members = members
        self._states = [ctypes.c_void_p() for _ in members]
        self._saves = self._bound("fmi2GetFMUstate", map(ctypes.byref, self._states))
        self._restores = self._bound("fmi2SetFMUstate", self._states)
        self._frees = self._bound("fmi2FreeFMUstate", map(ctypes.byref, self._states))

    def _bound(self, function: str, arguments: Iterable[Any]) -> list[FmiCall]:
        """Return the calls of a function of FMI, one for each member."""
        pairs = zip(self._members, arguments, strict=True)
        return [member.fmu.bound(function, argument) for member, argument in pairs]

    def _call(self, calls: Sequence[FmiCall], request: str) -> None:
        for member, call in zip(self._members, calls, strict=True):
            status = call()
            if status:
                member.check_status(status, request, self._step)

    def save(self) -> None:
        """Save the present states; UserError if a member refuses."""
        self._call(self._saves, "saving the state")

    def restore(self) -> None:
        """Restore the states that were saved last; UserError if a member refuses."""
        self._call(self._restores, "restoring the state")

    def free(self) -> None:
        """Free the saved states; UserError if a member refuses."""
        self._call(self._frees, "releasing a state")

    def release(self) -> None:
        """Free states that are still saved, of members that may be called, ignoring failures."""
        for member, free, state in zip(self._members, self._frees, self._states, strict=True):
            if state and not member.fmu.corrupted:
                free()


def list_names(ports: Sequence[Port]) -> str:
    """Return the names of a member's variables for a message; of many only the first three."""
    names = [port.variable for port in ports]
    return ", ".join(names if len(names) <= 4 else [*names[:3], f"{len(names) - 3} more"])
