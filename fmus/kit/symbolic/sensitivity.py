"""Forward sensitivities: a component's graph extended by the derivatives of its states with respect to parameters.

With S = dx/dtheta, dS/dt = (df/dx) S + df/dtheta and dy/dtheta = (dg/dx) S + dg/dtheta; discrete states likewise at
their sample instants. The extended system is integrated like any other, so the sensitivities are as accurate as the
states (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, section I.14).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf
from typing import Any

import casadi as ca

from fmus.kit.declare import Declaration, ParameterDeclaration, named, starting
from fmus.kit.errors import UserError
from fmus.kit.symbolic.trace import Graph


def with_sensitivities(graph: Graph, names: Sequence[str]) -> Graph:
    """Extend a graph by the sensitivities to some of its parameters.

    Parameters
    ----------
    graph : Graph
    names : sequence of str
        Parameters, start values included.

    Returns
    -------
    Graph
        Its states are followed by ``d(state)/d(parameter)``, parameter by parameter; outputs and discrete states too.

    Raises
    ------
    UserError
        If a name is not a parameter, or one that holds a sample period: the sample instants would move with it, which
        has no derivative here.
    """
    layout = graph.layout
    index = {p.name: i for i, p in enumerate(layout.parameters)}
    unknown = [name for name in names if name not in index]
    if unknown:
        raise UserError(
            f"{graph.name}: no parameter named {unknown[0]!r}; there are: {', '.join(index)}"
        )
    periods = [name for name in names if name in {d.period for d in layout.discretes}]
    if periods:
        raise UserError(f"{graph.name}: no sensitivity to {periods[0]!r}, which is a sample period")
    chosen = [layout.parameters[index[name]] for name in names]
    theta = ca.vertcat(ca.SX(0, 1), *(graph.parameters[index[name]] for name in names))
    count = theta.numel()
    state, discrete = graph.states.numel(), graph.discretes.numel()
    by_state, by_discrete = ca.SX.sym("S", state, count), ca.SX.sym("Z", discrete, count)

    def total(expression: ca.SX) -> ca.SX:
        """Total derivative with respect to theta."""
        return (
            ca.jacobian(expression, theta)
            + ca.mtimes(ca.jacobian(expression, graph.states), by_state)
            + ca.mtimes(ca.jacobian(expression, graph.discretes), by_discrete)
        )

    def extended(value: ca.SX, derivative: ca.SX) -> ca.SX:
        return ca.densify(ca.vertcat(value, ca.vec(derivative)))

    def derivative(variable: Declaration, parameter: ParameterDeclaration) -> Any:
        """Declare the derivative of a variable, as large as the variable over the size of the parameter."""
        nominal = variable.nominal / (abs(float(parameter.start)) or parameter.nominal)
        declared = replace(variable, unit="1", nominal=nominal, min=-inf, max=inf, type="real")
        return named(declared, f"d({variable.name})/d({parameter.name})")

    def start(variable: Declaration, parameter: ParameterDeclaration) -> ParameterDeclaration:
        """A state's derivative starts at 1 with respect to its own start value, else at 0."""
        of = derivative(variable, parameter)
        value = 1.0 if parameter.starts == variable.name else 0.0
        return starting(ParameterDeclaration(start=value, unit="1", nominal=of.nominal), of.name)

    def added(
        what: Callable[[Any, ParameterDeclaration], Any], group: Sequence[Declaration]
    ) -> list[Any]:
        return [what(variable, parameter) for parameter in chosen for variable in group]

    groups = layout.states, layout.discretes, layout.outputs
    states, discretes, outputs = (added(derivative, group) for group in groups)
    starts = [*added(start, layout.states), *added(start, layout.discretes)]
    return replace(
        graph,
        layout=replace(
            layout,
            parameters=(*layout.parameters, *starts),
            states=(*layout.states, *states),
            discretes=(*layout.discretes, *discretes),
            outputs=(*layout.outputs, *outputs),
        ),
        parameters=ca.vertcat(graph.parameters, *(ca.SX.sym(p.name) for p in starts)),
        states=extended(graph.states, by_state),
        discretes=extended(graph.discretes, by_discrete),
        rates=extended(graph.rates, total(graph.rates)),
        outputs=extended(graph.outputs, total(graph.outputs)),
        updates=tuple(extended(update, total(update)) for update in graph.updates),
    )
