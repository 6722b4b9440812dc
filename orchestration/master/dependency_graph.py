"""The dependency graph of a system: the order in which values are exchanged and members step.

An output that depends on inputs can be read only when they have their values; ModelStructure says
which do. Where outputs wait for each other there is an algebraic loop.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

from fmus.kit import UserError
from orchestration.system import Port

Node = TypeVar("Node", bound=Hashable)


class Write(NamedTuple):
    """An operation that sets inputs of a member, all of which have their values."""

    member: str
    ports: tuple[Port, ...]


class Read(NamedTuple):
    """An operation that reads outputs of a member."""

    member: str
    ports: tuple[Port, ...]


class Loop(NamedTuple):
    """An operation that solves an algebraic loop of inputs and outputs."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]


Operation = Write | Read | Loop


@dataclass(frozen=True)
class Structure:
    """The connections and dependencies of a system, known before anything runs.

    Attributes
    ----------
    sources : Mapping of Port to Port
        The output that each connected input receives.
    fed : Mapping of str to list of Port
        For each member the inputs that receive a value, from an output or from outside.
    wanted : Mapping of str to list of Port
        For each member the variables that are read.
    feedthrough : Mapping of Port to tuple of Port
        For each variable that is read the inputs, of those that are fed, on which it depends
        without delay.
    assumed : Collection of Port
        Outputs that are assumed to depend on all inputs, for their FMU does not say on which.
    stateless : Collection of str
        Members that cannot save and restore their state.
    """

    sources: Mapping[Port, Port]
    fed: Mapping[str, list[Port]]
    wanted: Mapping[str, list[Port]]
    feedthrough: Mapping[Port, tuple[Port, ...]]
    assumed: Collection[Port] = ()
    stateless: Collection[str] = ()


@dataclass
class EvaluationOrder:
    """The order of the exchange of values at a communication point.

    Attributes
    ----------
    early : dict of str to tuple of Port
        For each member the outputs that are read right after its step, before its inputs are set.
    operations : list of Write, Read and Loop
        The operations at the communication point, in their order.
    at_step_end : list of Port
        Outputs that are read at the end of a step, though they may depend on inputs; see
        `order_exchange`.
    """

    early: dict[str, tuple[Port, ...]] = field(default_factory=dict)
    operations: list[Operation] = field(default_factory=list)
    at_step_end: list[Port] = field(default_factory=list)

    @property
    def loops(self) -> list[Loop]:
        """The algebraic loops."""
        return [operation for operation in self.operations if isinstance(operation, Loop)]


def order_exchange(structure: Structure, members: Collection[str]) -> EvaluationOrder:
    """Order the exchange among some members; the outputs of the others do not change.

    An algebraic loop is solved by going back to a saved state. If one of its members cannot do
    that, but does not state that its outputs depend on its inputs, they are read at the end of its
    step.

    Parameters
    ----------
    structure : Structure
    members : collection of str

    Returns
    -------
    EvaluationOrder

    Raises
    ------
    UserError
        If there is an algebraic loop with a member that certainly depends on its inputs and cannot
        restore its state.
    """
    feedthrough = {
        port: needed for port, needed in structure.feedthrough.items() if port.member in members
    }
    at_step_end: list[Port] = []
    while True:
        attempt = _Ordering(structure, members, feedthrough).order()
        ignored = _dependencies_to_ignore(structure, attempt)
        if not ignored:
            attempt.at_step_end = at_step_end
            return attempt
        at_step_end += ignored
        feedthrough |= dict.fromkeys(ignored, ())


def _dependencies_to_ignore(structure: Structure, order: EvaluationOrder) -> list[Port]:
    """Return outputs that are assumed to depend on inputs, and so close a loop without a solution.

    These are the outputs, in the first loop that cannot be solved, of members that cannot restore
    their state. Without such a loop there are none.

    Raises
    ------
    UserError
        If a loop cannot be solved, and its outputs certainly depend on inputs.
    """
    for loop in order.loops:
        stateless = [port for port in loop.outputs if port.member in structure.stateless]
        assumed = [port for port in stateless if port in structure.assumed]
        if assumed:
            return assumed
        if stateless:
            raise UserError(
                f"{describe_loop(loop)}: {stateless[0].member} cannot restore its state"
                " (canGetAndSetFMUstate is false), so that it cannot be solved; without"
                " feedthrough every output is taken as it stands after a step"
            )
    return []


class _Ordering:
    """The making of an evaluation order, operation by operation.

    An output is known once it is read, or solved for in a loop. An input can be set when the output
    that it receives is known, an output read when the inputs on which it depends are set.

    Parameters
    ----------
    structure : Structure
    members : collection of str
    feedthrough : Mapping of Port to tuple of Port
        For each variable that is read the inputs on which it depends without delay.
    """

    def __init__(
        self,
        structure: Structure,
        members: Collection[str],
        feedthrough: Mapping[Port, tuple[Port, ...]],
    ):
        self._sources = structure.sources
        self._connected = set(structure.sources.values())
        self._feedthrough = feedthrough
        self._order = EvaluationOrder()
        self._known: set[Port] = set()
        self._to_read: dict[str, list[Port]] = {}
        self._to_set = {
            member: list(structure.fed[member]) for member in structure.wanted if member in members
        }
        for member, wanted in structure.wanted.items():
            if member in members:
                self._add_member(member, wanted)
            else:
                self._known.update(wanted)

    def _add_member(self, member: str, wanted: Sequence[Port]) -> None:
        """Divide the outputs of a member into those that are read early and those read later."""
        independent = [port for port in wanted if not self._feedthrough[port]]
        # if some are read later, those that no input receives are read with them, in one call
        all_early = len(independent) == len(wanted)
        early = [port for port in independent if all_early or port in self._connected]
        self._to_read[member] = [port for port in wanted if port not in early]
        self._order.early[member] = tuple(early)
        self._known.update(early)

    def order(self) -> EvaluationOrder:
        """Return the order in which all inputs are set and all outputs are read."""
        while any(self._to_read.values()):
            if not self._append_reads():
                self._append_loop()
        for member in self._to_set:
            self._append_write(member)
        return self._order

    def _append_reads(self) -> bool:
        """Append the reading of outputs that are ready; return False if none is.

        A call of an FMU reads several outputs at once. So members all of whose outputs are ready
        are read first. If there are none, one member is read in part that others may wait for.
        """
        ready = {
            member: [port for port in ports if not self._unknown_sources(port)]
            for member, ports in self._to_read.items()
        }
        entirely = [
            member
            for member, ports in ready.items()
            if ports and len(ports) == len(self._to_read[member])
        ]
        partly = [
            member for member, ports in ready.items() if not self._connected.isdisjoint(ports)
        ]
        chosen = entirely or partly[:1]
        for member in chosen:
            self._append_write(member)
            self._order.operations.append(Read(member, tuple(ready[member])))
            self._note_known(ready[member])
        return bool(chosen)

    def _append_loop(self) -> None:
        """Append the solving of an algebraic loop that waits for no output outside of it."""
        unread = [
            port for ports in self._to_read.values() for port in ports if port in self._connected
        ]
        outputs = _strongly_connected(unread, self._unknown_sources)
        for member in dict.fromkeys(port.member for port in outputs):
            self._append_write(member)
        closing = [
            port
            for output in outputs
            for port in self._feedthrough[output]
            if self._sources.get(port) in outputs
        ]
        inputs = tuple(dict.fromkeys(closing))
        self._order.operations.append(Loop(inputs, tuple(outputs)))
        for port in inputs:
            self._to_set[port.member].remove(port)
        self._note_known(outputs)

    def _append_write(self, member: str) -> None:
        """Append the setting of those inputs of a member that are not set yet and can be."""
        ports = tuple(
            port
            for port in self._to_set[member]
            if port not in self._sources or self._sources[port] in self._known
        )
        if ports:
            self._order.operations.append(Write(member, ports))
            self._to_set[member] = [port for port in self._to_set[member] if port not in ports]

    def _unknown_sources(self, port: Port) -> list[Port]:
        """Return the outputs that must be known before this one can be read, and are not."""
        sources = [self._sources[i] for i in self._feedthrough[port] if i in self._sources]
        return [source for source in sources if source not in self._known]

    def _note_known(self, ports: Iterable[Port]) -> None:
        for port in ports:
            self._known.add(port)
            self._to_read[port.member].remove(port)


def _strongly_connected(
    nodes: Collection[Node], before: Callable[[Node], Iterable[Node]]
) -> list[Node]:
    """Return a set of nodes that wait for each other and for no other node.

    Each node must wait for at least one. Of the sets of all nodes that one node waits for, directly
    or not, the smallest is strongly connected.

    Parameters
    ----------
    nodes : collection of Node
    before : callable
        Returns the nodes that a node waits for directly.
    """

    def all_before(node: Node) -> dict[Node, None]:
        predecessors: dict[Node, None] = {}
        to_visit = [node]
        while to_visit:
            for other in before(to_visit.pop()):
                if other not in predecessors:
                    predecessors[other] = None
                    to_visit.append(other)
        return predecessors

    smallest = min((all_before(node) for node in nodes), key=len)
    return [node for node in nodes if node in smallest]


def order_steps(structure: Structure) -> list[str]:
    """Return the members in the order in which they step one after another.

    A member comes after those that feed it. Where members feed each other in a circle, the next is
    one that is fed by a member that has stepped; among equals, the one that the system names first.
    """
    waiting = list(structure.wanted)
    result: list[str] = []
    feeding = {
        member: {structure.sources[port].member for port in ports if port in structure.sources}
        for member, ports in structure.fed.items()
    }

    def waiting_sources(member: str) -> list[str]:
        return [other for other in waiting if other in feeding[member]]

    def is_fed_by_none_that_stepped(member: str) -> bool:
        return feeding[member].isdisjoint(result)

    while waiting:
        chosen = next((member for member in waiting if not waiting_sources(member)), None)
        if chosen is None:
            circle = _strongly_connected(waiting, waiting_sources)
            chosen = min(circle, key=is_fed_by_none_that_stepped)  # False comes first
        result.append(chosen)
        waiting.remove(chosen)
    return result


def describe_loop(loop: Loop) -> str:
    """Return a description of a loop by the names of its ports."""
    return "algebraic loop of " + ", ".join(
        str(port) for port in sorted((*loop.inputs, *loop.outputs))
    )
