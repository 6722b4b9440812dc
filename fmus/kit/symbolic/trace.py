"""The laws of a component as a CasADi graph.

One pass over the class with symbols in its attributes gives expressions for the rates, the outputs and the sampled
updates. From these come the C code of the native FMU, the dependencies in ``ModelStructure``, exact sensitivities and
linearisation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from fmus.kit.component import Component
from fmus.kit.declare import Declaration
from fmus.kit.errors import UserError
from fmus.kit.layout import Layout
from fmus.kit.symbolic.switches import switches


@dataclass(frozen=True)
class Graph:
    """A traced component; every symbol and expression is a CasADi column vector in layout order.

    Attributes
    ----------
    name : str
        Name of the component.
    tolerance : float
        Declared accuracy of the integration.
    layout : Layout
    time, parameters, inputs, states, discretes : casadi.SX
        Symbols.
    rates, outputs : casadi.SX
        Expressions in those symbols.
    restorable : bool
        Whether laws are all there is to it.
    updates : tuple of casadi.SX
        For each sample period, the values of *all* discrete states after its sample instant.
    """

    name: str
    tolerance: float
    layout: Layout
    time: ca.SX
    parameters: ca.SX
    inputs: ca.SX
    states: ca.SX
    discretes: ca.SX
    rates: ca.SX
    outputs: ca.SX
    updates: tuple[ca.SX, ...]
    restorable: bool = True

    @property
    def arguments(self) -> list[ca.SX]:
        """Arguments shared by every generated function."""
        return [self.time, self.parameters, self.inputs, self.states, self.discretes]

    @cached_property
    def start(self) -> tuple[ca.SX, ca.SX]:
        """Start parameters of the states and of the discrete states."""
        index = {p.starts: i for i, p in enumerate(self.layout.parameters)}

        def starts(group: Sequence[Declaration]) -> ca.SX:
            return ca.vertcat(ca.SX(0, 1), *(self.parameters[index[v.name]] for v in group))

        return starts(self.layout.states), starts(self.layout.discretes)

    @cached_property
    def indicators(self) -> ca.SX:
        """What changes its sign where rates or outputs switch."""
        return switches(
            [self.rates, self.outputs], self.arguments, [self.time, self.inputs, self.states]
        )

    def functions(self, tangent: bool = True) -> list[ca.Function]:
        """CasADi functions that the native engine calls (``fmi2/engine.h``).

        Parameters
        ----------
        tangent : bool
            Whether directional derivatives are wanted; without them that function is there, but empty.

        Returns
        -------
        list of casadi.Function
            Rates, outputs, an update for each sample period, tangent.
        """
        a = self.arguments
        names = ["time", "parameters", "inputs", "states", "discretes"]
        seeds = [
            ca.SX.sym("d" + name, symbol.numel())
            for name, symbol in zip(names[1:], a[1:], strict=True)
        ]
        known, seed = ca.vertcat(*a[1:]), ca.vertcat(*seeds)
        # sparse results would shorten the C arrays; the engine counts on full vectors
        rates, outputs, *updates = (
            ca.densify(e) for e in (self.rates, self.outputs, *self.updates)
        )
        tangents = (
            [ca.densify(ca.jtimes(e, known, seed)) for e in (rates, outputs)] if tangent else []
        )
        return [
            ca.Function("rates", a, ca.cse([rates]), {"cse": True}),
            ca.Function("outputs", a, ca.cse([outputs]), {"cse": True}),
            *(ca.Function(f"update_{i}", a, ca.cse([update])) for i, update in enumerate(updates)),
            ca.Function("tangent", [*a, *seeds], ca.cse(tangents) if tangents else []),
        ]

    def depends(self, expressions: ca.SX, symbols: ca.SX) -> list[list[int]]:
        """Sparsity of expressions.

        Parameters
        ----------
        expressions, symbols : casadi.SX
            Columns.

        Returns
        -------
        list of list of int
            For each expression, the positions of the symbols it depends on.
        """
        if expressions.numel() == 0 or symbols.numel() == 0:
            return [[] for _ in range(expressions.numel())]
        pattern = np.array(ca.DM(ca.jacobian_sparsity(expressions, symbols), 1).full(), dtype=bool)
        return [[int(k) for k in np.flatnonzero(row)] for row in pattern]

    def linearise(self, **values: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Linearise about an operating point.

        Parameters
        ----------
        **values : float
            Parameters, inputs and states by name (SI); all others are at their defaults.

        Returns
        -------
        A, B, C, D : ndarray
            State-space matrices from the inputs to the outputs, in layout order.

        Raises
        ------
        UserError
            If there is no variable of a name.
        """
        point = self.point(**values)
        pairs = [
            (self.rates, self.states),
            (self.rates, self.inputs),
            (self.outputs, self.states),
            (self.outputs, self.inputs),
        ]
        f = ca.Function(
            "linearise", self.arguments, [ca.densify(ca.jacobian(e, s)) for e, s in pairs]
        )
        return tuple(m.full() for m in f(0.0, *point))

    def point(self, **values: float) -> list[np.ndarray]:
        """Vectors of parameters, inputs, states and discretes: defaults, replaced by ``values``.

        Parameters
        ----------
        **values : float
            By name (SI); the default of a state is its start parameter.

        Returns
        -------
        list of ndarray

        Raises
        ------
        UserError
            If there is no variable of a name.
        """
        layout = self.layout
        groups = (layout.parameters, layout.inputs, layout.states, layout.discretes)
        unknown = set(values) - {v.name for group in groups for v in group}
        if unknown:
            raise UserError(f"{self.name}: no parameter, input or state named {min(unknown)!r}")
        chosen = {v.name: v.start for v in (*layout.parameters, *layout.inputs)} | values
        chosen = {state: chosen[parameter] for state, parameter in layout.start_of.items()} | chosen
        return [np.array([float(chosen[v.name]) for v in group]) for group in groups]


def trace(cls: type[Component]) -> Graph:
    """Evaluate the laws of a component on symbols.

    Parameters
    ----------
    cls : type[Component]

    Returns
    -------
    Graph
    """
    layout = cls.layout
    groups: list[Any] = [layout.parameters, layout.inputs, layout.states, layout.discretes]
    symbols = [ca.vertcat(ca.SX(0, 1), *(ca.SX.sym(v.name) for v in group)) for group in groups]
    time = ca.SX.sym("time")
    component = cls()
    for group, vector in zip(groups, symbols, strict=True):
        component.__dict__.update(zip([v.name for v in group], ca.vertsplit(vector), strict=True))
    component.time = time

    def column(values: list[Any]) -> ca.SX:
        return ca.vertcat(ca.SX(0, 1), *values)

    updates = []
    for _, members in layout.sampled:
        after = {
            d.name: value
            for d, value in zip(
                members, (law() for law in component.laws([d.update for d in members])), strict=True
            )
        }
        updates.append(
            column([after.get(d.name, component.__dict__[d.name]) for d in layout.discretes])
        )
    rates, outputs = column(component.rates()), column(component.outputs())
    parameters, inputs, states, discretes = symbols
    return Graph(
        cls.name,
        cls.tolerance,
        layout,
        time,
        parameters,
        inputs,
        states,
        discretes,
        rates,
        outputs,
        tuple(updates),
        cls.engine is None,
    )
