"""Forward sensitivities: a graph extended by derivatives of its states by parameters.

With S = dx/dtheta, dS/dt = (df/dx) S + df/dtheta and dy/dtheta = (dg/dx) S + dg/dtheta; discrete
states follow the same equations at their sample instants. The extended system is integrated like
any other, so that sensitivities are as accurate as states (Hairer, Norsett, Wanner: Solving
Ordinary Differential Equations I, section I.14).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import Any

import casadi as ca

from fmus.kit.declare import (
    Declaration,
    ParameterDeclaration,
    make_start_parameter,
    name_declaration,
)
from fmus.kit.errors import UserError
from fmus.kit.interrupt import uninterrupted
from fmus.kit.symbolic.instructions import column
from fmus.kit.symbolic.tracing import Graph


@uninterrupted()
def with_sensitivities(graph: Graph, names: Sequence[str]) -> Graph:
    """Extend a graph by the sensitivities to some of its parameters.

    Parameters
    ----------
    graph : Graph
    names : sequence of str
        Names of parameters, which may be start values.

    Returns
    -------
    Graph
        The states are followed by ``d(state)/d(parameter)``, parameter by parameter; outputs and
        discrete states likewise.

    Raises
    ------
    UserError
        If a name is no parameter, or a period or shift of a clock: it moves the sample instants, by
        which no derivative is computed.
    """
    layout = graph.layout
    positions = _parameter_indices(graph, names)
    parameters = [layout.parameters[k] for k in positions]
    theta = column(graph.parameters[k] for k in positions)
    state_sensitivities = ca.SX.sym("S", graph.states.numel(), theta.numel())
    discrete_sensitivities = ca.SX.sym("Z", graph.discretes.numel(), theta.numel())

    def total_derivative(expression: ca.SX) -> ca.SX:
        """Return the total derivative with respect to theta."""
        return (
            ca.jacobian(expression, theta)
            + ca.mtimes(ca.jacobian(expression, graph.states), state_sensitivities)
            + ca.mtimes(ca.jacobian(expression, graph.discretes), discrete_sensitivities)
        )

    def with_derivative(expression: ca.SX) -> ca.SX:
        return _extended(expression, total_derivative(expression))

    def declared(group: Sequence[Declaration]) -> list[Any]:
        return [_derivative(variable, parameter) for parameter in parameters for variable in group]

    starts = [
        _start(variable, parameter)
        for group in (layout.states, layout.discretes)
        for parameter in parameters
        for variable in group
    ]
    return replace(
        graph,
        layout=replace(
            layout,
            parameters=(*layout.parameters, *starts),
            states=(*layout.states, *declared(layout.states)),
            discretes=(*layout.discretes, *declared(layout.discretes)),
            outputs=(*layout.outputs, *declared(layout.outputs)),
        ),
        parameters=ca.vertcat(graph.parameters, *(ca.SX.sym(p.name) for p in starts)),
        states=_extended(graph.states, state_sensitivities),
        discretes=_extended(graph.discretes, discrete_sensitivities),
        rates=with_derivative(graph.rates),
        outputs=with_derivative(graph.outputs),
        updates=tuple(with_derivative(update) for update in graph.updates),
    )


def _parameter_indices(graph: Graph, names: Sequence[str]) -> list[int]:
    """Return the indices of parameters; raise a UserError for unknown ones and those of clocks."""
    layout = graph.layout
    index = layout.parameter_index
    unknown = [name for name in names if name not in index]
    if unknown:
        raise UserError(
            f"{graph.name}: no parameter named {unknown[0]!r}; there are: {', '.join(index)}"
        )
    of_clocks = [name for name in names if name in layout.clock_parameters]
    if of_clocks:
        raise UserError(
            f"{graph.name}: no sensitivity to {of_clocks[0]!r}, which moves sample instants"
        )
    return [index[name] for name in names]


def _extended(value: ca.SX, derivative: ca.SX) -> ca.SX:
    """Return a column with the columns of a derivative appended."""
    return ca.densify(ca.vertcat(value, ca.vec(derivative)))


def _derivative(variable: Declaration, parameter: ParameterDeclaration) -> Any:
    """Declare the derivative of a variable by a parameter."""
    nominal = variable.nominal / (abs(float(parameter.start)) or parameter.nominal)
    declared = replace(variable, unit="1", nominal=nominal, min=-inf, max=inf, type="real")
    return name_declaration(declared, f"d({variable.name})/d({parameter.name})")


def _start(variable: Declaration, parameter: ParameterDeclaration) -> ParameterDeclaration:
    """Declare the start value of a sensitivity: 1 to the state's own start value, 0 to others."""
    derivative = _derivative(variable, parameter)
    value = 1.0 if parameter.starts == variable.name else 0.0
    declared = ParameterDeclaration(start=value, unit="1", nominal=derivative.nominal)
    return make_start_parameter(declared, derivative.name)
