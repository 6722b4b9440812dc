"""The Jacobians of a model about an operating point, before time is discretised.

A model has continuous states x, discrete states d that are sampled by clocks, and inputs u. In
deviations from the operating point,

    dx/dt = R (x, d, u),    y = S (x, d, u),    d = U_i (x, d, u) at the instants of clock i,

where R, S and U_i are matrices whose columns are those of all of x, d and u. Prescribing a state,
cutting a loop at one and leaving out what is on no path are operations on these matrices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from fmus.kit.interrupt import uninterrupted
from fmus.kit.symbolic import Graph
from orchestration.linear.operating_point import OperatingPoint
from orchestration.reporting import option
from orchestration.system import Connection


@dataclass(frozen=True)
class SampledUpdate:
    """The update of some discrete states at the instants of a clock.

    Attributes
    ----------
    clock : str
        Name of its period, for messages.
    period, shift : float
        Sample k is at shift + k period, s.
    rows : tuple of int
        Places of the states among the discrete ones.
    matrix : ndarray, shape (len(rows), n)
        Their values after the sample.
    """

    clock: str
    period: float
    shift: float
    rows: tuple[int, ...]
    matrix: Array


@dataclass(frozen=True)
class LinearBlocks:
    """The matrices of a linearised model.

    Attributes
    ----------
    states, discretes, inputs : tuple of str
        Names of the n columns of every matrix, in this order.
    rates : ndarray, shape (states, n)
    updates : tuple of SampledUpdate
    signals : dict of str to ndarray, shape (n,)
        Every signal that can be an output: outputs, inputs and states, ``der(state)``, and
        ``next(state)`` for the value that a discrete state gets at a sample.
    """

    states: tuple[str, ...]
    discretes: tuple[str, ...]
    inputs: tuple[str, ...]
    rates: Array
    updates: tuple[SampledUpdate, ...]
    signals: dict[str, Array]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return (*self.states, *self.discretes, *self.inputs)

    def prescribing(self, names: Sequence[str]) -> LinearBlocks:
        """Return the blocks with some states as inputs, whose own laws no longer count."""
        chosen = [n for n in names if n in (*self.states, *self.discretes)]
        kept = self._without(set(chosen))
        return replace(kept, inputs=(*self.inputs, *chosen))._from(self)

    def cut_at(self, state: str) -> LinearBlocks:
        """Return the blocks in which a state is read from an input instead.

        The new input ``cut(state)`` takes the place of the state in every law but the one that
        makes the state itself, as if the wire behind an integrator or a hold were cut.
        """
        fed = f"cut({state})"
        opened = replace(self, inputs=(*self.inputs, fed))._from(self)
        place = self.columns.index(state)
        last = len(opened.columns) - 1

        def rewired(matrix: Array, own: Sequence[bool]) -> Array:
            others = ~np.array(own, dtype=bool)
            changed = matrix.copy()
            changed[others, last] = matrix[others, place]
            changed[others, place] = 0.0
            return changed

        discrete = place - len(self.states)
        updates = tuple(
            replace(u, matrix=rewired(u.matrix, [row == discrete for row in u.rows]))
            for u in opened.updates
        )
        itself = {state, f"der({state})", f"next({state})"}
        names = list(opened.signals)
        rows = rewired(np.array(list(opened.signals.values())), [n in itself for n in names])
        return replace(
            opened,
            rates=rewired(opened.rates, [n == state for n in opened.states]),
            updates=updates,
            signals=dict(zip(names, rows, strict=True)),
        )

    def exchanging(self, connections: Sequence[Connection], step: float) -> LinearBlocks:
        """Return the blocks with inputs that are connected, and held over a communication step.

        That is a master that steps by Jacobi's method: at each communication point all inputs get
        the outputs of that point, those that depend on inputs included, and keep them for a step.

        Parameters
        ----------
        connections : sequence of Connection
            To inputs, whose names are ``member.variable``.
        step : float
            Seconds.

        Raises
        ------
        UserError
            If outputs and inputs determine each other without a solution.
        """
        received = {str(c.target): c.factor * self.signals[str(c.source)] for c in connections}
        names = tuple(received)
        places = [self.columns.index(name) for name in names]
        given = np.array(list(received.values())).reshape(len(names), len(self.columns))
        through = np.eye(len(names)) - given[:, places]
        if names and np.linalg.cond(through) > 1.0 / np.finfo(float).eps:
            raise UserError(f"{', '.join(names)}: an algebraic loop without a solution")
        given[:, places] = 0.0
        resolved = np.linalg.solve(through, given)

        def seen(row: Array) -> Array:
            others = row.copy()
            others[places] = 0.0
            return np.asarray(others + row[places] @ resolved)

        first = len(self.discretes)
        rows = tuple(range(first, first + len(names)))
        exchange = SampledUpdate("the communication step", step, 0.0, rows, resolved)
        opened = replace(
            self,
            discretes=(*self.discretes, *names),
            inputs=tuple(name for name in self.inputs if name not in received),
            updates=(exchange, *self.updates),
            signals={name: seen(row) for name, row in self.signals.items()},
        )
        return opened._from(self)

    def between(self, inputs: Sequence[str], outputs: Sequence[str]) -> LinearBlocks:
        """Return the blocks with chosen inputs and those states that are on a path to an output.

        Raises
        ------
        UserError
            If there is no signal of a name.
        """
        for name in inputs:
            if name not in self.inputs:
                known = (*self.inputs, *self.states, *self.discretes)
                raise UserError(
                    f"{option('inputs', [name])}: no input or state of this name"
                    f"{suggestion(name, known) or f'; there are {_listed(known)}'}"
                )
        for name in outputs:
            if name not in self.signals:
                raise UserError(
                    f"{option('outputs', [name])}: no signal of this name"
                    f"{suggestion(name, self.signals) or f'; there are {_listed(self.signals)}'}"
                )
        on_path = self._on_path(inputs, outputs)
        dropped = {n for n in (*self.states, *self.discretes) if n not in on_path}
        kept = self._without(dropped)
        return replace(kept, inputs=tuple(inputs))._from(self)

    def _on_path(self, inputs: Sequence[str], outputs: Sequence[str]) -> set[str]:
        """Return the states that an input moves and that move an output, directly or not."""
        columns = self.columns
        reads: dict[str, set[str]] = {n: set() for n in columns}
        for name, row in zip(self.states, self.rates, strict=True):
            reads[name] |= {columns[k] for k in np.flatnonzero(row)}
        for update in self.updates:
            for place, row in zip(update.rows, update.matrix, strict=True):
                reads[self.discretes[place]] |= {columns[k] for k in np.flatnonzero(row)}
        seen = {columns[k] for n in outputs for k in np.flatnonzero(self.signals[n])}
        moves: dict[str, set[str]] = {n: set() for n in columns}
        for name, sources in reads.items():
            for source in sources:
                moves[source].add(name)
        return _reached(set(inputs), moves) & _reached(seen, reads)

    def _without(self, dropped: set[str]) -> LinearBlocks:
        """Return the blocks without the rows of some states, whose columns `_from` removes."""
        states = [i for i, n in enumerate(self.states) if n not in dropped]
        discretes = [i for i, n in enumerate(self.discretes) if n not in dropped]
        places = {old: new for new, old in enumerate(discretes)}
        updates = []
        for update in self.updates:
            kept = [i for i, row in enumerate(update.rows) if row in places]
            rows = tuple(places[update.rows[i]] for i in kept)
            if rows:
                updates.append(replace(update, rows=rows, matrix=update.matrix[kept]))
        return replace(
            self,
            states=tuple(self.states[i] for i in states),
            discretes=tuple(self.discretes[i] for i in discretes),
            rates=self.rates[states],
            updates=tuple(updates),
        )

    def _from(self, before: LinearBlocks) -> LinearBlocks:
        """Arrange columns, which are still those of other blocks, as the names say."""
        places = {name: k for k, name in enumerate(before.columns)}
        width = len(places)
        order = [places.get(name, width) for name in self.columns]

        def arranged(matrix: Array) -> Array:
            padded = np.hstack([matrix, np.zeros((len(matrix), 1))])
            return np.asarray(padded[:, order])

        names = list(self.signals)
        rows = arranged(np.array(list(self.signals.values())).reshape(len(names), width))
        signals = dict(zip(names, rows, strict=True))
        fresh = [name for name in self.inputs if name not in places]
        for name in fresh:
            signals[name] = np.array([float(column == name) for column in self.columns])
        return replace(
            self,
            rates=arranged(self.rates),
            updates=tuple(replace(u, matrix=arranged(u.matrix)) for u in self.updates),
            signals=signals,
        )


def _reached(start: set[str], follows: Mapping[str, set[str]]) -> set[str]:
    reached = set(start)
    waiting = list(start)
    while waiting:
        for name in follows[waiting.pop()] - reached:
            reached.add(name)
            waiting.append(name)
    return reached


def _listed(names: Sequence[str] | Mapping[str, object]) -> str:
    shown = list(names)
    more = "" if len(shown) <= _MOST_LISTED else f" and {len(shown) - _MOST_LISTED} more"
    return ", ".join(shown[:_MOST_LISTED]) + more


_MOST_LISTED = 12


@uninterrupted()
def jacobians(graph: Graph) -> ca.Function:
    """Return the Jacobians of all laws by states, discrete states and inputs, as a function."""
    moving = ca.vertcat(graph.states, graph.discretes, graph.inputs)
    laws = [graph.rates, graph.outputs, *graph.updates]
    matrices = [ca.densify(ca.jacobian(law, moving)) for law in laws]
    return ca.Function("jacobians", graph.arguments, ca.cse(matrices))


@uninterrupted()
def blocks_of(
    graph: Graph, point: OperatingPoint, function: ca.Function | None = None
) -> LinearBlocks:
    """Linearise a traced component or a fused system about an operating point.

    Parameters
    ----------
    graph : Graph
    point : OperatingPoint
    function : casadi.Function, optional
        Its Jacobians, where they are made once for several points.

    Returns
    -------
    LinearBlocks

    Raises
    ------
    UserError
        If a derivative is not finite there.
    """
    layout = graph.layout
    states, discretes, inputs = (
        tuple(variable.name for variable in group)
        for group in (layout.states, layout.discretes, layout.inputs)
    )
    matrices = (function or jacobians(graph)).call(point.arguments(graph))
    rates, outputs, *sampled = (matrix.full() for matrix in matrices)
    updates = _updates(graph, point, sampled)
    columns = (*states, *discretes, *inputs)
    signals = dict(zip(columns, np.eye(len(columns)), strict=True))
    signals |= {f"der({name})": row for name, row in zip(states, rates, strict=True)}
    for update in updates:
        names = (f"next({discretes[place]})" for place in update.rows)
        signals |= zip(names, update.matrix, strict=True)
    signals |= {v.name: row for v, row in zip(layout.outputs, outputs, strict=True)}
    for name, row in signals.items():
        if not np.isfinite(row).all():
            column = columns[int(np.flatnonzero(~np.isfinite(row))[0])]
            raise UserError(
                f"{graph.name}: {name} has no finite derivative with respect to {column}"
                f" {point.words}"
            )
    return LinearBlocks(states, discretes, inputs, rates, updates, signals)


def _updates(
    graph: Graph, point: OperatingPoint, matrices: Sequence[Array]
) -> tuple[SampledUpdate, ...]:
    """Return the updates of all clocks.

    Parameters
    ----------
    graph : Graph
    point : OperatingPoint
    matrices : sequence of ndarray, shape (discretes, n)
        The discrete states after a sample, by clocks.
    """
    layout = graph.layout
    place_of = {discrete.name: k for k, discrete in enumerate(layout.discretes)}
    updates = []
    for (clock, members), matrix in zip(layout.sampled, matrices, strict=True):
        period = point.seconds(clock.period)
        shift = sum(point.seconds(name) for name in clock.shift)
        rows = tuple(place_of[member.name] for member in members)
        updates.append(SampledUpdate(str(clock.period), period, shift, rows, matrix[list(rows)]))
    return tuple(updates)
