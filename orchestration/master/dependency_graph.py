"""In which order values are exchanged at a communication point, and members step: the graph of who feeds whom.

An output that depends on inputs can be read only when they have their values; ModelStructure says which do. Where
outputs wait for each other there is an algebraic loop.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

from fmus.kit.errors import UserError
from orchestration.system.model import Port

Node = TypeVar("Node", bound=Hashable)


class Write(NamedTuple):
    """Give a member inputs that all have their values."""

    member: str
    ports: tuple[Port, ...]


class Read(NamedTuple):
    """Ask a member for outputs."""

    member: str
    ports: tuple[Port, ...]


class Loop(NamedTuple):
    """Find the inputs and outputs of an algebraic loop, which determine each other."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]


Operation = Write | Read | Loop


@dataclass(frozen=True)
class Structure:
    """What is known of a system before anything runs.

    Attributes
    ----------
    sources : Mapping of Port to Port
        Connected inputs, and the output that each receives.
    fed : Mapping of str to list of Port
        For each member the inputs that receive something, from an output or from outside.
    wanted : Mapping of str to list of Port
        For each member the variables that are read.
    feedthrough : Mapping of Port to tuple of Port
        For each variable that is read the inputs, of those that are fed, on which it depends at once.
    assumed : Collection of Port
        Outputs whose FMU does not say on which inputs they depend: on all.
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
class Plan:
    """Order of exchange.

    Attributes
    ----------
    early : dict of str to tuple of Port
        What is read of each member right after its step, before it gets new inputs.
    operations : list of Write, Read and Loop
        What is done then, at the communication point.
    at_step_end : list of Port
        Outputs that are taken as they stand at the end of a step, though they may depend on inputs; see `plan`.
    """

    early: dict[str, tuple[Port, ...]] = field(default_factory=dict)
    operations: list[Operation] = field(default_factory=list)
    at_step_end: list[Port] = field(default_factory=list)

    @property
    def loops(self) -> list[Loop]:
        """The algebraic loops."""
        return [operation for operation in self.operations if isinstance(operation, Loop)]


def plan(structure: Structure, members: Collection[str]) -> Plan:
    """Order the exchange among members; what the others deliver stays as it was.

    An algebraic loop is solved by going back to a saved state. If one of its members cannot, but has nowhere said that
    its outputs depend on its inputs, they are taken as they stand at the end of its step.

    Parameters
    ----------
    structure : Structure
    members : collection of str

    Returns
    -------
    Plan

    Raises
    ------
    UserError
        If there is an algebraic loop with a member that depends on its inputs for sure and cannot restore its state.
    """
    feedthrough = {
        port: needed for port, needed in structure.feedthrough.items() if port.member in members
    }
    at_step_end: list[Port] = []
    while True:
        attempt = _attempt(structure, members, feedthrough)
        for loop in attempt.loops:
            stuck = [port for port in loop.outputs if port.member in structure.stateless]
            given_up = [port for port in stuck if port in structure.assumed]
            if given_up:
                at_step_end += given_up
                feedthrough |= dict.fromkeys(given_up, ())
                break
            if stuck:
                raise UserError(
                    f"{describe(loop)}: {stuck[0].member} cannot restore its state (canGetAndSetFMUstate is false), so "
                    "that it cannot be solved; without feedthrough every output is taken as it stands after a step"
                )
        else:
            attempt.at_step_end = at_step_end
            return attempt


def _attempt(
    structure: Structure, members: Collection[str], feedthrough: Mapping[Port, tuple[Port, ...]]
) -> Plan:
    ordered, sources, connected = Plan(), structure.sources, set(structure.sources.values())
    known: set[Port] = set()
    late: dict[str, list[Port]] = {}
    for member, wanted in structure.wanted.items():
        if member not in members:
            known.update(wanted)
            continue
        independent = [port for port in wanted if not feedthrough[port]]
        if len(independent) < len(
            wanted
        ):  # what nobody waits for is read with the others, in one call
            independent = [port for port in independent if port in connected]
        late[member] = [port for port in wanted if port not in independent]
        ordered.early[member] = tuple(independent)
        known.update(independent)
    unset = {
        member: list(structure.fed[member]) for member in structure.wanted if member in members
    }

    def write(member: str) -> None:
        ports = tuple(
            port for port in unset[member] if port not in sources or sources[port] in known
        )
        if ports:
            ordered.operations.append(Write(member, ports))
            unset[member] = [port for port in unset[member] if port not in ports]

    def waits_for(port: Port) -> list[Port]:
        return [sources[i] for i in feedthrough[port] if i in sources and sources[i] not in known]

    def read(member: str, ports: Sequence[Port]) -> None:
        write(member)
        ordered.operations.append(Read(member, tuple(ports)))
        taken(ports)

    def taken(ports: Iterable[Port]) -> None:
        for port in ports:
            known.add(port)
            late[port.member].remove(port)

    while any(late.values()):
        ready = {
            member: [port for port in ports if not waits_for(port)]
            for member, ports in late.items()
        }
        whole = [
            member for member, ports in ready.items() if ports and len(ports) == len(late[member])
        ]
        part = [member for member, ports in ready.items() if not connected.isdisjoint(ports)]
        if whole or part:
            for member in whole or part[:1]:
                read(member, ready[member])
            continue
        outputs = _strongly_connected(
            [port for ports in late.values() for port in ports if port in connected], waits_for
        )
        for member in dict.fromkeys(port.member for port in outputs):
            write(member)
        closing = [i for port in outputs for i in feedthrough[port] if sources.get(i) in outputs]
        inputs = tuple(dict.fromkeys(closing))
        ordered.operations.append(Loop(inputs, tuple(outputs)))
        for port in inputs:
            unset[port.member].remove(port)
        taken(outputs)
    for member in unset:
        write(member)
    return ordered


def _strongly_connected(
    nodes: Collection[Node], before: Callable[[Node], Iterable[Node]]
) -> list[Node]:
    """Nodes, of which each waits for some of them, that wait for each other and for nothing else.

    Where every node waits, the smallest set of all that one waits for, directly or not, is strongly connected.
    """

    def all_before(node: Node) -> dict[Node, None]:
        predecessors: dict[Node, None] = {}
        open_ends = [node]
        while open_ends:
            for other in before(open_ends.pop()):
                if other not in predecessors:
                    predecessors[other] = None
                    open_ends.append(other)
        return predecessors

    smallest = min((all_before(node) for node in nodes), key=len)
    return [node for node in nodes if node in smallest]


def order(structure: Structure) -> list[str]:
    """Members in the order in which they step one after another.

    Who feeds another comes first. Where they feed each other in a circle, next is one that is fed by a member that has
    stepped; among equals, the one that the system names first.
    """
    waiting, result = list(structure.wanted), list[str]()
    feeding = {
        member: {structure.sources[port].member for port in ports if port in structure.sources}
        for member, ports in structure.fed.items()
    }

    def before(member: str) -> list[str]:
        return [other for other in waiting if other in feeding[member]]

    def unfed(member: str) -> bool:
        return feeding[member].isdisjoint(result)

    while waiting:
        free = next((member for member in waiting if not before(member)), None)
        chosen = free if free is not None else min(_strongly_connected(waiting, before), key=unfed)
        result.append(chosen)
        waiting.remove(chosen)
    return result


def describe(loop: Loop) -> str:
    """Name a loop by its ports, each input after the output that feeds it."""
    return "algebraic loop of " + ", ".join(
        str(port) for port in sorted((*loop.inputs, *loop.outputs))
    )
