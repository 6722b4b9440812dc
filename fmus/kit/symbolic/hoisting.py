"""Hoisting: expressions that depend only on parameters are computed once before a simulation.

A compiler cannot do this, because it does not know that parameters are constant between evaluations
of the laws.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import casadi as ca

from fmus.kit.declare import ParameterDeclaration, name_declaration
from fmus.kit.interrupt import uninterrupted
from fmus.kit.symbolic.instructions import apply_to_symbols, carry_out, column
from fmus.kit.symbolic.tracing import Graph

_PARAMETERS = 1  # their place among the arguments of a graph


@uninterrupted()
def hoist(graph: Graph) -> tuple[Graph, ca.Function]:
    """Replace the largest expressions that depend only on parameters by new parameters.

    Operations and their order do not change, so that results have the same rounding.

    Parameters
    ----------
    graph : Graph

    Returns
    -------
    Graph
        Graph with additional parameters, which are the last ones.
    casadi.Function
        Values of the additional parameters, as a column, from the original parameters.
    """
    hoisted: dict[int, tuple[ca.SX, ca.SX]] = {}  # symbol and expression, by its hash

    def symbol_if_fixed(expression: _Expression) -> ca.SX:
        """Hoist an expression that is fixed and no leaf: return its symbol, else the expression."""
        value = expression.value
        if not expression.is_fixed or value.is_constant() or value.is_symbolic():
            return value
        return hoisted.setdefault(value.element_hash(), (ca.SX.sym("hoisted"), value))[0]

    def apply(operation: int, operands: list[_Expression]) -> _Expression:
        """Apply an operation; the result is fixed if all operands are.

        Otherwise fixed operands are replaced by their symbols.
        """
        is_fixed = all(operand.is_fixed for operand in operands)
        values = [o.value if is_fixed else symbol_if_fixed(o) for o in operands]
        return _Expression(apply_to_symbols(operation, values), is_fixed)

    laws = ca.Function("laws", graph.arguments, [graph.rates, graph.outputs, *graph.updates])
    arguments = [
        [_Expression(symbol, is_fixed=k == _PARAMETERS) for symbol in ca.vertsplit(block)]
        for k, block in enumerate(graph.arguments)
    ]
    results = [ca.SX.ones(laws.sparsity_out(i)) for i in range(laws.n_out())]
    for result, elements in zip(results, carry_out(laws, arguments, _constant, apply), strict=True):
        for k, element in enumerate(elements):
            result.nz[k] = symbol_if_fixed(element)
    rates, outputs, *updates = results
    symbols = [symbol for symbol, _ in hoisted.values()]
    expressions = [expression for _, expression in hoisted.values()]
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
    values = ca.densify(column(expressions))
    return extended, ca.Function("hoisted", [graph.parameters], [values], {"cse": True})


class _Expression(NamedTuple):
    """An expression of a law, and whether it depends on parameters only."""

    value: ca.SX
    is_fixed: bool


def _constant(value: float) -> _Expression:
    return _Expression(ca.SX(value), is_fixed=True)
