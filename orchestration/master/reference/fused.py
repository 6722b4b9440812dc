"""Fused systems: the laws of all members as one flat model without communication steps.

A connected input is replaced by the expression it is connected to, down to states and inputs of the
system. The result is a graph like that of a single component, and everything made of a graph can be
made of a system: a simulation in compiled C, exact sensitivities, a linearisation. Its trajectories
are those to which co-simulation tends as the communication step goes to zero.

Sample instants that coincide are taken in the order of the members, and a later member sees the new
values of an earlier one, as the groups within a component do. That is the limit of Gauss-Seidel
with members that step in this order, for the later one receives the result of the earlier one for
the step. With Jacobi nobody sees a new value before the next communication point, however near it
is: where members sample each other at one instant, its limit is another.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from graphlib import CycleError, TopologicalSorter
from typing import Any

import casadi as ca

from fmus.kit import UserError
from fmus.kit.declare import (
    Declaration,
    DiscreteDeclaration,
    InputDeclaration,
    ParameterDeclaration,
    make_start_parameter,
    name_declaration,
)
from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import Layout
from fmus.kit.symbolic import Graph, trace
from orchestration.system import Member, System, check


@uninterrupted()
def fuse(system: System) -> Graph:
    """Flatten a system of components of this project into one model.

    Parameters
    ----------
    system : System

    Returns
    -------
    Graph
        Variables are named ``member.variable``, inputs of the system as they are named there.
        Parameters and inputs have the values of the members as defaults; an input that nothing is
        connected to stays an input. The tolerance is the smallest of the members'.

    Raises
    ------
    UserError
        If the system does not pass its check, a member is a foreign FMU, or there is an algebraic
        loop.
    """
    check(system)
    parts = [_trace_member(system, member) for member in system.members]
    layout = _join_layouts(parts)
    symbols = {v.name: s for part in parts for v, s in _pairs(part.layout.inputs, part.inputs)}
    system_inputs = {name: ca.SX.sym(name) for name in system.inputs}
    received = _received_expressions(system, parts, system_inputs)
    order = _order_inputs(system, symbols, received)
    time = ca.SX.sym("time")
    # without the symbols of connected inputs, so that all depends on states and system inputs only
    _, (rates, outputs, *updates) = ca.substitute_inplace(
        [*(part.time for part in parts), *(symbols[name] for name in order)],
        [*(time for _ in parts), *(received[name] for name in order)],
        [
            _join(part.rates for part in parts),
            _join(part.outputs for part in parts),
            *_join_updates(parts),
        ],
    )
    inputs = _fused_inputs(system, layout, received)
    return Graph(
        name=system.name,
        tolerance=min(part.tolerance for part in parts),
        layout=replace(layout, inputs=tuple(inputs.values())),
        time=time,
        parameters=_join(part.parameters for part in parts),
        inputs=_join((system_inputs | symbols)[name] for name in inputs),
        states=_join(part.states for part in parts),
        discretes=_join(part.discretes for part in parts),
        rates=rates,
        outputs=outputs,
        updates=tuple(updates),
    )


def _join(vectors: Iterable[ca.SX]) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *vectors)


def _pairs(group: Sequence[Declaration], vector: ca.SX) -> list[tuple[Declaration, ca.SX]]:
    """Return the declarations of variables with their symbols or expressions."""
    return [(v, vector[i]) for i, v in enumerate(group)]


def _join_layouts(parts: Sequence[Graph]) -> Layout:
    groups = ("parameters", "inputs", "states", "discretes", "outputs")
    return Layout(
        *(tuple(v for part in parts for v in getattr(part.layout, group)) for group in groups)
    )


def _join_updates(parts: Sequence[Graph]) -> list[ca.SX]:
    """Return the discrete states of the system after each sample of each member."""
    return [
        _join([update if part is sampled else part.discretes for part in parts])
        for sampled in parts
        for update in sampled.updates
    ]


def _received_expressions(
    system: System, parts: Sequence[Graph], system_inputs: Mapping[str, ca.SX]
) -> dict[str, ca.SX]:
    """Return the expression that each connected input receives, by ``member.variable``."""
    values: dict[str, ca.SX] = {}
    for part in parts:
        for group, vector in (
            (part.layout.states, part.states),
            (part.layout.discretes, part.discretes),
            (part.layout.outputs, part.outputs),
        ):
            values |= {v.name: value for v, value in _pairs(group, vector)}
    received = {str(port): system_inputs[name] for name, port in system.fed_ports}
    return received | {
        str(c.target): c.factor * values[str(c.source)] + c.offset for c in system.connections
    }


def _fused_inputs(
    system: System, layout: Layout, received: Mapping[str, ca.SX]
) -> dict[str, InputDeclaration]:
    """Return the inputs of the fused model by name: those of the system, and unconnected ones.

    An input of the system is declared like the first input of a member that it feeds.
    """
    declared = {v.name: v for v in layout.inputs}
    inputs = {}
    for name, ports in system.inputs.items():
        # a copy, as a declaration is named in place
        copy = replace(declared[str(ports[0])]) if ports else InputDeclaration(unit="1")
        inputs[name] = name_declaration(copy, name)
    unconnected = {name: v for name, v in declared.items() if name not in received}
    return inputs | unconnected


def _trace_member(system: System, member: Member) -> Graph:
    """Return the graph of a member, with the names and values of its variables in the system."""
    if member.cls is None:
        raise UserError(
            f"system {system.name}: {member.name} ({member.fmu.name}) cannot be fused, for only its"
            " binary is known: the laws must be those of a component of this project as it is here"
        )
    graph = trace(member.cls)
    layout = graph.layout
    # Literal periods become parameters: discrete states of one period are sampled as one group,
    # also those of different members.
    period_names = {
        d.period: d.period if isinstance(d.period, str) else f"period({d.period})"
        for d in layout.discretes
    }
    literal = {name: period for period, name in period_names.items() if not isinstance(period, str)}

    rename = partial(_rename, member=member)

    def rename_discrete(discrete: DiscreteDeclaration) -> DiscreteDeclaration:
        period = f"{member.name}.{period_names[discrete.period]}"
        shift = tuple(f"{member.name}.{name}" for name in discrete.shift)
        renamed = replace(rename(discrete), period=period, shift=shift)
        return name_declaration(renamed, f"{member.name}.{discrete.name}")

    def period_parameter(name: str, period: Any) -> ParameterDeclaration:
        doc = f"a sample period of {member.name}"
        return name_declaration(ParameterDeclaration(start=period, unit="s", doc=doc), name)

    periods = [rename(period_parameter(name, period)) for name, period in literal.items()]
    return replace(
        graph,
        layout=Layout(
            parameters=(*map(rename, layout.parameters), *periods),
            inputs=tuple(map(rename, layout.inputs)),
            states=tuple(map(rename, layout.states)),
            discretes=tuple(map(rename_discrete, layout.discretes)),
            outputs=tuple(map(rename, layout.outputs)),
        ),
        parameters=ca.vertcat(graph.parameters, ca.SX.sym("period", len(literal))),
    )


def _rename(variable: Any, member: Member) -> Any:
    """Return a copy of a declaration, with its name and its value in the system."""
    if variable.name in member.parameters:
        copy = replace(variable, start=member.parameters[variable.name])
    else:
        copy = replace(variable)
    renamed = name_declaration(copy, f"{member.name}.{variable.name}")
    state = getattr(variable, "starts", None)  # of a parameter, the state whose start value it is
    return make_start_parameter(renamed, f"{member.name}.{state}") if state else renamed


def _order_inputs(
    system: System, symbols: Mapping[str, ca.SX], received: Mapping[str, ca.SX]
) -> list[str]:
    """Return the connected inputs in an order in which each depends on earlier ones only."""
    by_symbol = {symbols[name].element_hash(): name for name in received}
    needed = {
        name: [
            by_symbol[s.element_hash()]
            for s in ca.symvar(expression)
            if s.element_hash() in by_symbol
        ]
        for name, expression in received.items()
    }
    try:
        return list(TopologicalSorter(needed).static_order())
    except CycleError as error:
        loop = error.args[1]
        raise UserError(
            f"system {system.name}: an algebraic loop cannot be fused: {' -> '.join(loop)}"
        ) from None
