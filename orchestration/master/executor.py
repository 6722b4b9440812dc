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
from orchestration.master.buffers import Board, Call, bind
from orchestration.master.dependency_graph import Loop, Read, Structure, describe, order, plan
from orchestration.master.instances import STEP, Clock, Instance, Memory, listed
from orchestration.master.schedule import Action, Program, Settings, Station
from orchestration.master.stepping import Move, Past, Wire
from orchestration.system.model import Connection, Port

Array = NDArray[np.float64]


class Machine:
    """Steps the members of a system and lets them exchange values.

    Parameters
    ----------
    members : sequence of Instance
    structure : Structure
        Everything that is fed and wanted.
    connections : sequence of Connection
    columns : Mapping of Port to list of float
        Values from outside at all communication points.
    settings : Settings
    clock : Clock

    Attributes
    ----------
    board, feed : Board
        Outputs and inputs of all members.
    seconds : list of float
        Time spent in the steps of each member.
    loops : list of tuple
        Each algebraic loop, and what solves it.
    memories : list of Memory
        Saved states: of loops, and of steps that can be taken back.
    """

    def __init__(
        self, members: Sequence[Instance], structure: Structure, connections: Sequence[Connection],
        columns: Mapping[Port, list[float]], settings: Settings, clock: Clock,
    ):  # fmt: skip
        self.members, self.structure, self.settings, self.clock = members, structure, settings, clock
        self._by_name = {member.name: member for member in members}
        self._columns = columns
        names = [member.name for member in members]
        self._everyone = plan(structure, names)
        self.order = order(structure)
        self.board, self.feed = self._boards()
        for port, place in self.feed.at.items():
            self.feed.cells[place] = self._by_name[port.member].start(port.variable)
        self.wires = {
            c.target: Wire(self.feed.at[c.target], self.board.at[c.source], c.factor, c.offset) for c in connections
        }
        self.slow = {name: 1 / rate for name, rate in settings.rates.items() if rate < 1}
        self.loops: list[tuple[Loop, FixedPoint]] = []
        self.memories: list[Memory] = []
        self.seconds = [0.0] * len(members)
        self._pasts: dict[str, Past] = {}
        self._programs: dict[frozenset[str], Program] = {}
        self.everyone = self.program(frozenset(names))

    def _boards(self) -> tuple[Board, Board]:
        """Places such that what is moved in one call stands together."""
        outputs = {name: list(self._everyone.early[name]) for name in self._by_name}
        inputs: dict[str, list[Port]] = {name: [] for name in self._by_name}
        for operation in self._everyone.operations:
            if isinstance(operation, Loop):
                read, written = operation.outputs, operation.inputs
            else:
                read, written = (operation.ports, ()) if isinstance(operation, Read) else ((), operation.ports)
            for port in read:
                outputs[port.member].append(port)
            for port in written:
                inputs[port.member].append(port)
        return Board(chain(*outputs.values())), Board(chain(*inputs.values()))

    # --- preparation ------------------------------------------------------------------------------------------------

    def due(self, k: int, last: int) -> frozenset[str]:
        """Names of the members that take part in the exchange at point `k`, and in the step that ends there."""
        return frozenset(
            name for name in self._by_name if name not in self.slow or k == last or k % int(self.slow[name]) == 0
        )

    def changes(self, points: int) -> list[bool]:
        """For each communication point whether a value from outside differs from that before."""
        rows = np.array(list(self._columns.values()))
        return [True, *(np.diff(rows) != 0.0).any(axis=0).tolist()] if rows.size else [False] * points

    def program(self, due: frozenset[str]) -> Program:
        """What to do when these members take part."""
        if due not in self._programs:
            self._programs[due] = self._program(due)
        return self._programs[due]

    def _program(self, due: frozenset[str]) -> Program:
        found = self._everyone if len(due) == len(self.members) else plan(self.structure, due)
        program = Program(found, [], [], [])
        stepped: set[str] = set()
        for name in [name for name in self.order if name in due]:
            self._add_step(program, self._by_name[name], stepped)
            stepped.add(name)
        for operation in found.operations:
            if isinstance(operation, Loop):
                self._add_loop(program, operation)
                continue
            member = self._by_name[operation.member]
            if not isinstance(operation, Read):
                program.stations.append(self._station(operation.ports))
            elif not program.stations:
                program.stations.append(self._station(()))
            verb = "Get" if isinstance(operation, Read) else "Set"
            program.stations[-1].actions.extend(self._moving(verb, member, operation.ports))
        return program

    def _moving(self, verb: str, member: Instance, ports: Sequence[Port]) -> list[Action]:
        doing = ("setting " if verb == "Set" else "reading ") + listed(ports)
        board = self.feed if verb == "Set" else self.board
        return [Action(call, member, doing) for call in bind(verb, member.fmu, ports, board)]

    def _station(self, ports: Sequence[Port]) -> Station:
        wires = [self.wires[port] for port in ports if port in self.wires]
        return Station(
            [(w.target, w.source) for w in wires if (w.factor, w.offset) == (1.0, 0.0)],
            [w for w in wires if (w.factor, w.offset) != (1.0, 0.0)],
            [(self.feed.at[port], self._columns[port]) for port in ports if port in self._columns],
            [],
        )

    def _add_step(self, program: Program, member: Instance, stepped: set[str]) -> None:
        settings, actions = self.settings, list[Action]()
        connected = [port for port in self.structure.fed[member.name] if port in self.wires]
        fresh = [port for port in connected if settings.sequential and self.structure.sources[port].member in stepped]
        real = [port for port in connected if type_of(member.fmu.variables[port.variable]) == "real"]
        linear = real if settings.extrapolation else []
        parts = max(1, int(settings.rates.get(member.name, 1)))
        early = program.plan.early[member.name]
        reads = list(early)
        if settings.sequential:  # those who step later use outputs that depend on inputs too
            following = set(self.order) - stepped - {member.name}
            used = {
                self.structure.sources[port]
                for name in following
                for port in self.structure.fed[name]
                if port in self.wires
            }
            reads = [port for port in self.structure.wanted[member.name] if port in early or port in used]
        slow = member.name in self.slow
        if abrupt := [port for port in fresh if port not in linear]:
            actions.append(Action(self._refresh(member, abrupt), member, STEP))
        if linear or parts > 1 or slow:
            gliding = [self.wires[port] for port in fresh if port in linear]
            settle = not settings.feedthrough or len(reads) > len(early)
            past = self._pasts.setdefault(member.name, Past(self.clock.start, [0.0] * len(linear)))
            move = Move(
                member, self.clock, self.feed, self.board, linear, gliding,
                parts, slow, settle, settings.adaptive, past,
            )  # fmt: skip
            actions.append(Action(move, member, STEP))
            if linear or slow:
                program.moves.append(move)
        else:
            step = member.stepper(self.clock.now, self.clock.size, settings.adaptive)
            actions.append(Action(step, member, STEP))
        program.steps.append((self.members.index(member), actions + self._moving("Get", member, reads)))

    def _refresh(self, member: Instance, ports: Sequence[Port]) -> Call:
        """Give a member, before its step, what others have delivered by theirs."""
        station = self._station(ports)
        station.actions.extend(self._moving("Set", member, ports))

        def refresh() -> int:
            self.exchange([station], 0)
            return 0

        return refresh

    def _add_loop(self, program: Program, loop: Loop) -> None:
        feed, board = self.feed, self.board
        targets = np.array([feed.at[port] for port in loop.inputs])
        wires = [self.wires[port] for port in loop.inputs]
        sources = np.array([wire.source for wire in wires])
        factors, offsets = np.array([wire.factor for wire in wires]), np.array([wire.offset for wire in wires])
        members = [m for m in self.members if any(port.member == m.name for port in loop.outputs)]
        actions = []
        for verb, ports in (("Set", loop.inputs), ("Get", loop.outputs)):
            for member in members:
                actions += self._moving(verb, member, [port for port in ports if port.member == member.name])
        memory = Memory(members, self.clock)

        def around(v: Array) -> Array:
            memory.restore()
            feed.values[targets] = v
            self._act(actions)
            returned: Array = factors * board.values[sources] + offsets
            return returned

        kinds = {type_of(self._by_name[port.member].fmu.variables[port.variable]) for port in loop.inputs}
        nominal = np.array([self._by_name[port.member].nominal(port.variable) for port in loop.inputs])
        fixed_point = FixedPoint(around, nominal, kinds == {"real"})

        def solve() -> int:
            memory.save()
            try:
                fixed_point.solve(feed.values[targets])
            except UserError as error:
                raise UserError(f"{describe(loop)}, at {self.clock.end:.10g} s: {error}") from error
            return 0

        program.stations.append(Station([], [], [], [Action(solve, members[0], "solving")]))
        self.loops.append((loop, fixed_point))
        self.memories.append(memory)

    # --- at work ----------------------------------------------------------------------------------------------------

    def step(self, program: Program, start: float, end: float) -> None:
        """Take the members over a step; what does not need the inputs at its end is read.

        Raises
        ------
        UserError
            If a member fails.
        """
        self.clock.set(start, end)
        seconds = self.seconds
        program.count += 1
        then = perf_counter()
        for number, actions in program.steps:
            for call, member, doing in actions:
                status = call()
                if status:
                    member.judge(status, doing, self.clock)
            now = perf_counter()
            seconds[number] += now - then
            then = now

    def read_early(self) -> None:
        """Read what needs no inputs, as after a step."""
        self._act([action for _, actions in self.everyone.steps for action in actions if action.doing != STEP])

    def exchange(self, stations: Sequence[Station], k: int) -> None:
        """Set inputs and read outputs, with the values from outside of communication point `k`.

        Raises
        ------
        UserError
            If a member fails, gives something that is no number to another, or a loop cannot be solved.
        """
        feed, board = self.feed.cells, self.board.cells
        for copies, wires, columns, actions in stations:
            for target, source in copies:
                value = board[source]
                if value - value:  # not a number, or infinite
                    self._not_finite(source)
                feed[target] = value
            for target, source, factor, offset in wires:
                value = factor * board[source] + offset
                if value - value:
                    self._not_finite(source)
                feed[target] = value
            for target, column in columns:
                feed[target] = column[k]
            for call, member, doing in actions:
                status = call()
                if status:
                    member.judge(status, doing, self.clock)

    def learn(self, program: Program) -> None:
        """Let those who extrapolate see where their inputs went."""
        for move in program.moves:
            move.learn()

    def _act(self, actions: Sequence[Action]) -> None:
        for call, member, doing in actions:
            if status := call():
                member.judge(status, doing, self.clock)

    def _not_finite(self, place: int) -> NoReturn:
        port, value = list(self.board.at)[place], self.board.cells[place]
        raise UserError(f"{port.member}: its output {port.variable} is {value:g} at {self.clock.end:.10g} s")

    # --- afterwards -------------------------------------------------------------------------------------------------

    def steps_of(self, member: Instance) -> int:
        """How many steps a member made."""
        made = sum(program.count for due, program in self._programs.items() if member.name in due)
        return made * max(1, int(self.settings.rates.get(member.name, 1)))
