"""The executor of a system: its calls are bound once and then repeated as fast as Python can."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from time import perf_counter
from typing import NoReturn

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu.signal import type_of
from orchestration.master.algebraic_loops import FixedPoint
from orchestration.master.buffers import Buffer, bind, list_transfers
from orchestration.master.dependency_graph import (
    Loop,
    Read,
    Structure,
    describe_loop,
    order_exchange,
    order_steps,
)
from orchestration.master.instances import STEP, CommunicationStep, Instance, SavedState, list_names
from orchestration.master.schedule import (
    BufferedConnection,
    ExchangeStage,
    MasterSettings,
    MemberCall,
    MemberStep,
    PlainStep,
    Schedule,
    StepHistory,
)
from orchestration.system import Connection, Port


class Executor:
    """The members of a system with their buffers, which step and exchange values.

    Parameters
    ----------
    members : sequence of Instance
    structure : Structure
        All inputs that are fed and all variables that are read.
    connections : sequence of Connection
    external : Mapping of Port to sequence of float
        Values of inputs from outside at all communication points.
    disturbances : Mapping of Port to sequence of float
        Values that are added to connected inputs at all communication points.
    settings : MasterSettings
    present_step : CommunicationStep

    Attributes
    ----------
    outputs, inputs : Buffer
        Outputs and inputs of all members.
    seconds : list of float
        Time spent in the steps of each member.
    loops : list of tuple
        Each algebraic loop, and its solver.
    saved_states : list of SavedState
        States that loops and adaptive steps go back to.
    complete : Schedule
        The schedule in which all members take part.
    """

    def __init__(
        self,
        members: Sequence[Instance],
        structure: Structure,
        connections: Sequence[Connection],
        *,
        external: Mapping[Port, Sequence[float]],
        disturbances: Mapping[Port, Sequence[float]],
        settings: MasterSettings,
        present_step: CommunicationStep,
    ):
        self.members = members
        self.structure = structure
        self.settings = settings
        self.present_step = present_step
        self._by_name = {member.name: member for member in members}
        self._external = external
        self._disturbances = disturbances
        self._point = 0  # the point whose external values are in the inputs
        names = [member.name for member in members]
        self._complete_order = order_exchange(structure, names)
        self.order = order_steps(structure)
        self.outputs, self.inputs = self._make_buffers()
        for port, place in self.inputs.at.items():
            self.inputs.cells[place] = self._by_name[port.member].start(port.variable)
        self._connections = {
            c.target: BufferedConnection(
                self.inputs.at[c.target], self.outputs.at[c.source], c.factor, c.offset
            )
            for c in connections
        }
        self._tables = {c.target: dict(c.table) for c in connections if c.table}
        self.slow = {name: 1 / rate for name, rate in settings.rates.items() if rate < 1}
        self.loops: list[tuple[Loop, FixedPoint]] = []
        self.saved_states: list[SavedState] = []
        self.seconds = [0.0] * len(members)
        self._histories: dict[str, StepHistory] = {}
        self._schedules: dict[frozenset[str], Schedule] = {}
        self.complete = self.schedule(frozenset(names))

    def _make_buffers(self) -> tuple[Buffer, Buffer]:
        """Return buffers of outputs and inputs in which the ports of one call are contiguous."""
        read = [*chain(*self._complete_order.early.values())]
        written: list[Port] = []
        for operation in self._complete_order.operations:
            if isinstance(operation, Loop):
                read += operation.outputs
                written += operation.inputs
            elif isinstance(operation, Read):
                read += operation.ports
            else:
                written += operation.ports
        members = list(self._by_name)
        read.sort(key=lambda port: members.index(port.member))
        written.sort(key=lambda port: members.index(port.member))
        return Buffer(read), Buffer(written)

    # --- preparation

    def due(self, k: int, last: int) -> frozenset[str]:
        """Return the members that take part in the exchange at point `k` and the step before it."""
        return frozenset(
            name
            for name in self._by_name
            if name not in self.slow or k == last or k % int(self.slow[name]) == 0
        )

    def changes(self, points: int) -> list[bool]:
        """Return for each communication point whether an external value has changed there."""
        rows = np.array(list(self._external.values()))
        if not rows.size:
            return [False] * points
        return [True, *(np.diff(rows) != 0.0).any(axis=0).tolist()]

    def schedule(self, due: frozenset[str]) -> Schedule:
        """Return the schedule in which these members take part."""
        if due not in self._schedules:
            self._schedules[due] = self._make_schedule(due)
        return self._schedules[due]

    def _make_schedule(self, due: frozenset[str]) -> Schedule:
        """Make the schedule in which these members take part.

        A stage of the exchange begins with each setting of inputs; the readings after it belong to
        the same stage.
        """
        is_complete = len(due) == len(self.members)
        order = self._complete_order if is_complete else order_exchange(self.structure, due)
        schedule = Schedule(order, [], [], [])
        stepped: set[str] = set()
        for name in self.order:
            if name in due:
                self._add_step(schedule, self._by_name[name], stepped)
                stepped.add(name)
        for operation in order.operations:
            if isinstance(operation, Loop):
                self._add_loop(schedule, operation)
                continue
            member = self._by_name[operation.member]
            if not isinstance(operation, Read):
                schedule.stages.append(self._make_stage(operation.ports))
            elif not schedule.stages:  # nothing is set before this reading
                schedule.stages.append(self._make_stage(()))
            verb = "Get" if isinstance(operation, Read) else "Set"
            schedule.stages[-1].calls.extend(self._transfer_calls(verb, member, operation.ports))
        return schedule

    def _transfer_calls(
        self, verb: str, member: Instance, ports: Sequence[Port]
    ) -> list[MemberCall]:
        request = ("setting " if verb == "Set" else "reading ") + list_names(ports)
        buffer = self.inputs if verb == "Set" else self.outputs
        return [
            MemberCall(
                bind(transfer, member.fmu, buffer),
                member,
                request,
                None if member.is_remote else transfer,
            )
            for transfer in list_transfers(verb, member.fmu, ports, buffer)
        ]

    def _make_stage(self, ports: Sequence[Port]) -> ExchangeStage:
        """Return a stage that copies values to these inputs, and maps those that have a table."""
        connections = [self._connections[port] for port in ports if port in self._connections]
        places = self.inputs.at
        return ExchangeStage(
            copies=[(c.target, c.source) for c in connections if not _is_scaled(c)],
            scaled=[c for c in connections if _is_scaled(c)],
            disturbances=[
                (places[port], self._disturbances[port])
                for port in ports
                if port in self._disturbances
            ],
            external=[
                (places[port], self._external[port]) for port in ports if port in self._external
            ],
            calls=[self._mapping_call(port) for port in ports if port in self._tables],
        )

    def _mapping_call(self, port: Port) -> MemberCall:
        """Return a call that changes an input, once it is set, by the table of its connection."""
        table = self._tables[port]
        connection = self._connections[port]
        inputs = self.inputs.cells
        outputs = self.outputs.cells

        def change() -> int:
            value = outputs[connection.source]
            inputs[connection.target] += table.get(value, value) - value
            return 0

        return MemberCall(change, self._by_name[port.member], "mapping a value")

    def _add_step(self, schedule: Schedule, member: Instance, stepped: set[str]) -> None:
        """Add the calls of a member in a step, after those of the members that have stepped.

        Its inputs from these members are updated first, then it steps, then outputs are read.
        """
        connected = [p for p in self.structure.fed[member.name] if p in self._connections]
        updated = []  # inputs whose sources have stepped
        if self.settings.sequential:
            updated = [port for port in connected if self._source(port).member in stepped]
        linear = []  # inputs that change linearly over the step; all others are held
        if self.settings.extrapolation:
            linear = [port for port in connected if self._is_real(port)]
        early = schedule.order.early[member.name]
        reads = self._reads_after_step(member, early, stepped)
        calls: list[MemberCall] = []
        updated_held = [port for port in updated if port not in linear]
        if updated_held:
            calls.append(self._update_call(member, updated_held))
        if linear or self._parts(member) > 1 or member.name in self.slow:
            updated_linear = [port for port in updated if port in linear]
            reads_all = len(reads) > len(early)
            step = self._member_step(member, linear, updated_linear, reads_all)
            calls.append(MemberCall(step, member, STEP))
            if linear:
                schedule.extrapolating.append(step)
        else:
            calls.append(self._plain_step_call(member))
        calls += self._transfer_calls("Get", member, reads)
        schedule.steps.append((self.members.index(member), calls))

    def _member_step(
        self, member: Instance, linear: list[Port], updated: list[Port], reads_all: bool
    ) -> MemberStep:
        """Return a step in parts, or with linear inputs, some updated by members that have stepped.

        If outputs that depend on inputs are read after it, inputs are set to those of its end.
        """
        return MemberStep(
            member=member,
            present_step=self.present_step,
            inputs=self.inputs,
            outputs=self.outputs,
            linear=linear,
            updated=[self._connections[port] for port in updated],
            parts=self._parts(member),
            resumes=member.name in self.slow,
            set_at_end=reads_all or not self.settings.feedthrough,
            may_go_back=self.settings.adaptive,
            history=self._history(member, len(linear)),
        )

    def _parts(self, member: Instance) -> int:
        """Return the number of steps of a member in one of the system, at least 1."""
        return max(1, int(self.settings.rates.get(member.name, 1)))

    def _source(self, port: Port) -> Port:
        return self.structure.sources[port]

    def _is_real(self, port: Port) -> bool:
        return type_of(self._by_name[port.member].fmu.variables[port.variable]) == "real"

    def _reads_after_step(
        self, member: Instance, early: Sequence[Port], stepped: set[str]
    ) -> list[Port]:
        """Return the outputs that are read right after the step of a member.

        These are the early ones, which depend on no input. Where members step one after another,
        those that members receive which have still to step are read as well.
        """
        if not self.settings.sequential:
            return list(early)
        still_to_step = set(self.order) - stepped - {member.name}
        received = {
            self._source(port)
            for name in still_to_step
            for port in self.structure.fed[name]
            if port in self._connections
        }
        wanted = self.structure.wanted[member.name]
        return [port for port in wanted if port in early or port in received]

    def _update_call(self, member: Instance, ports: Sequence[Port]) -> MemberCall:
        """Return a call that sets inputs to the newest outputs before the step of a member."""
        stage = self._make_stage(ports)
        stage.calls.extend(self._transfer_calls("Set", member, ports))

        def update() -> int:
            self.exchange([stage], self._point)
            return 0

        return MemberCall(update, member, STEP, stage)

    def _history(self, member: Instance, linear_count: int) -> StepHistory:
        """Return the history of a member, which all its steps share."""
        if member.name not in self._histories:
            self._histories[member.name] = StepHistory(
                self.present_step.start, [0.0] * linear_count
            )
        return self._histories[member.name]

    def _plain_step_call(self, member: Instance) -> MemberCall:
        """Return the call of a whole step, which the kernel makes unless it can be pending."""
        adaptive = self.settings.adaptive
        step = member.bind_step(self.present_step.now, self.present_step.size, adaptive)
        in_python = member.may_be_pending or member.is_remote
        operation = None if in_python else PlainStep(final=not adaptive)
        return MemberCall(step, member, STEP, operation)

    def _add_loop(self, schedule: Schedule, loop: Loop) -> None:
        """Add a stage that solves an algebraic loop."""
        members = [m for m in self.members if any(port.member == m.name for port in loop.outputs)]
        calls: list[MemberCall] = []
        for verb, ports in (("Set", loop.inputs), ("Get", loop.outputs)):
            for member in members:
                own_ports = [port for port in ports if port.member == member.name]
                calls += self._transfer_calls(verb, member, own_ports)
        saved = SavedState(members, self.present_step)
        targets = np.array([self._connections[port].target for port in loop.inputs])
        nominal = [self._by_name[port.member].nominal(port.variable) for port in loop.inputs]
        fixed_point = FixedPoint(
            self._loop_function(loop, calls, saved),
            np.array(nominal),
            all(self._is_real(port) for port in loop.inputs),
        )

        def solve() -> int:
            saved.save()
            try:
                fixed_point.solve(self.inputs.values[targets])
            except UserError as error:
                raise UserError(
                    f"{describe_loop(loop)}, at {self.present_step.end:.10g} s: {error}"
                ) from error
            return 0

        call = MemberCall(solve, members[0], "solving")
        schedule.stages.append(ExchangeStage([], [], [], [], [call]))
        self.loops.append((loop, fixed_point))
        self.saved_states.append(saved)

    def _loop_function(
        self, loop: Loop, calls: Sequence[MemberCall], saved: SavedState
    ) -> Callable[[Array], Array]:
        """Return the function whose fixed point solves a loop.

        It sets the inputs of the loop, and returns the values that they receive by its connections.
        """
        closing = zip(*(self._connections[port] for port in loop.inputs), strict=True)
        targets, sources, factors, offsets = map(np.array, closing)
        disturbances = [
            (k, self._disturbances[port])
            for k, port in enumerate(loop.inputs)
            if port in self._disturbances
        ]
        tables = [(k, self._tables.get(port, {})) for k, port in enumerate(loop.inputs)]

        def go_around(values: Array) -> Array:
            saved.restore()
            self.inputs.values[targets] = values
            self._carry_out(calls)
            returned: Array = factors * self.outputs.values[sources] + offsets
            for k, table in tables:
                returned[k] = table.get(returned[k], returned[k])
            for k, column in disturbances:
                returned[k] += column[self._point]
            return returned

        return go_around

    # --- execution

    def step(self, schedule: Schedule, start: float, end: float) -> None:
        """Step the members of a schedule, and read outputs that need no inputs at the end.

        Raises
        ------
        UserError
            If a member fails.
        """
        self.present_step.set(start, end)
        seconds = self.seconds
        schedule.count += 1
        before = perf_counter()
        for number, calls in schedule.steps:
            self._carry_out(calls)
            after = perf_counter()
            seconds[number] += after - before
            before = after

    def enter_point(self, start: float, end: float, k: int) -> None:
        """Enter a step from `start` to `end` with the external values of point `k`."""
        self.present_step.set(start, end)
        self._point = k

    def read_early(self) -> None:
        """Read the outputs that are read right after a step, without making one."""
        self._carry_out(
            [call for _, calls in self.complete.steps for call in calls if call.request != STEP]
        )

    def exchange(self, stages: Sequence[ExchangeStage], k: int) -> None:
        """Set inputs and read outputs, with the external values of communication point `k`.

        Raises
        ------
        UserError
            If a member fails or gives another a number that is not finite, or a loop cannot be
            solved.
        """
        inputs = self.inputs.cells
        outputs = self.outputs.cells
        self._point = k
        for copies, scaled, disturbances, external, calls in stages:
            for target, source in copies:
                value = outputs[source]
                if value - value:  # not 0 if NaN or infinite; faster than a call of isfinite
                    self.raise_not_finite(source)
                inputs[target] = value
            for target, source, factor, offset in scaled:
                value = factor * outputs[source] + offset
                if value - value:
                    self.raise_not_finite(source)
                inputs[target] = value
            for target, column in disturbances:
                inputs[target] += column[k]
            for target, column in external:
                inputs[target] = column[k]
            self._carry_out(calls)

    def update_slopes(self, schedule: Schedule) -> None:
        """Save the slopes of the linear inputs over the last step, in their units per second."""
        for step in schedule.extrapolating:
            step.update_slopes()

    def _carry_out(self, calls: Sequence[MemberCall]) -> None:
        """Make calls of members; UserError if one fails."""
        for call, member, request, _ in calls:
            status = call()
            if status:
                member.check_status(status, request, self.present_step)

    def raise_not_finite(self, place: int) -> NoReturn:
        """Raise UserError for an output that is not finite; `place` is its index in the buffer."""
        port = list(self.outputs.at)[place]
        value = self.outputs.cells[place]
        raise UserError(
            f"{port.member}: its output {port.variable} is {value:g}"
            f" at {self.present_step.end:.10g} s"
        )

    # --- statistics

    def steps_of(self, member: Instance) -> int:
        """Return the number of steps that a member made."""
        made = sum(
            schedule.count for due, schedule in self._schedules.items() if member.name in due
        )
        return made * self._parts(member)


def _is_scaled(connection: BufferedConnection) -> bool:
    return (connection.factor, connection.offset) != (1.0, 0.0)
