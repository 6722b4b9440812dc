"""Fused systems: the laws of all members as one flat model, without communication steps between them.

A connected input is replaced by the expression it is connected to, down to states and inputs of the system. The result
is a graph like that of a single component, and everything made of a graph can be made of a system: a simulation
in compiled C, exact sensitivities, a linearisation. Its trajectories are those to which co-simulation tends as the
communication step goes to zero.

Sample instants that coincide are taken in the order of the members, and a later member sees the new values of an
earlier one, as the groups within a component do. That is the limit of Gauss-Seidel with members that step in this
order, for the later one receives what the earlier one made of the step. With Jacobi nobody sees a new value before the
next communication point, however near it is: where members look at each other at one instant, its limit is another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from typing import Any

import casadi as ca

from fmus.kit.declare import (
    Declaration,
    DiscreteDeclaration,
    InputDeclaration,
    ParameterDeclaration,
    named,
    starting,
)
from fmus.kit.errors import UserError
from fmus.kit.layout import Layout
from fmus.kit.symbolic.trace import Graph, trace
from orchestration.system.check import check
from orchestration.system.model import Member, System


def fuse(system: System) -> Graph:
    """Flatten a system of our own components into one model.

    Parameters
    ----------
    system : System

    Returns
    -------
    Graph
        Variables are named ``member.variable``, inputs of the system as they are named there. Parameters and inputs
        have the values of the members as defaults; an input that nothing is connected to stays an input. The
        tolerance is the smallest of the members'.

    Raises
    ------
    UserError
        If the system makes no sense, a member is a foreign FMU, or there is an algebraic loop.
    """
    check(system)
    parts = [_part(system, member) for member in system.members]
    layout = Layout(
        *(
            tuple(v for part in parts for v in getattr(part.layout, group))
            for group in ("parameters", "inputs", "states", "discretes", "outputs")
        )
    )
    symbols = {v.name: s for part in parts for v, s in _values(part.layout.inputs, part.inputs)}
    values = {
        v.name: value
        for part in parts
        for group, vector in (
            ("states", part.states),
            ("discretes", part.discretes),
            ("outputs", part.outputs),
        )
        for v, value in _values(getattr(part.layout, group), vector)
    }
    outer = {name: ca.SX.sym(name) for name in system.inputs}
    given = {str(port): outer[name] for name, ports in system.inputs.items() for port in ports}
    given |= {
        str(c.target): c.factor * values[str(c.source)] + c.offset for c in system.connections
    }

    def joined(vectors: Sequence[ca.SX]) -> ca.SX:
        return ca.vertcat(ca.SX(0, 1), *vectors)

    updates = [
        joined([update if part is sampled else part.discretes for part in parts])
        for sampled in parts
        for update in sampled.updates
    ]
    expressions = [
        joined([part.rates for part in parts]),
        joined([part.outputs for part in parts]),
        *updates,
    ]
    order = _order(system, symbols, given)
    time = ca.SX.sym("time")
    _, flat = ca.substitute_inplace(
        [*(part.time for part in parts), *(symbols[name] for name in order)],
        [*(time for _ in parts), *(given[name] for name in order)],
        expressions,
    )
    declared = {v.name: v for v in layout.inputs}
    inputs = {
        name: named(replace(declared[str(ports[0])]) if ports else InputDeclaration(unit="1"), name)
        for name, ports in system.inputs.items()
    }
    inputs |= {name: v for name, v in declared.items() if name not in given}
    return Graph(
        name=system.name,
        tolerance=min(part.tolerance for part in parts),
        layout=replace(layout, inputs=tuple(inputs.values())),
        time=time,
        parameters=joined([part.parameters for part in parts]),
        inputs=joined([(outer | symbols)[name] for name in inputs]),
        states=joined([part.states for part in parts]),
        discretes=joined([part.discretes for part in parts]),
        rates=flat[0],
        outputs=flat[1],
        updates=tuple(flat[2:]),
    )


def _values(group: Sequence[Declaration], vector: ca.SX) -> list[tuple[Declaration, ca.SX]]:
    return [(v, vector[i]) for i, v in enumerate(group)]


def _part(system: System, member: Member) -> Graph:
    """Trace a member, its variables under their names in the system and with the values it has there."""
    if member.cls is None:
        raise UserError(
            f"system {system.name}: {member.name} ({member.fmu.name}) cannot be fused, for only its binary is known: "
            "the laws must be those of a component of this project"
        )
    graph = trace(member.cls)

    def own(v: Any) -> Any:
        start = {"start": member.parameters[v.name]} if v.name in member.parameters else {}
        renamed = named(replace(v, **start), f"{member.name}.{v.name}")
        return (
            starting(renamed, f"{member.name}.{state}")
            if (state := getattr(v, "starts", None))
            else renamed
        )

    layout = graph.layout
    # literal periods become parameters: members that happen to have the same one are not sampled as one group
    names = {
        d.period: d.period if isinstance(d.period, str) else f"period({d.period})"
        for d in layout.discretes
    }
    literal = {name: period for period, name in names.items() if not isinstance(period, str)}
    about = f"a sample period of {member.name}"

    def sampled(d: DiscreteDeclaration) -> DiscreteDeclaration:
        return named(
            replace(own(d), period=f"{member.name}.{names[d.period]}"), f"{member.name}.{d.name}"
        )

    return replace(
        graph,
        layout=Layout(
            parameters=(
                *map(own, layout.parameters),
                *(
                    own(named(ParameterDeclaration(start=p, unit="s", doc=about), name))
                    for name, p in literal.items()
                ),
            ),
            inputs=tuple(map(own, layout.inputs)),
            states=tuple(map(own, layout.states)),
            discretes=tuple(map(sampled, layout.discretes)),
            outputs=tuple(map(own, layout.outputs)),
        ),
        parameters=ca.vertcat(graph.parameters, ca.SX.sym("period", len(literal))),
    )


def _order(system: System, symbols: Mapping[str, ca.SX], given: Mapping[str, ca.SX]) -> list[str]:
    """Connected inputs, each after those that what it receives depends on."""
    by_symbol = {symbols[name].element_hash(): name for name in given}
    needed = {
        name: [
            by_symbol[s.element_hash()]
            for s in ca.symvar(expression)
            if s.element_hash() in by_symbol
        ]
        for name, expression in given.items()
    }
    try:
        return list(TopologicalSorter(needed).static_order())
    except CycleError as error:
        loop = error.args[1]
        raise UserError(
            f"system {system.name}: an algebraic loop cannot be fused: {' -> '.join(loop)}"
        ) from None
