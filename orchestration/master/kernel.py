"""The schedule of a system as a program of the stepping kernel, and a run of it that comes back for what is rare."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.kernel import library
from orchestration.fmu.kernel.program import (
    WHOLE_NUMBERS,
    Execution,
    Handler,
    Program,
    Return,
    Values,
    in_array,
)
from orchestration.master.buffers import Buffer, Transfer
from orchestration.master.executor import Executor
from orchestration.master.instances import Instance
from orchestration.master.schedule import ExchangeStage, MemberCall, PlainStep

Array = NDArray[np.float64]


class KernelSchedule:
    """The steps and exchanges of all members, at every communication point after the first; a context manager.

    Parameters
    ----------
    executor : Executor
        In which all members take part in every step, and inputs are held.
    points : sequence of float
        Communication points in s.
    most : int
        Largest number of points between two looks at `taken`.
    """

    def __init__(self, executor: Executor, points: Sequence[float], most: int):
        self._executor, self._points = executor, points
        self._owners = {member.name: k for k, member in enumerate(executor.members)}
        self._times = np.array(points)
        self._rows = np.empty((most, len(executor.outputs.at)))
        self._program = Program()
        self._program.begin()
        for number, calls in executor.complete.steps:
            for call in calls:
                self._add(call, lag=1)
            self._program.spent(number)
        for stage in executor.complete.stages:
            self._add_stage(stage, lag=0)
        self._program.keep(ctypes.addressof(executor.outputs.cells), len(executor.outputs.at), self._rows)
        self._execution = Execution(self._program, len(executor.members), first=1)

    def __enter__(self) -> KernelSchedule:
        self._execution.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._execution.__exit__(*error)
        execution, executor = self._execution, self._executor
        executor.complete.count += execution.point - 1 + execution.inside  # a step that failed was begun
        for k, member in enumerate(executor.members):
            member.fmu.warnings += int(execution.warnings[k])
            executor.seconds[k] += float(execution.seconds[k])

    @property
    def done(self) -> int:
        """How many communication points are complete."""
        return self._execution.point

    def carry_on(self, until: int) -> bool:
        """Go on up to a communication point, which is left out; false if Python should look around before.

        Raises
        ------
        UserError
            If a member fails, gives something that is no number to another, or a loop cannot be solved.
        """
        return self._execution.carry_on(until)

    def taken(self) -> Array:
        """Rows of outputs, one for each point completed since the last look; valid until the kernel goes on."""
        kept = self._rows[: self._execution.kept]
        self._execution.rewind()
        return kept

    def _at(self, point: int, lag: int) -> None:
        self._executor.at(self._points[point - 1], self._points[point], point - lag)

    def _add_stage(self, stage: ExchangeStage, lag: int) -> None:
        inputs, outputs = self._executor.inputs, self._executor.outputs
        copies = [_link(inputs, target, _place(outputs, source)) for target, source in stage.copies]
        scaled = [_link(inputs, c.target, _place(outputs, c.source), c.factor, c.offset) for c in stage.scaled]
        self._program.links(library.PASS, copies, self._no_number([source for _, source in stage.copies], lag))
        self._program.links(library.SCALE, scaled, self._no_number([c.source for c in stage.scaled], lag))
        for kind, columns in ((library.DISTURB, stage.disturbances), (library.DRIVE, stage.external)):
            links = []
            for target, column in columns:
                values = np.array(column)
                self._program.hold(values)
                links.append(_link(inputs, target, in_array(values).shifted(-lag)))
            self._program.links(kind, links, self._no_number([], lag))
        for call in stage.calls:
            self._add(call, lag)

    def _add(self, call: MemberCall, lag: int) -> None:
        """Add a call; before the exchange (`lag` 1) the values from outside are those of the point before."""
        what, member = call.what, call.member
        handler = self._handler(call, lag)
        if isinstance(what, ExchangeStage):
            self._add_stage(what, lag)
        elif isinstance(what, PlainStep):
            ends = in_array(self._times)
            step, owner = member.fmu.bound("fmi2DoStep"), self._owners[member.name]
            self._program.step(step, ends.shifted(-1), ends, handler, owner, what.final)
        elif isinstance(what, Transfer):
            self._add_transfer(what, member, handler)
        else:
            self._program.call(handler)

    def _add_transfer(self, moved: Transfer, member: Instance, handler: Handler) -> None:
        setting, kind, fmu = moved.verb == "Set", moved.kind, member.fmu
        buffer = self._executor.inputs if setting else self._executor.outputs
        call, owner = fmu.bound(f"fmi2{moved.verb}{kind.capitalize()}"), self._owners[member.name]
        references = [fmu.variables[port.variable].valueReference for port in moved.ports]
        places = [buffer.at[port] for port in moved.ports]
        if kind == "real":
            what = library.SET_REAL if setting else library.GET_REAL
            self._program.real(what, call, references, _place(buffer, places[0]), handler, owner)
        else:
            what = WHOLE_NUMBERS[kind] if setting else library.GET_WHOLE
            self._program.whole(what, call, references, _place(buffer, 0), places, handler, owner)

    def _handler(self, call: MemberCall, lag: int) -> Handler:
        """Do in Python what the kernel cannot, or could not: the words for it are there."""

        def handle(why: Return) -> None:
            self._at(why.point, lag)
            status = why.status if why.reason == library.FAILED else call.call()
            if status:
                call.member.check_status(status, call.doing, self._executor.clock)

        return handle

    def _no_number(self, sources: list[int], lag: int) -> Handler:
        def handle(why: Return) -> None:
            self._at(why.point, lag)
            self._executor.not_finite(sources[why.which])

        return handle


def _place(buffer: Buffer, place: int) -> Values:
    return Values(ctypes.addressof(buffer.cells)).shifted(place)


def _link(inputs: Buffer, target: int, source: Values, factor: float = 1.0, offset: float = 0.0) -> library.Link:
    return library.Link(_place(inputs, target).address, source.address, source.stride, factor, offset)
