"""Claims: hoisting changes no bit, and leaves nothing that depends on parameters only."""

import casadi as ca
import numpy as np
import pytest

from fmus import component
from fmus.kit.symbolic.hoisting import hoist
from fmus.kit.symbolic.sensitivity import with_sensitivities
from fmus.kit.symbolic.tracing import trace

GRAPHS = {
    "voice_coil_dma": lambda: trace(component("voice_coil_dma")),
    "degradation_estimator": lambda: trace(component("degradation_estimator")),
    "with sensitivities": lambda: with_sensitivities(
        trace(component("ppy_actuator_length_driven")), ["R1", "k1"]
    ),
}


def laws(graph):
    return ca.Function("laws", graph.arguments, [graph.rates, graph.outputs, *graph.updates])


@pytest.mark.parametrize("name", GRAPHS)
def test_laws_give_the_same_bits(name):
    graph = GRAPHS[name]()
    hoisted, values = hoist(graph)
    assert (
        hoisted.parameters.numel()
        == len(hoisted.layout.parameters)
        == graph.parameters.numel() + values.numel_out()
    )
    before, after = laws(graph), laws(hoisted)
    rng = np.random.default_rng(1)
    for _ in range(20):
        point = [
            rng.uniform(0.1, 2.0, size) for size in (1, *(a.numel() for a in graph.arguments[1:]))
        ]
        point[1][np.isin([p.type for p in graph.layout.parameters], ["boolean"])] = rng.integers(2)
        given = [point[0], np.append(point[1], values(point[1]).full()), *point[2:]]
        for one, other in zip(before(*point), after(*given), strict=True):
            np.testing.assert_array_equal(one.full(), other.full())


@pytest.mark.parametrize("name", GRAPHS)
def test_nothing_that_depends_on_parameters_only_is_left(name):
    graph = GRAPHS[name]()
    hoisted, _ = hoist(graph)
    function, origin = laws(hoisted), {}
    computed = 0
    for k in range(function.n_instructions()):
        operation, inputs, outputs = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if operation == ca.OP_INPUT:
            origin[outputs[0]] = {inputs[0]}
        elif operation == ca.OP_CONST:
            origin[outputs[0]] = set()
        elif operation != ca.OP_OUTPUT:
            origin[outputs[0]] = set().union(*(origin[i] for i in inputs))
            assert origin[outputs[0]] - {1}, "computed from parameters alone"
            computed += 1
    assert 0 < computed < laws(graph).n_instructions()
