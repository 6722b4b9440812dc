"""``ModelStructure``: which unknown depends on which known, exact because it is the sparsity of the traced laws."""

from __future__ import annotations

import casadi as ca

from fmus.kit.layout import Layout
from fmus.kit.symbolic.trace import Graph


def dependencies(layout: Layout, graph: Graph) -> dict[str, dict[int, list[int]]]:
    """Dependencies of every unknown, by value reference.

    Parameters
    ----------
    layout : Layout
    graph : Graph

    Returns
    -------
    dict
        ``Outputs`` and ``Derivatives`` on inputs and continuous states; ``InitialUnknowns`` on parameters and inputs,
        the states following their start parameters.
    """
    first_input = len(layout.parameters)
    first_state = first_input + len(layout.inputs)
    first_discrete = first_state + len(layout.states)
    first_output = first_discrete + len(layout.discretes)
    first_derivative = len(layout.variables)

    def shifted(first: int, rows: list[list[int]], known: int) -> dict[int, list[int]]:
        return {first + i: [known + k for k in row] for i, row in enumerate(rows)}

    knowns = ca.vertcat(graph.inputs, graph.states)
    outputs = shifted(first_output, graph.depends(graph.outputs, knowns), first_input)
    # A continuous state is its own known; a discrete one depends on nothing until the next sample instant.
    outputs |= {first_state + i: [first_state + i] for i, s in enumerate(layout.states) if s.output}
    outputs |= {first_discrete + i: [] for i, d in enumerate(layout.discretes) if d.output}
    derivatives = shifted(first_derivative, graph.depends(graph.rates, knowns), first_input)

    given = ca.vertcat(graph.parameters, graph.inputs)
    vectors = {
        first_state: graph.states,
        first_discrete: graph.discretes,
        first_output: graph.outputs,
        first_derivative: graph.rates,
    }
    initial: dict[int, list[int]] = {}
    for first, vector in vectors.items():
        at_start = ca.substitute([vector], [graph.states, graph.discretes], list(graph.start))[0]
        initial |= shifted(first, graph.depends(at_start, given), 0)
    # FMI counts every continuous state among the initial unknowns, but a discrete one only if it is an output.
    for i, discrete in enumerate(layout.discretes):
        if not discrete.output:
            del initial[first_discrete + i]
    return {"Outputs": outputs, "Derivatives": derivatives, "InitialUnknowns": initial}
