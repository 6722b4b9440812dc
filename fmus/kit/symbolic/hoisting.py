"""Hoisting: expressions of parameters only are computed once before a simulation.

The compiler cannot do it, because it does not know that parameters keep their values between two
evaluations of the laws.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca

from fmus.kit.declare import ParameterDeclaration, name_declaration
from fmus.kit.symbolic.tracing import Graph


def hoist(graph: Graph) -> tuple[Graph, ca.Function]:
    """Replace the largest expressions that depend on parameters only by new parameters.

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
    replacing = _Replacing(graph)
    rates, outputs, *updates = replacing.results()
    symbols = [symbol for symbol, _ in replacing.hoisted.values()]
    expressions = [expression for _, expression in replacing.hoisted.values()]
    declared = [
        name_declaration(ParameterDeclaration(start=0.0, unit="1"), f"hoisted {k}")
        for k in range(len(symbols))
    ]
    extended = replace(
        graph,
        layout=replace(graph.layout, parameters=(*graph.layout.parameters, *declared)),
        parameters=ca.vertcat(graph.parameters, *symbols),
        rates=rates,
        outputs=outputs,
        updates=tuple(updates),
    )
    values = ca.vertcat(ca.SX(0, 1), *expressions)
    return extended, ca.Function("hoisted", [graph.parameters], [values], {"cse": True})


class _Replacing:
    """The laws of a graph, written anew with symbols for expressions of parameters only.

    Parameters
    ----------
    graph : Graph

    Attributes
    ----------
    hoisted : dict of int to tuple of casadi.SX
        Symbols and their expressions, by the identity of the expression.
    """

    def __init__(self, graph: Graph):
        self.hoisted: dict[int, tuple[ca.SX, ca.SX]] = {}
        self._arguments = graph.arguments
        self._laws = ca.Function(
            "laws", graph.arguments, [graph.rates, graph.outputs, *graph.updates]
        )

    def results(self) -> list[ca.SX]:
        """Return rates, outputs and updates, operation by operation."""
        laws = self._laws
        results = [ca.SX.ones(laws.sparsity_out(i)) for i in range(laws.n_out())]
        # expressions, and whether each depends on parameters only
        work: list[Any] = [None] * laws.sz_w()
        for k in range(laws.n_instructions()):
            operation = laws.instruction_id(k)
            inputs = laws.instruction_input(k)
            outputs = laws.instruction_output(k)
            if operation == ca.OP_INPUT:
                argument, element = inputs
                work[outputs[0]] = self._arguments[argument].nz[element], argument == 1
            elif operation == ca.OP_CONST:
                work[outputs[0]] = ca.SX(laws.instruction_constant(k)), True
            elif operation == ca.OP_OUTPUT:
                result, element = outputs
                results[result].nz[element] = self._operand(*work[inputs[0]])
            else:
                work[outputs[0]] = self._applied(operation, [work[i] for i in inputs])
        return results

    def _applied(self, operation: int, operands: list[tuple[ca.SX, bool]]) -> tuple[ca.SX, bool]:
        """Apply an operation; its result is fixed if all operands are."""
        fixed = all(is_fixed for _, is_fixed in operands)
        values = [
            value if fixed else self._operand(value, is_fixed) for value, is_fixed in operands
        ]
        apply = ca.SX.unary if len(values) == 1 else ca.SX.binary
        return apply(operation, *values), fixed

    def _operand(self, value: ca.SX, fixed: bool) -> ca.SX:
        """Return an operand of a law that varies: a fixed expression becomes a parameter."""
        if not fixed or value.is_constant() or value.is_symbolic():
            return value
        return self.hoisted.setdefault(value.element_hash(), (ca.SX.sym("hoisted"), value))[0]
