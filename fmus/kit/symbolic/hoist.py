"""Hoisting: what depends on parameters only is computed once before a simulation, not at every evaluation of the laws.

The compiler cannot do it, for it does not know that parameters stay as they are between two calls.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca

from fmus.kit.declare import ParameterDeclaration, named
from fmus.kit.symbolic.trace import Graph


def hoist(graph: Graph) -> tuple[Graph, ca.Function]:
    """Make parameters of the largest expressions that depend on parameters only.

    Operations are kept as they are and in their order, so that nothing is rounded differently.

    Parameters
    ----------
    graph : Graph

    Returns
    -------
    Graph
        With additional parameters, last in the list.
    casadi.Function
        Their values, as a column, from the parameters of the original graph.
    """
    laws = ca.Function("laws", graph.arguments, [graph.rates, graph.outputs, *graph.updates])
    results = [ca.SX.ones(laws.sparsity_out(i)) for i in range(laws.n_out())]
    work: list[Any] = [
        None
    ] * laws.sz_w()  # expressions, and whether each depends on parameters only
    hoisted: dict[
        int, tuple[ca.SX, ca.SX]
    ] = {}  # symbol and expression, by the identity of the expression

    def within_a_law(value: ca.SX, fixed: bool) -> ca.SX:
        """Take an operand of what changes: a fixed one, unless it is there already, becomes a parameter."""
        if not fixed or value.is_constant() or value.is_symbolic():
            return value
        return hoisted.setdefault(value.element_hash(), (ca.SX.sym("hoisted"), value))[0]

    for k in range(laws.n_instructions()):
        operation, inputs, outputs = (
            laws.instruction_id(k),
            laws.instruction_input(k),
            laws.instruction_output(k),
        )
        if operation == ca.OP_INPUT:
            argument, element = inputs
            work[outputs[0]] = graph.arguments[argument].nz[element], argument == 1
        elif operation == ca.OP_CONST:
            work[outputs[0]] = ca.SX(laws.instruction_constant(k)), True
        elif operation == ca.OP_OUTPUT:
            result, element = outputs
            results[result].nz[element] = within_a_law(*work[inputs[0]])
        else:
            operands = [work[i] for i in inputs]
            fixed = all(of_parameters for _, of_parameters in operands)
            values = [value if fixed else within_a_law(value, of) for value, of in operands]
            work[outputs[0]] = (
                (ca.SX.unary if len(values) == 1 else ca.SX.binary)(operation, *values),
                fixed,
            )
    declared = [
        named(ParameterDeclaration(start=0.0, unit="1"), f"hoisted {k}")
        for k in range(len(hoisted))
    ]
    symbols, expressions = ([pair[i] for pair in hoisted.values()] for i in (0, 1))
    extended = replace(
        graph,
        layout=replace(graph.layout, parameters=(*graph.layout.parameters, *declared)),
        parameters=ca.vertcat(graph.parameters, *symbols),
        rates=results[0],
        outputs=results[1],
        updates=tuple(results[2:]),
    )
    return extended, ca.Function(
        "hoisted", [graph.parameters], [ca.vertcat(ca.SX(0, 1), *expressions)], {"cse": True}
    )
