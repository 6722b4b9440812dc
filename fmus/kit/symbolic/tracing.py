"""The traced graph of a component: its laws as CasADi expressions, and their structure.

One evaluation of the laws on symbols gives expressions for rates, outputs and sampled updates. The
C code of the native FMU, the dependencies in ``ModelStructure``, event indicators, exact
sensitivities and linearisations are derived from them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from fmus.kit.component import Component
from fmus.kit.declare import Declaration
from fmus.kit.errors import UserError
from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import Layout
from fmus.kit.symbolic.calls import Calls
from fmus.kit.symbolic.digest import digest
from fmus.kit.symbolic.instructions import column
from fmus.kit.symbolic.switching import event_indicators

_ARGUMENTS = ("time", "parameters", "inputs", "states", "discretes")


@dataclass(frozen=True)
class Graph:
    """A traced component, whose symbols and expressions are CasADi columns in layout order.

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
    updates : tuple of casadi.SX
        For each clock, the values of *all* discrete states after its sample instant.
    restorable : bool
        Whether its state can be saved and restored, which an engine of its own prevents.
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
        """Arguments of every generated function."""
        return [getattr(self, name) for name in _ARGUMENTS]

    @property
    @uninterrupted()
    def continuous(self) -> ca.SX:
        """Inputs and states, on which outputs, derivatives and indicators depend between events."""
        return ca.vertcat(self.inputs, self.states)

    @cached_property
    def start(self) -> tuple[ca.SX, ca.SX]:
        """Start parameters of the states and of the discrete states."""
        index = {p.starts: i for i, p in enumerate(self.layout.parameters)}

        def starts(group: Sequence[Declaration]) -> ca.SX:
            return column(self.parameters[index[v.name]] for v in group)

        return starts(self.layout.states), starts(self.layout.discretes)

    @cached_property
    @uninterrupted()
    def indicators(self) -> ca.SX:
        """Event indicators, which change their sign where rates or outputs switch."""
        moving = (0, 2, 3)  # time, inputs and states
        return event_indicators([self.rates, self.outputs], self.arguments, self.layout, moving)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the laws, independent of start values of parameters; see :mod:`.digest`."""
        return digest(self)

    @uninterrupted()
    def functions(self, tangent: bool = True, prefix: str = "") -> list[ca.Function]:
        """Make the CasADi functions that the native engine calls (``fmi/engine.h``).

        Parameters
        ----------
        tangent : bool
            Whether to include the function for directional derivatives.
        prefix : str
            Beginning of the names of rates, outputs and updates.

        Returns
        -------
        list of casadi.Function
            Rates, outputs, an update for each clock, and the tangent, with respect to time as well.
        """
        arguments = self.arguments
        # sparse results would shorten the C arrays; the engine expects full vectors
        rates = ca.densify(self.rates)
        outputs = ca.densify(self.outputs)
        updates = [ca.densify(update) for update in self.updates]
        functions = [
            ca.Function(f"{prefix}rates", arguments, ca.cse([rates]), {"cse": True}),
            ca.Function(f"{prefix}outputs", arguments, ca.cse([outputs]), {"cse": True}),
            *(
                ca.Function(f"{prefix}update_{i}", arguments, ca.cse([update]))
                for i, update in enumerate(updates)
            ),
        ]
        if tangent:
            seeds = [
                ca.SX.sym(f"d{name}", symbols.numel())
                for name, symbols in zip(_ARGUMENTS, arguments, strict=True)
            ]
            known = ca.vertcat(*arguments)
            seed = ca.vertcat(*seeds)
            tangents = ca.cse([ca.densify(ca.jtimes(e, known, seed)) for e in (rates, outputs)])
            functions.append(ca.Function("tangent", [*arguments, *seeds], tangents))
        return functions

    @uninterrupted()
    def functions_of_fmi_3(self) -> list[ca.Function]:
        """Make the CasADi functions that FMI 3.0 needs in addition (``fmi/engine.h``).

        Returns
        -------
        list of casadi.Function
            ``output_rates``: time derivatives of the outputs for constant inputs. ``adjoint``: a
            weighted sum of the derivatives of rates and outputs, by each argument.
        """
        arguments = self.arguments
        moving = ca.vertcat(self.time, self.states)
        output_rates = ca.jtimes(self.outputs, moving, ca.vertcat(1.0, self.rates))
        laws = ca.vertcat(self.rates, self.outputs)
        weights = [
            ca.SX.sym("wrates", self.rates.numel()),
            ca.SX.sym("woutputs", laws.numel() - self.rates.numel()),
        ]
        known = ca.vertcat(*arguments)
        adjoint = ca.densify(ca.jtimes(laws, known, ca.vertcat(*weights), True))
        ends = np.cumsum([0, *(group.numel() for group in arguments)]).tolist()
        parts = ca.cse([adjoint[begin:end] for begin, end in itertools.pairwise(ends)])
        return [
            ca.Function("output_rates", arguments, ca.cse([ca.densify(output_rates)])),
            ca.Function("adjoint", [*arguments, *weights], parts),
        ]

    @uninterrupted()
    def depends(self, expressions: ca.SX, symbols: ca.SX) -> list[list[int]]:
        """Return the symbols that each expression depends on.

        Parameters
        ----------
        expressions, symbols : casadi.SX
            Columns.

        Returns
        -------
        list of list of int
            For each expression, the indices of the symbols that it depends on.
        """
        if expressions.numel() == 0 or symbols.numel() == 0:
            return [[] for _ in range(expressions.numel())]
        pattern = np.array(ca.DM(ca.jacobian_sparsity(expressions, symbols), 1).full(), dtype=bool)
        return [[int(k) for k in np.flatnonzero(row)] for row in pattern]

    @uninterrupted()
    def linearise(self, **values: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Linearise about an operating point.

        Parameters
        ----------
        **values : float
            Parameters, inputs and states by name, SI; others have their defaults.

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
        jacobians = [
            ca.densify(ca.jacobian(expression, symbols))
            for expression in (self.rates, self.outputs)
            for symbols in (self.states, self.inputs)
        ]
        linearise = ca.Function("linearise", self.arguments, jacobians)
        return tuple(matrix.full() for matrix in linearise(0.0, *point))

    def point(self, **values: float) -> list[np.ndarray]:
        """Return vectors of parameters, inputs, states and discretes at an operating point.

        Parameters
        ----------
        **values : float
            Values by name, SI; others have their defaults. The default of a state is its start
            parameter.

        Returns
        -------
        list of ndarray
            Vectors in layout order, SI.

        Raises
        ------
        UserError
            If there is no variable of a name.
        """
        layout = self.layout
        unknown = set(values) - {v.name for group in layout.arguments for v in group}
        if unknown:
            raise UserError(f"{self.name}: no parameter, input or state named {min(unknown)!r}")
        known = {v.name: v.start for v in (*layout.parameters, *layout.inputs)} | values
        starts = {state: known[parameter] for state, parameter in layout.start_of.items()}
        point = starts | known
        return [np.array([float(point[v.name]) for v in group]) for group in layout.arguments]


def trace(cls: type[Component]) -> Graph:
    """Return the graph of a component, by evaluating its laws on symbols.

    Parameters
    ----------
    cls : type[Component]

    Returns
    -------
    Graph
    """
    return _traced(cls, cls())


def trace_with_laws(cls: type[Component]) -> tuple[Graph, dict[str, ca.SX]]:
    """Return the graph of a component, and the value of each law.

    Parameters
    ----------
    cls : type[Component]

    Returns
    -------
    graph : Graph
    laws : dict of str to casadi.SX
        Values by name, for laws without arguments that return one number.
    """
    calls = Calls(cls)
    graph = _traced(cls, calls.instance)
    laws = {}
    for name, values in calls.values.items():
        if all(isinstance(value, ca.SX) for value in values) and values[0].is_scalar():
            laws[name] = values[0]
    return graph, laws


@uninterrupted()
def _traced(cls: type[Component], component: Component) -> Graph:
    """Return the graph of an instance, whose variables are set to symbols."""
    layout = cls.layout
    component.time = ca.SX.sym("time")
    parameters, inputs, states, discretes = (
        _set_symbols(component, group) for group in layout.arguments
    )
    updates = []
    for _, members in layout.sampled:
        laws = component.laws([d.update for d in members])
        after = {d.name: law() for d, law in zip(members, laws, strict=True)}
        # the states of other clocks stay
        updates.append(
            column([after.get(d.name, component.__dict__[d.name]) for d in layout.discretes])
        )
    return Graph(
        name=cls.name,
        tolerance=cls.tolerance,
        layout=layout,
        time=component.time,
        parameters=parameters,
        inputs=inputs,
        states=states,
        discretes=discretes,
        rates=column(component.rates()),
        outputs=column(component.outputs()),
        updates=tuple(updates),
        restorable=cls.engine is None,
    )


def _set_symbols(component: Component, group: Sequence[Declaration]) -> ca.SX:
    """Set variables of an instance to new symbols, and return these as a column."""
    symbols = column(ca.SX.sym(v.name) for v in group)
    # not setattr: an effect of an input is a descriptor with the name of the input
    component.__dict__.update(zip([v.name for v in group], ca.vertsplit(symbols), strict=True))
    return symbols


@uninterrupted()
def dependencies(
    graph: Graph, states_known: bool = True, time: int | None = None
) -> dict[str, dict[int, list[int]]]:
    """Return the dependencies of every unknown of ``ModelStructure``, by value reference.

    They are exact, because they are the sparsity of the traced laws.

    Parameters
    ----------
    graph : Graph
    states_known : bool
        Whether a host can set the continuous states or get derivatives by them. Otherwise FMI has
        no derivatives, and no dependencies on states.
    time : int, optional
        Value reference of the time if it is a variable; those of event indicators come after it.

    Returns
    -------
    dict
        ``Outputs``, ``Derivatives`` and ``EventIndicators`` on inputs, continuous states and the
        time; ``InitialUnknowns`` on parameters, inputs and the time, where states depend on their
        start parameters. By value reference of the unknown.
    """
    unknowns = _Unknowns(graph, states_known, time)
    return {
        "Outputs": unknowns.outputs(),
        "Derivatives": unknowns.derivatives(),
        "InitialUnknowns": unknowns.initial(),
        "EventIndicators": unknowns.indicators(),
    }


class _FirstReferences(NamedTuple):
    """Value reference of the first variable of each group; the others have the next ones."""

    parameters: int
    inputs: int
    states: int
    discretes: int
    outputs: int
    derivatives: int


@dataclass(frozen=True)
class _Unknowns:
    """The unknowns of a graph and their dependencies, by value reference; see `dependencies`."""

    graph: Graph
    states_known: bool
    time: int | None

    @cached_property
    def first(self) -> _FirstReferences:
        layout = self.graph.layout
        groups = (*layout.arguments, layout.outputs)
        return _FirstReferences(*itertools.accumulate(map(len, groups), initial=0))

    def outputs(self) -> dict[int, list[int]]:
        """Return the dependencies of outputs between events."""
        layout = self.graph.layout
        first = self.first
        states = [i for i, s in enumerate(layout.states, first.states) if s.output]
        discretes = [i for i, d in enumerate(layout.discretes, first.discretes) if d.output]
        # A continuous state depends on itself; a discrete state is constant until the next sample.
        return {
            **self._between_events(first.outputs, self.graph.outputs),
            **{i: [i] if self.states_known else [] for i in states},
            **{i: [] for i in discretes},
        }

    def derivatives(self) -> dict[int, list[int]]:
        """Return the dependencies of derivatives between events; none if hosts do not have them."""
        if not self.states_known:
            return {}
        return self._between_events(self.first.derivatives, self.graph.rates)

    def indicators(self) -> dict[int, list[int]]:
        """Return the dependencies of event indicators between events; none without references."""
        if self.time is None:
            return {}
        return self._between_events(self.time + 1, self.graph.indicators)

    def initial(self) -> dict[int, list[int]]:
        """Return the dependencies of initial unknowns on parameters and inputs."""
        graph = self.graph
        layout = graph.layout
        first = self.first
        columns = {
            first.states: graph.states,
            first.discretes: graph.discretes,
            first.outputs: graph.outputs,
        }
        # FMI lists every continuous state as an initial unknown, but discrete states only if they
        # are outputs.
        unlisted = {i for i, d in enumerate(layout.discretes, first.discretes) if not d.output}
        if self.states_known:
            columns[first.derivatives] = graph.rates
        else:
            unlisted |= {i for i, s in enumerate(layout.states, first.states) if not s.output}
        rows: dict[int, list[int]] = {}
        for reference, block in columns.items():
            rows |= enumerate(self._at_start(block), reference)
        return {i: known for i, known in rows.items() if i not in unlisted}

    def _at_start(self, block: ca.SX) -> list[list[int]]:
        """Return the parameters and inputs that each element depends on at the start."""
        graph = self.graph
        states = [graph.states, graph.discretes]
        (at_start,) = ca.substitute([block], states, list(graph.start))
        return self._references(at_start, ca.vertcat(graph.parameters, graph.inputs), 0)

    def _between_events(self, reference: int, block: ca.SX) -> dict[int, list[int]]:
        """Return the dependencies of a block on knowns, by value reference from the first on."""
        knowns = self.graph.continuous if self.states_known else self.graph.inputs
        return dict(enumerate(self._references(block, knowns, self.first.inputs), reference))

    def _references(self, block: ca.SX, knowns: ca.SX, first: int) -> list[list[int]]:
        """Return value references of the knowns, and of the time, that each element depends on."""
        references = list(range(first, first + knowns.numel()))
        symbols = [knowns]
        if self.time is not None:
            references.append(self.time)
            symbols.append(self.graph.time)
        rows = self.graph.depends(block, ca.vertcat(*symbols))
        return [[references[k] for k in row] for row in rows]
