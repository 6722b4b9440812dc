"""Digest of traced laws, which is the same for components with the same laws."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import casadi as ca

from fmus.kit.interrupt import uninterrupted
from fmus.kit.symbolic.instructions import carry_out

if TYPE_CHECKING:
    from fmus.kit.layout import Layout
    from fmus.kit.symbolic.tracing import Graph


@uninterrupted()
def digest(graph: Graph) -> str:
    """Return the digest of the laws and variables of a component.

    It does not depend on start values of parameters, which are symbols in the laws, or on texts for
    people. It is a Merkle tree, where the digest of an operation is that of its operands' digests,
    so that it does not depend on the order of instructions or on CasADi's names of symbols.

    Parameters
    ----------
    graph : Graph

    Returns
    -------
    str
        SHA-256, in hexadecimal digits.
    """
    results = [ca.densify(part) for part in (graph.rates, graph.outputs, *graph.updates)]
    function = ca.Function("laws", graph.arguments, results)
    symbols = [
        [_digest_of(index, element) for element in range(function.nnz_in(index))]
        for index in range(function.n_in())
    ]
    laws = carry_out(function, symbols, _digest_of, _digest_of_operation)
    return _digest_of(laws, _attributes_in_digest(graph.layout), graph.tolerance, graph.restorable)


def _digest_of(*parts: Any) -> str:
    """Return the digest of numbers, texts, and tuples or lists of these."""
    return sha256(repr(parts).encode()).hexdigest()


def _digest_of_operation(operation: int, operands: Sequence[str]) -> str:
    """Return the digest of an operation from the digests of its operands."""
    return _digest_of(operation, *operands)


def _attributes_in_digest(layout: Layout) -> list[Any]:
    """Return the attributes of variables that a simulation depends on."""
    variables = [
        (v.name, v.unit, v.type, float(v.min), float(v.max), float(v.nominal))
        for v in layout.variables
    ]
    groups = [len(group) for group in (layout.parameters, layout.inputs, layout.states)]
    inputs = [float(v.start) for v in layout.inputs]
    clocks = [(discrete.period, discrete.shift) for discrete in layout.discretes]
    outputs = [v.name for v in layout.shown]
    texts = [v.name for v in layout.texts]
    return [variables, groups, inputs, clocks, outputs, texts]
