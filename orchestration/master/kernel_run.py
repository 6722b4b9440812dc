"""A run of a system in the stepping kernel: its schedule as a program, executed point by point."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from orchestration.fmu.isolation import allocate_rows
from orchestration.fmu.kernel import (
    Execution,
    Handler,
    KernelReturn,
    Program,
    Values,
    library,
)
from orchestration.master.buffers import Buffer, BufferTransfer
from orchestration.master.executor import Executor
from orchestration.master.instances import Instance
from orchestration.master.schedule import ExchangeStage, MemberCall, PlainStep


class KernelRun:
    """Steps and exchanges of all members at every point after the first; a context manager.

    Parameters
    ----------
    executor : Executor
        All members take part in every step, and inputs are held.
    points : sequence of float
        Communication points in s.
    most : int
        Largest number of points between two calls of `take_rows`.
    """

    def __init__(self, executor: Executor, points: Sequence[float], most: int):
        self._executor = executor
        self._rows = allocate_rows((most, len(executor.outputs.at)))
        program = translate(executor, points, self._rows)
        self._execution = Execution(program, len(executor.members), first=1)

    def __enter__(self) -> KernelRun:
        self._execution.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._execution.__exit__(*error)
        execution = self._execution
        executor = self._executor
        # points after the first, and the step to the next if it has begun: one that failed counts
        executor.complete.count += execution.point - 1 + execution.within_point
        for k, member in enumerate(executor.members):
            member.fmu.warnings += int(execution.warnings[k])
            executor.seconds[k] += float(execution.seconds[k])

    @property
    def done(self) -> int:
        """Number of communication points that are complete."""
        return self._execution.point

    def advance(self, until: int) -> bool:
        """Make the steps to all communication points before `until`; false if interrupted.

        Raises
        ------
        UserError
            If a member fails or gives another a number that is not finite, or a loop cannot be
            solved.
        """
        return self._execution.advance(until)

    def take_rows(self) -> Array:
        """Return the rows of outputs since the last call; they are valid until `advance`."""
        rows = self._rows[: self._execution.row_count]
        self._execution.rewind_rows()
        return rows


def translate(executor: Executor, points: Sequence[float], rows: Array) -> Program:
    """Return the kernel's program of all calls of members in a step and at its end.

    Parameters
    ----------
    executor : Executor
        All members take part in every step, and inputs are held.
    points : sequence of float
        Communication points in s; the program is for those after the first.
    rows : ndarray, shape (any, outputs)
        Receives the outputs, one row for each point, from the first row after a rewind.

    Returns
    -------
    Program
        The owners in it are the members, by their number.
    """
    translation = _Translation(executor, points)
    program = translation.program
    program.add_timer_start()
    for number, calls in executor.complete.steps:
        for call in calls:
            translation.add_call(call, lag=1)
        program.add_time_spent(number)
    for stage in executor.complete.stages:
        translation.add_stage(stage, lag=0)
    outputs = executor.outputs
    program.add_row_copy(ctypes.addressof(outputs.cells), len(outputs.at), rows)
    return program


class _Translation:
    """A program to which calls and exchanges of a schedule are added one by one.

    Their `lag` is 1 for those of a step, which have the external values of the communication point
    before, and 0 for those of the exchange at its end.
    """

    def __init__(self, executor: Executor, points: Sequence[float]):
        self._executor = executor
        self._points = points
        self._times = np.array(points)
        self._owners = {member.name: k for k, member in enumerate(executor.members)}
        self.program = Program(owners=[member.fmu.label for member in executor.members])

    def add_stage(self, stage: ExchangeStage, lag: int) -> None:
        """Add an exchange: values are copied to inputs, and then calls are made."""
        inputs = self._executor.inputs
        outputs = self._executor.outputs
        copies = [
            _link(inputs, target, _buffer_place(outputs, source)) for target, source in stage.copies
        ]
        copy_sources = [source for _, source in stage.copies]
        self.program.add_links(library.PASS, copies, self._not_finite_handler(copy_sources, lag))
        scaled = [
            _link(inputs, c.target, _buffer_place(outputs, c.source), c.factor, c.offset)
            for c in stage.scaled
        ]
        scaled_sources = [c.source for c in stage.scaled]
        self.program.add_links(library.SCALE, scaled, self._not_finite_handler(scaled_sources, lag))
        self._add_columns(library.DISTURB, stage.disturbances, lag)
        self._add_columns(library.DRIVE, stage.external, lag)
        for call in stage.calls:
            self.add_call(call, lag)

    def _add_columns(
        self, kind: int, columns: Sequence[tuple[int, Sequence[float]]], lag: int
    ) -> None:
        """Add commands that set inputs to columns of values, or add these to inputs.

        Parameters
        ----------
        kind : int
            `library.DRIVE` or `library.DISTURB`.
        columns : sequence of (int, sequence of float)
            Place of an input, and its values at all points.
        lag : int
        """
        links = []
        for target, column in columns:
            values = np.array(column)
            self.program.hold(values)
            source = Values.in_rows(values).shifted(-lag)
            links.append(_link(self._executor.inputs, target, source))
        self.program.add_links(kind, links, self._not_finite_handler([], lag))

    def add_call(self, call: MemberCall, lag: int) -> None:
        """Add the kernel's commands for a call of a member, or its call by Python without these."""
        operation = call.operation
        if isinstance(operation, ExchangeStage):
            self.add_stage(operation, lag)
            return
        handler = self._call_handler(call, lag)
        if isinstance(operation, PlainStep):
            self._add_step(operation, call.member, handler)
        elif isinstance(operation, BufferTransfer):
            self._add_transfer(operation, call.member, handler)
        else:
            self.program.add_python_call(handler)

    def _add_step(self, step: PlainStep, member: Instance, handler: Handler) -> None:
        """Add a step of a member from each communication point to the next."""
        ends = Values.in_rows(self._times)
        self.program.add_step(
            member.fmu.bound("fmi2DoStep"),
            ends.shifted(-1),
            ends,
            handler,
            owner=self._owners[member.name],
            final=step.final,
        )

    def _add_transfer(self, transfer: BufferTransfer, member: Instance, handler: Handler) -> None:
        """Add the call of a transfer."""
        fmu = member.fmu
        buffer = self._executor.inputs if transfer.verb == "Set" else self._executor.outputs
        self.program.add_transfer(
            fmu.bound(f"fmi2{transfer.verb}{transfer.kind.capitalize()}"),
            [fmu.variables[port.variable].valueReference for port in transfer.ports],
            _buffer_place(buffer, 0),
            [buffer.at[port] for port in transfer.ports],
            handler,
            owner=self._owners[member.name],
        )

    def _enter_point(self, point: int, lag: int) -> None:
        """Set the executor to the step to a point, so that messages have its time."""
        self._executor.enter_point(self._points[point - 1], self._points[point], point - lag)

    def _call_handler(self, call: MemberCall, lag: int) -> Handler:
        """Return a handler that makes a call, or reports its failure if the kernel has made it."""

        def handle(returned: KernelReturn) -> None:
            self._enter_point(returned.point, lag)
            failed = returned.reason == library.FAILED
            status = returned.status if failed else call.call()
            if status:
                call.member.check_status(status, call.request, self._executor.present_step)

        return handle

    def _not_finite_handler(self, sources: list[int], lag: int) -> Handler:
        """Return a handler that names the output whose value is not finite."""

        def handle(returned: KernelReturn) -> None:
            self._enter_point(returned.point, lag)
            self._executor.raise_not_finite(sources[returned.which])

        return handle


def _buffer_place(buffer: Buffer, place: int) -> Values:
    return Values(ctypes.addressof(buffer.cells)).shifted(place)


def _link(
    inputs: Buffer, target: int, source: Values, factor: float = 1.0, offset: float = 0.0
) -> library.ValueLink:
    target_address = _buffer_place(inputs, target).address
    return library.ValueLink(target_address, source.address, source.stride, factor, offset)
