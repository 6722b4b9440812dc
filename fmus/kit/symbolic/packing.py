"""C sources of a packed system: tables and laws of its members, and the operations of its master.

They are ``members.h``, which the engine ``fmi/packed.c`` includes, and the tables of the whole,
whose parameters, inputs and outputs are those of the system.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

import casadi as ca

from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import Layout
from fmus.kit.symbolic.codegen import (
    c_double,
    c_string,
    laws,
    tables,
    variable_tables,
    work_sizes,
)
from fmus.kit.symbolic.tracing import Graph


class Operation(NamedTuple):
    """An operation of ``fmi/packed.c``.

    Attributes
    ----------
    action : {"COPY", "MAP", "EVALUATE", "STEP", "SOLVE"}
    which : int
        Member or loop.
    target, source : str
        Places in the memory of an instance, in C; see `Places`.
    factor, offset : float
        Of a copy; of a mapping the value of the source and that of the target.
    """

    action: str
    which: int = 0
    target: str = "0"
    source: str = "0"
    factor: float = 1.0
    offset: float = 0.0


class Loop(NamedTuple):
    """An algebraic loop.

    Attributes
    ----------
    name : str
        For messages.
    links : list of Operation
        The copy that each input of the loop receives.
    around : list of Operation
        What is done between the inputs and the sources of the links.
    scale : list of float
        Nominal values of the inputs.
    """

    name: str
    links: list[Operation]
    around: list[Operation]
    scale: list[float]


@dataclass(frozen=True)
class Program:
    """The work of a system's master, as operations.

    Attributes
    ----------
    parameters, readings, steps, exchange : list of Operation
        The parameters of members set; outputs read before the first exchange; the steps of all
        members from one communication point to the next; the exchange at a point.
    loops : list of Loop
    """

    parameters: list[Operation]
    readings: list[Operation]
    steps: list[Operation]
    exchange: list[Operation]
    loops: list[Loop]


class Places:
    """The places of variables in the memory of an instance, in C.

    Parameters
    ----------
    members : sequence of Graph
    read : int
        Number of outputs that are read.
    """

    def __init__(self, members: Sequence[Graph], read: int):
        sizes = [_memory_size(graph.layout) for graph in members]
        self._first = list(accumulate(sizes, initial=0))
        self._index = [{name: i for i, name in enumerate(g.layout.names)} for g in members]
        self.size = self._first[-1] + read

    def member(self, number: int) -> str:
        """Return the place where the memory of a member begins."""
        return _place(self._first[number])

    def variable(self, number: int, name: str) -> str:
        """Return the place of a variable of a member."""
        return _place(self._first[number] + self._index[number][name])

    def read(self, number: int) -> str:
        """Return the place of an output that was read, by its number."""
        return _place(self._first[-1] + number)


def _place(number: int) -> str:
    return f"MEMBERS_BEGIN + {number}"


def _memory_size(layout: Layout) -> int:
    """Return the size of the memory of a member (``fmi/engine.h``)."""
    beside = 4  # step to try, start time, tolerance, whether parameters have changed
    return len(layout.names) + beside + len(layout.sampled) + len(layout.inputs)


@dataclass(frozen=True)
class PackedSystem:
    """A system as one model.

    Attributes
    ----------
    graph : Graph
        The whole, without states. Its first parameter is the communication step; its outputs have
        the dependencies of those of the system, not the values.
    members : Mapping of str to Graph
        By name in the system; the same graph for members of one class.
    places : Places
    program : Program
    """

    graph: Graph
    members: Mapping[str, Graph]
    places: Places
    program: Program


@uninterrupted()
def packed_sources(packed: PackedSystem, guid: str) -> dict[str, str]:
    """Write every generated file of a packed system.

    Parameters
    ----------
    packed : PackedSystem
    guid : str

    Returns
    -------
    dict of str to str
        ``model.h``, ``tables.h`` and ``members.h``.
    """
    members, places, program = packed.members, packed.places, packed.program
    files = tables(packed.graph, guid)
    # two flags and the inputs of the latest exchange come before the members
    size = places.size + len(packed.graph.layout.inputs) + 2
    files["model.h"] += f"#define MODEL_INDICATORS 0\n#define MODEL_MEMBERS {size}\n#endif\n"
    distinct = list({id(graph): graph for graph in members.values()}.values())
    functions = [one.functions(False, f"laws_{k}_") for k, one in enumerate(distinct)]
    lines = [
        f"enum {{ MEMBERS = {len(members)}, COMMUNICATION_STEP = FIRST_PARAMETER }};",
        laws([function for of_one in functions for function in of_one], checked=False),
    ]
    for k, one in enumerate(distinct):
        lines += _model_lines(k, one, functions[k])
    lines.append("static const Part parts[] = {")
    for k, (name, one) in enumerate(members.items()):
        place, tolerance = places.member(k), c_double(one.tolerance)
        model = next(i for i, other in enumerate(distinct) if other is one)
        lines.append(f"    {{{c_string(name)}, &laws_{model}_model, {place}, {tolerance}}},")
    lines += ["};", *_loop_lines(program.loops)]
    lines += _operations("parameters_of_members", program.parameters)
    lines += _operations("readings_at_start", program.readings)
    lines += _operations("steps_of_members", program.steps)
    lines += _operations("exchange", program.exchange)
    return files | {"members.h": "\n".join(lines) + "\n"}


def _model_lines(number: int, graph: Graph, functions: list[ca.Function]) -> list[str]:
    """Write the tables of a member and its model."""
    prefix = f"laws_{number}"
    updates = [f"{prefix}_update_{i}" for i in range(len(graph.updates))]
    layout = graph.layout
    groups = (layout.parameters, layout.inputs, layout.states, layout.discretes, layout.outputs)
    counts = [*map(len, (*groups, layout.sampled)), *work_sizes(functions).values()]
    return [
        *variable_tables(layout, prefix),
        f"static Law *const {prefix}_updates[] = {{{', '.join([*updates, 'NULL'])}}};",
        f"MEMBER_MODEL({prefix}, {', '.join(map(str, counts))});",
    ]


def _loop_lines(loops: Sequence[Loop]) -> list[str]:
    """Write the table of algebraic loops; C has no empty arrays."""
    lines: list[str] = []
    rows = ['    {"", 0, NULL, NULL, NULL},'] if not loops else []
    for k, loop in enumerate(loops):
        lines += _operations(f"links_{k}", loop.links) + _operations(f"around_{k}", loop.around)
        lines.append(
            f"static const double scale_{k}[] = {{{', '.join(map(c_double, loop.scale))}}};"
        )
        of_loop = f"{len(loop.links)}, links_{k}, around_{k}, scale_{k}"
        rows.append(f"    {{{c_string(loop.name)}, {of_loop}}},")
    largest = max((len(loop.links) for loop in loops), default=1)
    return [
        *lines,
        f"enum {{ LARGEST_LOOP = {largest} }};",
        "static const Loop loops[] = {",
        *rows,
        "};",
    ]


def _operations(name: str, operations: Iterable[Operation]) -> list[str]:
    """Write a list of operations."""
    rows = [
        f"    {{{o.action}, {o.which}, {o.target}, {o.source}, {c_double(o.factor)},"
        f" {c_double(o.offset)}}},"
        for o in operations
    ]
    return [
        f"static const Operation {name}[] = {{",
        *rows,
        "    {END, 0, 0, 0, 0.0, 0.0},",
        "};",
    ]
