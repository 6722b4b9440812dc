"""The schedule of a system as a program of the stepping kernel, which comes back to Python for what is rare."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.kernel import library
from orchestration.fmu.kernel.program import (
    WHOLE_NUMBERS,
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


def translated(executor: Executor, points: Sequence[float], rows: Array) -> Program:
    """Make a program of what all members do in a step and at its end.

    Parameters
    ----------
    executor : Executor
        In which all members take part in every step, and inputs are held.
    points : sequence of float
        Communication points in s; the program is for those after the first.
    rows : ndarray, shape (any, outputs)
        Where the outputs are kept, the first after a rewind in the first row.

    Returns
    -------
    Program
        Owners in it are the members, by their number.
    """
    translation = _Translation(executor, points)
    program = translation.program
    program.begin()
    for number, calls in executor.complete.steps:
        for call in calls:
            translation.add(call, lag=1)
        program.spent(number)
    for stage in executor.complete.stages:
        translation.add_stage(stage, lag=0)
    program.keep(ctypes.addressof(executor.outputs.cells), len(executor.outputs.at), rows)
    return program


class _Translation:
    """What a schedule calls, copies and feeds, added to a program in that order."""

    def __init__(self, executor: Executor, points: Sequence[float]):
        self._executor, self._points, self._times = executor, points, np.array(points)
        self._owners = {member.name: k for k, member in enumerate(executor.members)}
        self.program = Program(owners=[member.fmu.label for member in executor.members])

    def add_stage(self, stage: ExchangeStage, lag: int) -> None:
        """Add an exchange of values; before the step (`lag` 1) those from outside are of the point before."""
        inputs, outputs = self._executor.inputs, self._executor.outputs
        copies = [_link(inputs, target, _place(outputs, source)) for target, source in stage.copies]
        scaled = [
            _link(inputs, c.target, _place(outputs, c.source), c.factor, c.offset)
            for c in stage.scaled
        ]
        self.program.links(
            library.PASS, copies, self._no_number([source for _, source in stage.copies], lag)
        )
        self.program.links(
            library.SCALE, scaled, self._no_number([c.source for c in stage.scaled], lag)
        )
        for kind, columns in (
            (library.DISTURB, stage.disturbances),
            (library.DRIVE, stage.external),
        ):
            links = []
            for target, column in columns:
                values = np.array(column)
                self.program.hold(values)
                links.append(_link(inputs, target, in_array(values).shifted(-lag)))
            self.program.links(kind, links, self._no_number([], lag))
        for call in stage.calls:
            self.add(call, lag)

    def add(self, call: MemberCall, lag: int) -> None:
        """Add a call; before the exchange (`lag` 1) the values from outside are of the point before."""
        what, member = call.what, call.member
        handler = self._handler(call, lag)
        if isinstance(what, ExchangeStage):
            self.add_stage(what, lag)
        elif isinstance(what, PlainStep):
            ends = in_array(self._times)
            step, owner = member.fmu.bound("fmi2DoStep"), self._owners[member.name]
            self.program.step(step, ends.shifted(-1), ends, handler, owner, what.final)
        elif isinstance(what, Transfer):
            self._add_transfer(what, member, handler)
        else:
            self.program.call(handler)

    def _add_transfer(self, moved: Transfer, member: Instance, handler: Handler) -> None:
        setting, kind, fmu = moved.verb == "Set", moved.kind, member.fmu
        buffer = self._executor.inputs if setting else self._executor.outputs
        call, owner = fmu.bound(f"fmi2{moved.verb}{kind.capitalize()}"), self._owners[member.name]
        references = [fmu.variables[port.variable].valueReference for port in moved.ports]
        places = [buffer.at[port] for port in moved.ports]
        if kind == "real":
            what = library.SET_REAL if setting else library.GET_REAL
            self.program.real(what, call, references, _place(buffer, places[0]), handler, owner)
        else:
            what = WHOLE_NUMBERS[kind] if setting else library.GET_WHOLE
            self.program.whole(what, call, references, _place(buffer, 0), places, handler, owner)

    def _at(self, point: int, lag: int) -> None:
        self._executor.at(self._points[point - 1], self._points[point], point - lag)

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


def _link(
    inputs: Buffer, target: int, source: Values, factor: float = 1.0, offset: float = 0.0
) -> library.Link:
    return library.Link(
        _place(inputs, target).address, source.address, source.stride, factor, offset
    )
