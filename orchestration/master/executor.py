"""A system put together: what is called in which order, bound once, and then repeated as fast as Python can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from time import perf_counter
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.signal import type_of
from orchestration.master.algebraic_loops import FixedPoint
from orchestration.master.buffers import Buffer, FmiCall, bind, transfers
from orchestration.master.dependency_graph import Loop, Read, Structure, describe, order, plan
from orchestration.master.instances import STEP, Clock, Instance, SavedState, listed
from orchestration.master.schedule import ExchangeStage, MemberCall, PlainStep, Schedule, Settings
from orchestration.master.stepping import BufferedConnection, MemberStep, StepHistory
from orchestration.system.model import Connection, Port

Array = NDArray[np.float64]


class Executor:
    """Steps the members of a system and lets them exchange values.

    Parameters
    ----------
    members : sequence of Instance
    structure : Structure
        Everything that is fed and read.
    connections : sequence of Connection
    external, disturbances : Mapping of Port to list of float
        Values from outside at all communication points, and what is added to connected inputs.
    settings : Settings
    clock : Clock

    Attributes
    ----------
    outputs, inputs : Buffer
        Of all members.
    seconds : list of float
        Time spent in the steps of each member.
    loops : list of tuple
        Each algebraic loop, and what solves it.
    saved_states : list of SavedState
        Of loops, and of steps that can be taken back.
    complete : Schedule
        In which all members take part.
    """

    def __init__(
        self,
        members: Sequence[Instance],
        structure: Structure,
        connections: Sequence[Connection],
        external: Mapping[Port, list[float]],
        disturbances: Mapping[Port, list[float]],
        settings: Settings,
        clock: Clock,
    ):
        self.members, self.structure, self.settings, self.clock = (
            members,
            structure,
            settings,
            clock,
        )
        self._by_name = {member.name: member for member in members}
        self._external, self._disturbances = external, disturbances
        self._point = 0  # whose values from outside are in the inputs
        names = [member.name for member in members]
        self._complete_plan = plan(structure, names)
        self.order = order(structure)
        self.outputs, self.inputs = self._buffers()
        for port, place in self.inputs.at.items():
            self.inputs.cells[place] = self._by_name[port.member].start(port.variable)
        self._connections = {
            c.target: BufferedConnection(
                self.inputs.at[c.target], self.outputs.at[c.source], c.factor, c.offset
            )
            for c in connections
        }
        self.slow = {name: 1 / rate for name, rate in settings.rates.items() if rate < 1}
        self.loops: list[tuple[Loop, FixedPoint]] = []
        self.saved_states: list[SavedState] = []
        self.seconds = [0.0] * len(members)
        self._histories: dict[str, StepHistory] = {}
        self._schedules: dict[frozenset[str], Schedule] = {}
        self.complete = self.schedule(frozenset(names))

    def _buffers(self) -> tuple[Buffer, Buffer]:
        """Buffers in which what is moved in one call stands together."""
        outputs = {name: list(self._complete_plan.early[name]) for name in self._by_name}
        inputs: dict[str, list[Port]] = {name: [] for name in self._by_name}
        for operation in self._complete_plan.operations:
            if isinstance(operation, Loop):
                read, written = operation.outputs, operation.inputs
            else:
                read, written = (
                    (operation.ports, ()) if isinstance(operation, Read) else ((), operation.ports)
                )
            for port in read:
                outputs[port.member].append(port)
            for port in written:
                inputs[port.member].append(port)
        return Buffer(chain(*outputs.values())), Buffer(chain(*inputs.values()))

    # --- preparation ------------------------------------------------------------------------------------------------

    def due(self, k: int, last: int) -> frozenset[str]:
        """Names of the members that take part in the exchange at point `k`, and in the step that ends there."""
        return frozenset(
            name
            for name in self._by_name
            if name not in self.slow or k == last or k % int(self.slow[name]) == 0
        )

    def changes(self, points: int) -> list[bool]:
        """For each communication point whether a value from outside differs from that before."""
        rows = np.array(list(self._external.values()))
        return (
            [True, *(np.diff(rows) != 0.0).any(axis=0).tolist()] if rows.size else [False] * points
        )

    def schedule(self, due: frozenset[str]) -> Schedule:
        """What to do when these members take part."""
        if due not in self._schedules:
            self._schedules[due] = self._make_schedule(due)
        return self._schedules[due]

    def _make_schedule(self, due: frozenset[str]) -> Schedule:
        order_of_exchange = (
            self._complete_plan if len(due) == len(self.members) else plan(self.structure, due)
        )
        schedule = Schedule(order_of_exchange, [], [], [])
        stepped: set[str] = set()
        for name in [name for name in self.order if name in due]:
            self._add_step(schedule, self._by_name[name], stepped)
            stepped.add(name)
        for operation in order_of_exchange.operations:
            if isinstance(operation, Loop):
                self._add_loop(schedule, operation)
                continue
            member = self._by_name[operation.member]
            if not isinstance(operation, Read):
                schedule.stages.append(self._stage(operation.ports))
            elif not schedule.stages:
                schedule.stages.append(self._stage(()))
            verb = "Get" if isinstance(operation, Read) else "Set"
            schedule.stages[-1].calls.extend(self._moving(verb, member, operation.ports))
        return schedule

    def _moving(self, verb: str, member: Instance, ports: Sequence[Port]) -> list[MemberCall]:
        doing = ("setting " if verb == "Set" else "reading ") + listed(ports)
        buffer = self.inputs if verb == "Set" else self.outputs
        moved = transfers(verb, member.fmu, ports, buffer)
        return [
            MemberCall(bind(transfer, member.fmu, buffer), member, doing, transfer)
            for transfer in moved
        ]

    def _stage(self, ports: Sequence[Port]) -> ExchangeStage:
        connections = [self._connections[port] for port in ports if port in self._connections]
        return ExchangeStage(
            [(c.target, c.source) for c in connections if (c.factor, c.offset) == (1.0, 0.0)],
            [c for c in connections if (c.factor, c.offset) != (1.0, 0.0)],
            [
                (self.inputs.at[port], self._disturbances[port])
                for port in ports
                if port in self._disturbances
            ],
            [
                (self.inputs.at[port], self._external[port])
                for port in ports
                if port in self._external
            ],
            [],
        )

    def _add_step(self, schedule: Schedule, member: Instance, stepped: set[str]) -> None:
        settings, calls = self.settings, list[MemberCall]()
        connected = [port for port in self.structure.fed[member.name] if port in self._connections]
        updated = [
            port
            for port in connected
            if settings.sequential and self.structure.sources[port].member in stepped
        ]
        real = [
            port for port in connected if type_of(member.fmu.variables[port.variable]) == "real"
        ]
        linear = real if settings.extrapolation else []
        parts = max(1, int(settings.rates.get(member.name, 1)))
        early = schedule.plan.early[member.name]
        reads = list(early)
        if settings.sequential:  # those who step later use outputs that depend on inputs too
            following = set(self.order) - stepped - {member.name}
            used = {
                self.structure.sources[port]
                for name in following
                for port in self.structure.fed[name]
                if port in self._connections
            }
            reads = [
                port for port in self.structure.wanted[member.name] if port in early or port in used
            ]
        slow = member.name in self.slow
        if held := [port for port in updated if port not in linear]:
            stage = self._stage(held)
            stage.calls.extend(self._moving("Set", member, held))
            calls.append(MemberCall(self._refresh(stage), member, STEP, stage))
        if linear or parts > 1 or slow:
            to_new_value = [self._connections[port] for port in updated if port in linear]
            set_at_end = not settings.feedthrough or len(reads) > len(early)
            history = self._histories.setdefault(
                member.name, StepHistory(self.clock.start, [0.0] * len(linear))
            )
            step = MemberStep(
                member,
                self.clock,
                self.inputs,
                self.outputs,
                linear,
                to_new_value,
                parts,
                slow,
                set_at_end,
                settings.adaptive,
                history,
            )
            calls.append(MemberCall(step, member, STEP))
            if linear or slow:
                schedule.extrapolating.append(step)
        else:
            plain_step = member.stepper(self.clock.now, self.clock.size, settings.adaptive)
            what = None if member.may_be_pending else PlainStep(final=not settings.adaptive)
            calls.append(MemberCall(plain_step, member, STEP, what))
        schedule.steps.append(
            (self.members.index(member), calls + self._moving("Get", member, reads))
        )

    def _refresh(self, stage: ExchangeStage) -> FmiCall:
        """Give a member, before its step, what others have delivered by theirs."""

        def refresh() -> int:
            self.exchange([stage], self._point)
            return 0

        return refresh

    def _add_loop(self, schedule: Schedule, loop: Loop) -> None:
        inputs, outputs = self.inputs, self.outputs
        closing = [self._connections[port] for port in loop.inputs]
        targets, sources = (
            np.array([c.target for c in closing]),
            np.array([c.source for c in closing]),
        )
        factors, offsets = (
            np.array([c.factor for c in closing]),
            np.array([c.offset for c in closing]),
        )
        added = [
            (k, self._disturbances[p]) for k, p in enumerate(loop.inputs) if p in self._disturbances
        ]
        members = [m for m in self.members if any(port.member == m.name for port in loop.outputs)]
        calls = []
        for verb, ports in (("Set", loop.inputs), ("Get", loop.outputs)):
            for member in members:
                calls += self._moving(
                    verb, member, [port for port in ports if port.member == member.name]
                )
        saved = SavedState(members, self.clock)

        def around(v: Array) -> Array:
            saved.restore()
            inputs.values[targets] = v
            self._carry_out(calls)
            returned: Array = factors * outputs.values[sources] + offsets
            for k, column in added:
                returned[k] += column[self._point]
            return returned

        kinds = {
            type_of(self._by_name[port.member].fmu.variables[port.variable]) for port in loop.inputs
        }
        nominal = np.array(
            [self._by_name[port.member].nominal(port.variable) for port in loop.inputs]
        )
        fixed_point = FixedPoint(around, nominal, kinds == {"real"})

        def solve() -> int:
            saved.save()
            try:
                fixed_point.solve(inputs.values[targets])
            except UserError as error:
                raise UserError(f"{describe(loop)}, at {self.clock.end:.10g} s: {error}") from error
            return 0

        schedule.stages.append(
            ExchangeStage([], [], [], [], [MemberCall(solve, members[0], "solving")])
        )
        self.loops.append((loop, fixed_point))
        self.saved_states.append(saved)

    # --- at work ----------------------------------------------------------------------------------------------------

    def step(self, schedule: Schedule, start: float, end: float) -> None:
        """Take the members over a step; what does not need the inputs at its end is read.

        Raises
        ------
        UserError
            If a member fails.
        """
        self.clock.set(start, end)
        seconds = self.seconds
        schedule.count += 1
        then = perf_counter()
        for number, calls in schedule.steps:
            for call, member, doing, _ in calls:
                status = call()
                if status:
                    member.check_status(status, doing, self.clock)
            now = perf_counter()
            seconds[number] += now - then
            then = now

    def at(self, start: float, end: float, k: int) -> None:
        """Be in a step from `start` to `end`, with the values from outside of point `k` in the inputs."""
        self.clock.set(start, end)
        self._point = k

    def read_early(self) -> None:
        """Read what needs no inputs, as after a step."""
        self._carry_out(
            [call for _, calls in self.complete.steps for call in calls if call.doing != STEP]
        )

    def exchange(self, stages: Sequence[ExchangeStage], k: int) -> None:
        """Set inputs and read outputs, with the values from outside of communication point `k`.

        Raises
        ------
        UserError
            If a member fails, gives something that is no number to another, or a loop cannot be solved.
        """
        inputs, outputs = self.inputs.cells, self.outputs.cells
        self._point = k
        for copies, scaled, disturbances, external, calls in stages:
            for target, source in copies:
                value = outputs[source]
                if value - value:  # not a number, or infinite
                    self.not_finite(source)
                inputs[target] = value
            for target, source, factor, offset in scaled:
                value = factor * outputs[source] + offset
                if value - value:
                    self.not_finite(source)
                inputs[target] = value
            for target, column in disturbances:
                inputs[target] += column[k]
            for target, column in external:
                inputs[target] = column[k]
            for call, member, doing, _ in calls:
                status = call()
                if status:
                    member.check_status(status, doing, self.clock)

    def update_slopes(self, schedule: Schedule) -> None:
        """Let those that extrapolate see where their inputs went."""
        for step in schedule.extrapolating:
            step.update_slopes()

    def _carry_out(self, calls: Sequence[MemberCall]) -> None:
        for call, member, doing, _ in calls:
            if status := call():
                member.check_status(status, doing, self.clock)

    def not_finite(self, place: int) -> NoReturn:
        """Name an output that is no number; UserError."""
        port, value = list(self.outputs.at)[place], self.outputs.cells[place]
        raise UserError(
            f"{port.member}: its output {port.variable} is {value:g} at {self.clock.end:.10g} s"
        )

    # --- afterwards -------------------------------------------------------------------------------------------------

    def steps_of(self, member: Instance) -> int:
        """How many steps a member made."""
        made = sum(
            schedule.count for due, schedule in self._schedules.items() if member.name in due
        )
        return made * max(1, int(self.settings.rates.get(member.name, 1)))
