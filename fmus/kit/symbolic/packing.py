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


@dataclass(frozen=True)
class FmuMember:
    """A member that is an FMU without equations.

    Attributes
    ----------
    name : str
        Name of its model.
    layout : Layout
        Its variables, of which the outputs are those that the system reads.
    tolerance : float
        Of its integration; 0 where it declares none.
    references : Sequence of int
        Value references of the variables.
    texts : Mapping of int to str
        Parameters that are texts, by value reference.
    identifier, guid : str
        Of its library.
    folder : str
        Folder of its archive, in the resources of the system.
    files : Mapping of str to bytes
        Its archive.
    platforms : Sequence of str
        Those of its binaries.
    needs_execution_tool, varies_step, runs_once : bool
        Capabilities of FMI.
    """

    name: str
    layout: Layout
    tolerance: float
    references: Sequence[int]
    texts: Mapping[int, str]
    identifier: str
    guid: str
    folder: str
    files: Mapping[str, bytes]
    platforms: Sequence[str]
    needs_execution_tool: bool
    varies_step: bool
    runs_once: bool


class Places:
    """The places of variables in the memory of an instance, in C.

    Parameters
    ----------
    members : sequence of Graph or FmuMember
    read : int
        Number of outputs that are read.
    """

    def __init__(self, members: Sequence[Graph | FmuMember], read: int):
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
    members : Mapping of str to Graph or FmuMember
        By name in the system; the same graph for members of one class.
    places : Places
    program : Program
    """

    graph: Graph
    members: Mapping[str, Graph | FmuMember]
    places: Places
    program: Program

    @property
    def fmus(self) -> list[FmuMember]:
        """The members that are FMUs without equations."""
        return [one for one in self.members.values() if isinstance(one, FmuMember)]

    @property
    def files(self) -> dict[str, bytes]:
        """The archives of these members, by path in the archive of the whole."""
        return {
            f"resources/{fmu.folder}/{name}": contents
            for fmu in self.fmus
            for name, contents in fmu.files.items()
        }


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
    functions = [
        one.functions(False, f"laws_{k}_") if isinstance(one, Graph) else []
        for k, one in enumerate(distinct)
    ]
    counts = f"MEMBERS = {len(members)}, FMUS = {len(packed.fmus)}"
    lines = [
        f"enum {{ {counts}, COMMUNICATION_STEP = FIRST_PARAMETER }};",
        laws([function for of_one in functions for function in of_one], checked=False),
    ]
    for k, one in enumerate(distinct):
        lines += _fmu_lines(k, one) if isinstance(one, FmuMember) else []
        lines += _model_lines(k, one, functions[k])
    lines.append("static const Part parts[] = {")
    for k, (name, one) in enumerate(members.items()):
        place, tolerance = places.member(k), c_double(one.tolerance)
        model = next(i for i, other in enumerate(distinct) if other is one)
        fmu = f"&fmu_{model}" if isinstance(one, FmuMember) else "NULL"
        lines.append(f"    {{{c_string(name)}, &laws_{model}_model, {place}, {tolerance}, {fmu}}},")
    lines += ["};", *_loop_lines(program.loops)]
    lines += _operations("parameters_of_members", program.parameters)
    lines += _operations("readings_at_start", program.readings)
    lines += _operations("steps_of_members", program.steps)
    lines += _operations("exchange", program.exchange)
    return files | {"members.h": "\n".join(lines) + "\n"}


def _fmu_lines(number: int, fmu: FmuMember) -> list[str]:
    """Write the tables of a member that is an FMU, and that it has no laws."""
    # C has no empty arrays
    references = ", ".join(f"{reference}u" for reference in fmu.references or [0])
    texts = [f"{{{reference}u, {c_string(text)}}}, " for reference, text in fmu.texts.items()]
    strings = ", ".join(map(c_string, (fmu.folder, fmu.identifier, fmu.guid)))
    return [
        *(f"#define laws_{number}_{law} NULL" for law in ("rates", "outputs")),
        f"static const fmi2ValueReference references_{number}[] = {{{references}}};",
        f"static const FmuText texts_{number}[] = {{{''.join(texts)}{{0u, NULL}}}};",
        f"static const FmuTable fmu_{number} = {{{strings}, {c_double(fmu.tolerance)},"
        f" references_{number}, texts_{number}}};",
    ]


def _model_lines(number: int, member: Graph | FmuMember, functions: list[ca.Function]) -> list[str]:
    """Write the tables of a member and its model."""
    prefix = f"laws_{number}"
    layout = member.layout
    updates = [f"{prefix}_update_{i}" for i in range(len(layout.sampled))]
    sizes = work_sizes(functions).values() if functions else (0, 0, 0, 0)
    counts = [*map(len, (*layout.arguments, layout.outputs, layout.sampled)), *sizes]
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
