"""Trim: the equilibrium of a model, with fixed and free signals.

States and discrete states are unknown, as are free inputs and parameters; a fixed state or output
adds an equation. In an equilibrium rates are zero and samples change no state. States that may
drift have a constant rate instead, and all others stay at rest: the rates F do not change, dF/dx F
= 0, nor do sampled values.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.declare import Declaration
from fmus.kit.errors import UserError, suggestion
from fmus.kit.interrupt import uninterrupted
from fmus.kit.symbolic import Graph
from orchestration.linear.operating_point import OperatingPoint, with_outputs
from orchestration.reporting import option

_MOST_STEPS = 100
_SOLVED = 1e-9  # largest residual, relative to the size of its terms
_HALVINGS = 20
_ROUNDING = 1e-15  # least step, relative to the largest unknown, both in nominal values
_INDEPENDENT = 1e-10  # least singular value of independent equations, relative to the largest
_VISIBLE = 1e-6  # least share in a null direction of an unknown that is undetermined
_REST = "the rate of {} = 0"
_MORE_STARTS = 32  # of free signals, where the search from the given ones ends without a solution
_WIDTH = 10.0  # of the range of starts of a signal that declares none, in nominal values


@dataclass(frozen=True)
class TrimRequest:
    """Conditions of an equilibrium.

    Attributes
    ----------
    fixed : Mapping of str to float
        Values of inputs, states and outputs.
    free : sequence of str
        Inputs and parameters to be determined.
    drift : sequence of str
        States that need not be at rest.
    """

    fixed: Mapping[str, float]
    free: Sequence[str] = ()
    drift: Sequence[str] = ()


class _Equations(NamedTuple):
    """Equations of an equilibrium, scaled, as functions of the unknowns over their nominals."""

    residual: ca.Function
    rows: list[str]  # each equation in words
    unknowns: list[Declaration]
    nominal: Array
    start: Array
    is_free: Array  # of each unknown, whether it is an input or a parameter


@uninterrupted()
def trim(graph: Graph, near: OperatingPoint, request: TrimRequest) -> OperatingPoint:
    """Return an equilibrium of a model.

    Parameters
    ----------
    graph : Graph
    near : OperatingPoint
        Start of the search, with the values of parameters and inputs. States that the equilibrium
        does not determine keep their values.
    request : TrimRequest

    Returns
    -------
    OperatingPoint

    Raises
    ------
    UserError
        If there is no signal of a name, more signals are free than fixed, there is no equilibrium,
        or it does not determine a free signal.
    """
    inputs = {v.name for v in graph.layout.inputs}
    constants = {name: value for name, value in request.fixed.items() if name in inputs}
    targets = {name: value for name, value in request.fixed.items() if name not in inputs}
    _check(graph, request, targets)
    start = replace(near, inputs=near.inputs | constants)
    constant = _integrals(graph) - targets.keys()
    equations, solution = _solved(graph, start, request, targets, constant)
    undetermined = _undetermined(equations, solution)
    if not undetermined.isdisjoint(request.free):
        # a sensor may see what no law depends on, such as where a damper stands
        constant |= undetermined & _at_rest_anyhow(equations, solution)
        equations, solution = _solved(graph, start, request, targets, constant)
        undetermined = _undetermined(equations, solution)
    for name in request.free:
        if name in undetermined:
            raise UserError(
                f"{graph.name}: {option('free', [name])}: the equilibrium does not determine {name}"
            )
    names = [v.name for v in equations.unknowns]
    values = (solution * equations.nominal).tolist()
    point = start.updated(dict(zip(names, values, strict=True)))
    rates = with_outputs(graph, point).rates
    drift = {name: rates[name] for name in request.drift}
    return replace(
        point,
        trimmed=True,
        drift=drift,
        undetermined=tuple(name for name in names if name in undetermined),
        outside=_outside(equations, solution),
    )


def _solved(
    graph: Graph,
    start: OperatingPoint,
    request: TrimRequest,
    targets: Mapping[str, float],
    constant: Collection[str],
) -> tuple[_Equations, Array]:
    """Return the equations of an equilibrium with constant states, and their solution.

    Raises
    ------
    UserError
        If there is none.
    """
    equations = _equations(graph, start, request, targets, constant)
    solution, residual = _search(equations)
    errors = np.append(np.abs(residual), 0.0)
    worst = int(errors.argmax())
    if not errors[worst] <= _SOLVED:
        raise UserError(
            f"{graph.name}: no equilibrium found; {equations.rows[worst]} cannot be met together"
            " with the others (fix less, free an input, let a state drift:"
            f" {option('drift')}, or start nearer to one: {option('settings')} of a free input)"
        )
    return equations, solution


def _outside(equations: _Equations, x: Array) -> dict[str, tuple[float, float]]:
    """Return the ranges of unknowns that leave them."""
    return {
        v.name: (v.min, v.max)
        for v, value, nominal in zip(equations.unknowns, x, equations.nominal, strict=True)
        if not v.min / nominal - _SOLVED <= value <= v.max / nominal + _SOLVED
    }


def _check(graph: Graph, request: TrimRequest, targets: Mapping[str, float]) -> None:
    """Raise if there is no signal of a name, or more signals are free than fixed."""
    inputs = graph.layout.inputs
    states = graph.layout.states
    roles = (
        ("fix", request.fixed, "input, state or output", (*inputs, *states, *graph.layout.outputs)),
        ("free", request.free, "input or parameter", (*inputs, *graph.layout.parameters)),
        ("drift", request.drift, "state", states),
    )
    for role, names, kind, variables in roles:
        known = [v.name for v in variables]
        for name in names:
            if name not in known:
                raise UserError(
                    f"{graph.name}: {option(role)} names {name!r}, which is no {kind}"
                    f"{suggestion(name, known)}"
                )
    conflict = next((name for name in request.free if name in request.fixed), None)
    if conflict is not None:
        raise UserError(f"{conflict} is both fixed and free")
    if len(request.free) > len(targets):
        raise UserError(
            f"{graph.name}: {option('free', list(request.free))}: for each of these a state or an"
            f" output is fixed, here {len(targets)}"
        )


def _equations(
    graph: Graph,
    start: OperatingPoint,
    request: TrimRequest,
    targets: Mapping[str, float],
    constant: Collection[str],
) -> _Equations:
    """Return the equations, with values for all variables that are known."""
    names = {*start.states, *start.discretes, *request.free}.difference(constant)
    variables = [variable for group in graph.layout.arguments for variable in group]
    places = [k for k, variable in enumerate(variables) if variable.name in names]
    unknowns = [variables[k] for k in places]
    nominal = np.array([variable.nominal for variable in unknowns])
    known = np.concatenate(start.arguments(graph))
    scaled = ca.SX.sym("scaled", len(unknowns))
    values = ca.SX(known)
    for k, place in enumerate(places):
        values[place + 1] = scaled[k] * nominal[k]  # behind the time
    laws = dict(_laws(graph, request, targets))
    symbols = ca.vertcat(*graph.arguments)
    (residual,) = ca.substitute([ca.vertcat(*laws.values())], [symbols], [values])
    jacobian = ca.densify(ca.jacobian(residual, scaled))
    return _Equations(
        residual=ca.Function("equations", [scaled], [residual, jacobian]),
        rows=list(laws),
        unknowns=unknowns,
        nominal=nominal,
        start=known[[place + 1 for place in places]] / nominal,
        is_free=np.array([variable.name in request.free for variable in unknowns], dtype=bool),
    )


def _integrals(graph: Graph) -> set[str]:
    """Return the states on which no rate and no sample depends, and which keep their values."""
    laws = ca.vertcat(graph.rates, *graph.updates)
    names = [state.name for state in graph.layout.states]
    return {
        name
        for name, symbol in zip(names, ca.vertsplit(graph.states), strict=True)
        if not ca.depends_on(laws, symbol)
    }


def _laws(
    graph: Graph, request: TrimRequest, targets: Mapping[str, float]
) -> Iterator[tuple[str, ca.SX]]:
    """Yield each equation in words, and as an expression that must be zero, over nominal values.

    States without drift are at rest, discrete states stay the same, drifting ones have constant
    rates, and fixed signals have their values.
    """
    layout = graph.layout
    for k, state in enumerate(layout.states):
        if state.name not in request.drift:
            yield _REST.format(state.name), graph.rates[k] / state.nominal
    sampled = graph.discretes  # after the samples of all clocks, one after the other
    index = layout.parameter_index
    for (clock, _), update in zip(layout.sampled, graph.updates, strict=True):
        # the discrete states are those before a sample, and so of one a period ago
        period = clock.period
        seconds = graph.parameters[index[period]] if isinstance(period, str) else period
        before = [sampled, graph.time - seconds]
        (sampled,) = ca.substitute([update], [graph.discretes, graph.time], before)
    for k, discrete in enumerate(layout.discretes):
        change = (sampled[k] - graph.discretes[k]) / discrete.nominal
        yield f"the same {discrete.name} after a sample", change
    if request.drift:
        # derivatives of rates and samples with respect to time, while states follow their rates
        changes = ca.jtimes(ca.vertcat(graph.rates, sampled), graph.states, graph.rates)
        for k, variable in enumerate((*layout.states, *layout.discretes)):
            yield f"a constant rate of {variable.name}", changes[k] / variable.nominal
    signals = (*layout.states, *layout.outputs)
    expressions = ca.vertcat(graph.states, graph.outputs)
    index = {v.name: k for k, v in enumerate(signals)}
    for name, value in targets.items():
        k = index[name]
        yield f"{name} = {value:g}", (expressions[k] - value) / signals[k].nominal


def _search(equations: _Equations) -> tuple[Array, Array]:
    """Return the first solution of those that searches from several starts find.

    The first search begins at the given values, and its result is returned if none finds a
    solution. Where a law does not answer a signal there, such as the flow of a shut valve its
    opening, others begin at free signals across their ranges; states begin where they were given,
    because undetermined ones keep their values.

    Returns
    -------
    ndarray, ndarray
        As `_solve` does.
    """
    first = _solve(equations, equations.start)
    found = first
    for start in _other_starts(equations):
        if _is_solved(found[1]):
            return found
        found = _solve(equations, start)
    return found if _is_solved(found[1]) else first


def _is_solved(residual: Array) -> bool:
    return bool((np.abs(residual) <= _SOLVED).all())


def _other_starts(equations: _Equations) -> Iterator[Array]:
    """Yield starts with free signals at points of a Halton sequence in their ranges."""
    free = np.flatnonzero(equations.is_free)
    if not free.size:
        return
    from scipy.stats.qmc import Halton

    start, nominal = equations.start, equations.nominal
    declared = [equations.unknowns[k] for k in free]
    low = np.array([v.min for v in declared]) / nominal[free]
    high = np.array([v.max for v in declared]) / nominal[free]
    near = np.clip(start[free], low, high)
    low, high = np.maximum(low, near - _WIDTH), np.minimum(high, near + _WIDTH)
    for point in Halton(free.size, scramble=False).random(_MORE_STARTS + 1)[1:]:
        other = start.copy()
        other[free] = low + point * (high - low)
        yield other


@np.errstate(over="ignore")  # an infinite residual is reported as no equilibrium
def _solve(equations: _Equations, start: Array) -> tuple[Array, Array]:
    """Return the solution by Gauss-Newton with steps of least norm, and its relative residual.

    Unknowns that the equations do not determine keep their start values. Residuals are relative to
    the size of their terms, so that rounding does not matter.
    """
    x = start
    r, jacobian = _evaluate(equations, x)
    for _ in range(_MOST_STEPS):
        if not np.isfinite(r).all() or not np.isfinite(jacobian).all():
            break
        step = np.linalg.lstsq(jacobian, -r, rcond=_INDEPENDENT)[0]
        if np.abs(step).max(initial=0.0) <= _ROUNDING * (1.0 + np.abs(x).max(initial=0.0)):
            break
        for halving in range(_HALVINGS):
            candidate = x + step * 0.5**halving
            next_r, next_jacobian = _evaluate(equations, candidate)
            if np.linalg.norm(next_r) < np.linalg.norm(r):
                break
        else:  # no step reduces the residual
            break
        x, r, jacobian = candidate, next_r, next_jacobian
    scale = 1.0 + np.abs(jacobian) @ np.abs(x) if r.size else np.ones(0)
    return x, r / scale


def _evaluate(equations: _Equations, x: Array) -> tuple[Array, Array]:
    """Return the residual, shape (m,), and its Jacobian, shape (m, n)."""
    residual, jacobian = equations.residual(x)
    return residual.full().ravel(), jacobian.full()


def _at_rest_anyhow(equations: _Equations, x: Array) -> set[str]:
    """Return the states that move by their rates alone, and whose rates no unknown moves."""
    _, jacobian = _evaluate(equations, x)
    rows = dict(zip(equations.rows, jacobian, strict=True))
    names = {v.name for v in equations.unknowns}
    return {name for name in names if not rows.get(_REST.format(name), np.ones(1)).any()}


def _undetermined(equations: _Equations, x: Array) -> set[str]:
    """Return the unknowns that have a share in the null space of the equations at a solution."""
    _, jacobian = _evaluate(equations, x)
    if not jacobian.size:
        return {v.name for v in equations.unknowns}
    row_sizes = np.abs(jacobian).max(axis=1, keepdims=True)
    _, sizes, directions = np.linalg.svd(jacobian / np.where(row_sizes > 0.0, row_sizes, 1.0))
    rank = int((sizes > _INDEPENDENT * sizes.max(initial=0.0)).sum())
    shares = np.abs(directions[rank:]).max(axis=0, initial=0.0)
    pairs = zip(equations.unknowns, shares, strict=True)
    return {unknown.name for unknown, share in pairs if share > _VISIBLE}
