"""Trim: the equilibrium of a model, with signals that are fixed and signals that are free.

States and discrete states are unknown. An input or parameter that is named free is unknown, too; a
state or an output that is fixed adds an equation. In an equilibrium rates are zero and a sample
changes nothing. States that may drift move at a constant rate r instead, in a way that leaves all
others at rest: the rates F are the same a moment later, dF/dx F = 0, and so are sampled values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.declare import Declaration
from fmus.kit.errors import UserError, suggestion
from fmus.kit.interrupt import uninterrupted
from fmus.kit.symbolic import Graph
from orchestration.linear.operating_point import OperatingPoint
from orchestration.reporting import option

_MOST_STEPS = 100
_SOLVED = 1e-9  # residual relative to the size of the terms that it is the sum of
_HALVINGS = 20
_ROUNDING = 1e-15  # step relative to the largest unknown, both in nominal values
_INDEPENDENT = 1e-10  # smallest singular value of independent equations, relative to the largest
_VISIBLE = 1e-6  # share of an unknown in a direction in which nothing changes


@dataclass(frozen=True)
class TrimRequest:
    """Conditions of an equilibrium.

    Attributes
    ----------
    fixed : Mapping of str to float
        Values of inputs, states and outputs.
    free : sequence of str
        Inputs and parameters that take the value that it needs.
    drift : sequence of str
        States that need not be at rest.
    """

    fixed: Mapping[str, float]
    free: Sequence[str] = ()
    drift: Sequence[str] = ()


class _Equations(NamedTuple):
    """The equations of an equilibrium, scaled, as functions of the unknowns in nominal values."""

    residual: ca.Function
    rows: list[str]  # what each equation is of
    unknowns: list[Declaration]
    values: Array  # nominal
    start: Array


@uninterrupted()
def trim(graph: Graph, near: OperatingPoint, request: TrimRequest) -> OperatingPoint:
    """Find an equilibrium.

    Parameters
    ----------
    graph : Graph
    near : OperatingPoint
        Where the search starts: parameters and inputs have their values, and states that nothing
        drives stay where they are.
    request : TrimRequest

    Returns
    -------
    OperatingPoint

    Raises
    ------
    UserError
        If a name is of no such signal, the counts of free and fixed signals differ, or there is no
        equilibrium, or a free signal does not matter to it.
    """
    inputs = {v.name for v in graph.layout.inputs}
    given = {name: value for name, value in request.fixed.items() if name in inputs}
    targets = {name: value for name, value in request.fixed.items() if name not in inputs}
    _check(graph, request, targets)
    start = replace(near, inputs=near.inputs | given)
    equations = _equations(graph, start, request, targets)
    solution, residual = _solve(equations)
    undetermined = _undetermined(equations, solution)
    worst = int(np.abs(residual).argmax()) if residual.size else 0
    if residual.size and not abs(residual[worst]) <= _SOLVED:
        advice = "fix less, free an input, or let a state drift"
        raise UserError(
            f"{graph.name}: no equilibrium found; {equations.rows[worst]} cannot be met together"
            f" with the others ({advice}: {option('drift')})"
        )
    for name in undetermined:
        if name in request.free:
            raise UserError(
                f"{graph.name}: {option('free', [name])}: the equilibrium does not determine {name}"
            )
    return _point(graph, start, equations, solution, request, undetermined)


def _check(graph: Graph, request: TrimRequest, targets: Mapping[str, float]) -> None:
    """Refuse names that are of no such signal, and counts that cannot be met."""
    layout = graph.layout
    known = {
        "fix": [v.name for v in (*layout.inputs, *layout.states, *layout.outputs)],
        "free": [v.name for v in (*layout.inputs, *layout.parameters)],
        "drift": [v.name for v in layout.states],
    }
    meant = {"fix": "input, state or output", "free": "input or parameter", "drift": "state"}
    named = {"fix": list(request.fixed), "free": request.free, "drift": request.drift}
    for role, names in named.items():
        for name in names:
            if name not in known[role]:
                raise UserError(
                    f"{graph.name}: {option(role)} names {name!r}, which is no {meant[role]}"
                    f"{suggestion(name, known[role])}"
                )
    both = next((name for name in request.free if name in request.fixed), None)
    if both is not None:
        raise UserError(f"{both} is both fixed and free")
    if len(request.free) > len(targets):
        raise UserError(
            f"{graph.name}: {option('free', list(request.free))}: for each of these a state or an"
            f" output is fixed, here {len(targets)}"
        )


def _equations(
    graph: Graph, start: OperatingPoint, request: TrimRequest, targets: Mapping[str, float]
) -> _Equations:
    """Make the equations, with the values of all variables that are not unknown."""
    fixed = _integrals(graph) - {*targets}
    sought = ({*start.states, *start.discretes} - fixed) | {*request.free}
    variables = _variables(graph, start)
    unknowns = [v for v in variables if v.declared.name in sought]
    known = [v for v in variables if v.declared.name not in sought]
    nominal = np.array([v.declared.nominal for v in unknowns])
    scaled = ca.SX.sym("scaled", len(unknowns))
    rows, laws = _laws(graph, request, targets)
    symbols = ca.vertcat(*(v.symbol for v in (*unknowns, *known)), graph.time)
    values = ca.vertcat(scaled * nominal, *(v.value for v in known), start.time)
    (residual,) = ca.substitute([ca.vertcat(*laws)], [symbols], [values])
    return _Equations(
        ca.Function("equations", [scaled], [residual, ca.densify(ca.jacobian(residual, scaled))]),
        rows,
        [v.declared for v in unknowns],
        nominal,
        np.array([v.value for v in unknowns]) / nominal,
    )


class _Variable(NamedTuple):
    """A variable of a graph, with its value where the search starts."""

    declared: Declaration
    symbol: ca.SX
    value: float


def _variables(graph: Graph, start: OperatingPoint) -> list[_Variable]:
    """Return parameters, inputs, states and discrete states."""
    layout = graph.layout
    groups = (
        (layout.parameters, graph.parameters, start.parameters),
        (layout.inputs, graph.inputs, start.inputs),
        (layout.states, graph.states, start.states),
        (layout.discretes, graph.discretes, start.discretes),
    )
    return [
        _Variable(declared, symbols[k], values[declared.name])
        for group, symbols, values in groups
        for k, declared in enumerate(group)
    ]


def _integrals(graph: Graph) -> set[str]:
    """Return the states that no rate and no sample depends on, which are where they started."""
    laws = ca.vertcat(graph.rates, *graph.updates)
    names = [state.name for state in graph.layout.states]
    return {
        name
        for name, symbol in zip(names, ca.vertsplit(graph.states), strict=True)
        if not ca.depends_on(laws, symbol)
    }


def _laws(
    graph: Graph, request: TrimRequest, targets: Mapping[str, float]
) -> tuple[list[str], list[ca.SX]]:
    """Return what must be zero, and what each is of."""
    layout = graph.layout
    rows: list[str] = []
    laws: list[ca.SX] = []
    for k, state in enumerate(layout.states):
        if state.name not in request.drift:
            rows.append(f"the rate of {state.name} = 0")
            laws.append(graph.rates[k] / state.nominal)
    sampled = graph.discretes
    for update in graph.updates:
        (sampled,) = ca.substitute([update], [graph.discretes], [sampled])
    for k, discrete in enumerate(layout.discretes):
        rows.append(f"the same {discrete.name} after a sample")
        laws.append((sampled[k] - graph.discretes[k]) / discrete.nominal)
    if request.drift:
        later = ca.jtimes(ca.vertcat(graph.rates, sampled), graph.states, graph.rates)
        for k, variable in enumerate((*layout.states, *layout.discretes)):
            rows.append(f"a constant rate of {variable.name}")
            laws.append(later[k] / variable.nominal)
    expressions = dict(
        zip([v.name for v in layout.states], ca.vertsplit(graph.states), strict=True)
    )
    expressions |= zip([v.name for v in layout.outputs], ca.vertsplit(graph.outputs), strict=True)
    nominal = {v.name: v.nominal for v in (*layout.states, *layout.outputs)}
    for name, value in targets.items():
        rows.append(f"{name} = {value:g}")
        laws.append((expressions[name] - value) / nominal[name])
    return rows, laws


@np.errstate(over="ignore")  # a residual without bounds is no equilibrium, which is told
def _solve(equations: _Equations) -> tuple[Array, Array]:
    """Solve by Gauss-Newton with steps of least norm; return the unknowns and the residual.

    What the equations do not determine stays where it started. A residual is relative to the terms
    that it is the sum of, so that rounding ends the search.
    """
    x = equations.start
    r, jacobian = _evaluated(equations, x)
    for _ in range(_MOST_STEPS):
        if not np.isfinite(r).all() or not np.isfinite(jacobian).all():
            break
        step = np.linalg.lstsq(jacobian, -r, rcond=_INDEPENDENT)[0]
        if np.abs(step).max(initial=0.0) <= _ROUNDING * (1.0 + np.abs(x).max(initial=0.0)):
            break
        for halving in range(_HALVINGS):
            candidate = x + step * 0.5**halving
            following, slopes = _evaluated(equations, candidate)
            if np.linalg.norm(following) < np.linalg.norm(r):
                break
        else:
            break
        x, r, jacobian = candidate, following, slopes
    scale = 1.0 + np.abs(jacobian) @ np.abs(x) if r.size else np.ones(0)
    return x, r / scale


def _evaluated(equations: _Equations, x: Array) -> tuple[Array, Array]:
    residual, jacobian = equations.residual(x)
    return residual.full().ravel(), jacobian.full()


def _undetermined(equations: _Equations, x: Array) -> list[str]:
    """Return the unknowns that the equations leave open."""
    _, jacobian = _evaluated(equations, x)
    if not jacobian.size:
        return [v.name for v in equations.unknowns]
    scale = np.abs(jacobian).max(axis=1, keepdims=True)
    _, sizes, directions = np.linalg.svd(jacobian / np.where(scale > 0.0, scale, 1.0))
    rank = int((sizes > _INDEPENDENT * sizes.max(initial=0.0)).sum())
    open_ones = np.abs(directions[rank:]).max(axis=0, initial=0.0) > _VISIBLE
    return [v.name for v, one in zip(equations.unknowns, open_ones, strict=True) if one]


def _point(
    graph: Graph,
    start: OperatingPoint,
    equations: _Equations,
    solution: Array,
    request: TrimRequest,
    undetermined: Sequence[str],
) -> OperatingPoint:
    solved = {
        v.name: float(value)
        for v, value in zip(equations.unknowns, solution * equations.values, strict=True)
    }

    def updated(values: Mapping[str, float]) -> dict[str, float]:
        return {name: solved.get(name, value) for name, value in values.items()}

    point = replace(
        start,
        parameters=updated(start.parameters),
        inputs=updated(start.inputs),
        states=updated(start.states),
        discretes=updated(start.discretes),
        trimmed=True,
        undetermined=tuple(undetermined),
    )
    rates = ca.Function("rates", graph.arguments, [graph.rates])(*point.arguments(graph)).full()
    moving = dict(zip(point.states, rates.ravel().tolist(), strict=True))
    return replace(point, drift={name: moving[name] for name in request.drift})
