"""Jacobians of a model about an operating point, before discretisation.

A model has continuous states x, discrete states d that are sampled by clocks, and inputs u. In
deviations from the operating point,

    dx/dt = R (x, d, u),    y = S (x, d, u),    d = U_i (x, d, u) at the instants of clock i,

where R, S and U_i are matrices with a column for each element of x, d and u. To prescribe a state,
to cut a loop at a state and to remove states that are on no path are operations on these matrices.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import compress
from operator import or_
from typing import Any

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.declare import ONCE
from fmus.kit.errors import UserError, suggestion
from fmus.kit.interrupt import uninterrupted
from fmus.kit.symbolic import Graph
from orchestration.linear.operating_point import OperatingPoint, listed
from orchestration.reporting import option
from orchestration.system import Connection, Port

_MOST_LISTED = 12  # names in a message


@dataclass(frozen=True)
class SampledUpdate:
    """Update of discrete states at the samples of a clock.

    Attributes
    ----------
    clock : str
        Name of the period, for messages.
    period, shift : float
        Sample k is at shift + k period, s.
    rows : tuple of int
        Indices of the states among the discrete states.
    matrix : ndarray, shape (len(rows), n)
        Map of all columns to the states after the sample.
    """

    clock: str
    period: float
    shift: float
    rows: tuple[int, ...]
    matrix: Array


@dataclass(frozen=True)
class LinearBlocks:
    """Matrices of a linearised model.

    Attributes
    ----------
    states, discretes, inputs : tuple of str
        Names of the n columns of every matrix, in this order.
    rates : ndarray, shape (states, n)
        Derivatives of the continuous states with respect to time, per second.
    updates : tuple of SampledUpdate
    signals : dict of str to ndarray, shape (n,)
        Every signal that can be an output: outputs, inputs, states, ``der(state)``, and
        ``next(state)``, a discrete state after the sample.
    """

    states: tuple[str, ...]
    discretes: tuple[str, ...]
    inputs: tuple[str, ...]
    rates: Array
    updates: tuple[SampledUpdate, ...]
    signals: dict[str, Array]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of every matrix."""
        return (*self.states, *self.discretes, *self.inputs)

    def prescribing(self, names: Sequence[str]) -> LinearBlocks:
        """Return the blocks with some states as inputs, without the laws of these states."""
        states = [n for n in names if n in (*self.states, *self.discretes)]
        blocks = self._without(set(states))
        return replace(blocks, inputs=(*self.inputs, *states))._with_columns_from(self)

    def cut_at(self, state: str) -> LinearBlocks:
        """Return the blocks of a loop that is cut at a state.

        The new input ``cut(state)`` replaces the state in every law except that of the state
        itself, like a cut behind an integrator or a hold.
        """
        blocks = replace(self, inputs=(*self.inputs, f"cut({state})"))._with_columns_from(self)
        column = self.columns.index(state)
        laws_of_state = {state, f"der({state})", f"next({state})"}

        def rewired(names: Iterable[str], rows: Iterable[Array]) -> Array:
            """Read the new input instead of the state, except in laws of the state."""
            matrix = np.array([*rows]).reshape(-1, len(blocks.columns))
            others = [name not in laws_of_state for name in names]
            matrix[others, -1] = matrix[others, column]
            matrix[others, column] = 0.0
            return matrix

        updates = tuple(
            replace(u, matrix=rewired([self.discretes[row] for row in u.rows], u.matrix))
            for u in blocks.updates
        )
        signals = rewired(blocks.signals, blocks.signals.values())
        return replace(
            blocks,
            rates=rewired(blocks.states, blocks.rates),
            updates=updates,
            signals=dict(zip(blocks.signals, signals, strict=True)),
        )

    def connected(self, connections: Sequence[Connection], step: float = 0.0) -> LinearBlocks:
        """Return the blocks with connected inputs, which are no longer free.

        With a communication step they are constant over it, which is a master with Jacobi's method:
        at each communication point all inputs take the outputs of that point, including outputs
        that depend on inputs. The inputs u at a point solve ``u = F u + R z`` with the feedthrough
        F of the connected outputs and all other columns z.

        Parameters
        ----------
        connections : sequence of Connection
            Those whose ends are not both among inputs and signals, as real ones are, do not count.
        step : float
            Communication step, s; 0 for inputs that follow the outputs at all times.

        Returns
        -------
        LinearBlocks
            With a step the connected inputs are discrete states.

        Raises
        ------
        UserError
            If an algebraic loop has no solution.
        """
        received = {
            str(c.target): c.factor * self.signals[str(c.source)]
            for c in connections
            if str(c.source) in self.signals and str(c.target) in self.inputs
        }
        return self._following(received, step)

    def fed_by(self, inputs: Mapping[str, Sequence[str | Port]]) -> LinearBlocks:
        """Return the blocks with new inputs, each with what it feeds; others are left out."""
        sources = {str(fed): name for name, ends in inputs.items() for fed in ends}
        known = {fed: name for fed, name in sources.items() if fed in self.inputs}
        new = dict.fromkeys(known.values())
        blocks = replace(self, inputs=(*self.inputs, *new))._with_columns_from(self)
        return blocks._following({fed: blocks.signals[name] for fed, name in known.items()})

    def _following(self, received: Mapping[str, Array], step: float = 0.0) -> LinearBlocks:
        """Return the blocks with inputs that receive what is in a row, shape (n,).

        With a communication step, s, they keep it for the step, as discrete states.
        """
        names = tuple(received)
        width = len(self.columns)
        connected = [self.columns.index(name) for name in names]
        rows = np.array(list(received.values())).reshape(len(names), width)
        loop_matrix = np.eye(len(names)) - rows[:, connected]  # I - F
        if names and np.linalg.cond(loop_matrix) > 1.0 / np.finfo(float).eps:
            raise UserError(f"{', '.join(names)}: an algebraic loop without a solution")
        rows[:, connected] = 0.0  # R
        solution = np.linalg.solve(loop_matrix, rows)
        substitution = np.eye(width)
        substitution[connected] = solution
        followed = self._times(substitution)
        inputs = tuple(name for name in self.inputs if name not in received)
        if not step:
            return replace(followed, inputs=inputs)._with_columns_from(self)
        first = len(self.discretes)
        indices = tuple(range(first, first + len(names)))
        exchange = SampledUpdate("the communication step", step, 0.0, indices, solution)
        blocks = replace(
            self,
            inputs=inputs,
            discretes=(*self.discretes, *names),
            updates=(exchange, *self.updates),
            signals=followed.signals,
        )
        return blocks._with_columns_from(self)

    def between(self, inputs: Sequence[str], outputs: Sequence[str]) -> LinearBlocks:
        """Return the blocks with only these inputs and the states between them and these outputs.

        A state is between them if it depends on an input and an output depends on it.

        Raises
        ------
        UserError
            If there is no such input or output.
        """
        for name in inputs:
            if name not in self.inputs:
                known = (*self.inputs, *self.states, *self.discretes)
                raise UserError(
                    f"{option('inputs', [name])}: no input or state of this name"
                    f"{_advice(name, known)}"
                )
        for name in outputs:
            if name not in self.signals:
                raise UserError(
                    f"{option('outputs', [name])}: no signal of this name"
                    f"{_advice(name, self.signals)}"
                )
        others = {*self.states, *self.discretes} - self._on_path(inputs, outputs)
        return replace(self._without(others), inputs=tuple(inputs))._with_columns_from(self)

    def _on_path(self, inputs: Sequence[str], outputs: Sequence[str]) -> set[str]:
        """Return the names of columns that depend on an input and on which an output depends."""
        columns = np.array(self.columns)
        depends = np.eye(len(columns), dtype=bool)  # row on column
        depends[: len(self.states)] |= self.rates != 0.0
        for update in self.updates:
            depends[[len(self.states) + row for row in update.rows]] |= update.matrix != 0.0
        reach = np.linalg.matrix_power(depends, len(columns))
        ends = np.any([self.signals[name] != 0.0 for name in outputs], axis=0)
        return {*columns[(reach @ np.isin(columns, inputs)) & (ends @ reach)].tolist()}

    def _without(self, dropped: set[str]) -> LinearBlocks:
        """Return the blocks without the rows of some states, but still with their columns."""
        discretes = tuple(name for name in self.discretes if name not in dropped)
        updates = []
        for update in self.updates:
            kept = [self.discretes[row] in discretes for row in update.rows]
            names = [self.discretes[row] for row in compress(update.rows, kept)]
            if names:
                rows = tuple(discretes.index(name) for name in names)
                updates.append(replace(update, rows=rows, matrix=update.matrix[kept]))
        return replace(
            self,
            states=tuple(name for name in self.states if name not in dropped),
            discretes=discretes,
            rates=self.rates[[name not in dropped for name in self.states]],
            updates=tuple(updates),
        )

    def _with_columns_from(self, source: LinearBlocks) -> LinearBlocks:
        """Return the blocks with their matrices rearranged from the columns of the source.

        Columns are reordered or dropped, and zero for new names. A new input is a signal as well.
        """
        columns = np.array(self.columns, dtype=object)
        known = np.array(source.columns, dtype=object)
        blocks = self._times(np.equal.outer(known, columns).astype(float))
        rows = zip(self.columns, np.eye(len(columns)), strict=True)
        new = {*self.inputs} - {*source.columns}
        return replace(blocks, signals=blocks.signals | {n: row for n, row in rows if n in new})

    def _times(self, matrix: Array) -> LinearBlocks:
        """Return the blocks with all their matrices times one, from their columns to others."""
        return replace(
            self,
            rates=self.rates @ matrix,
            updates=tuple(replace(u, matrix=u.matrix @ matrix) for u in self.updates),
            signals={name: row @ matrix for name, row in self.signals.items()},
        )


def joined(parts: Sequence[LinearBlocks]) -> LinearBlocks:
    """Return the blocks of models side by side, whose names differ."""
    names: dict[str, Any] = {
        kind: tuple(name for part in parts for name in getattr(part, kind))
        for kind in ("states", "discretes", "inputs")
    }
    wide = [replace(part, **names)._with_columns_from(part) for part in parts]
    updates = [
        replace(u, rows=tuple(names["discretes"].index(part.discretes[row]) for row in u.rows))
        for part, one in zip(parts, wide, strict=True)
        for u in one.updates
    ]
    signals = reduce(or_, (one.signals for one in wide))
    rates = np.vstack([one.rates for one in wide])
    return LinearBlocks(**names, rates=rates, updates=tuple(updates), signals=signals)


def _advice(name: str, known: Collection[str]) -> str:
    """Return the end of a message on an unknown name: similar names, or else the first ones."""
    names = list(known)
    return suggestion(name, names) or f"; there are {listed(names, _MOST_LISTED)}"


@uninterrupted()
def jacobians(graph: Graph) -> ca.Function:
    """Return the function of the Jacobians of all laws with respect to states and inputs."""
    variables = ca.vertcat(graph.states, graph.discretes, graph.inputs)
    laws = [graph.rates, graph.outputs, *graph.updates]
    matrices = [ca.densify(ca.jacobian(law, variables)) for law in laws]
    return ca.Function("jacobians", graph.arguments, ca.cse(matrices))


@uninterrupted()
def blocks_of(
    graph: Graph, point: OperatingPoint, function: ca.Function | None = None
) -> LinearBlocks:
    """Return the blocks of a component or a fused system about an operating point.

    Parameters
    ----------
    graph : Graph
    point : OperatingPoint
    function : casadi.Function, optional
        Result of `jacobians`, to use it at several points.

    Returns
    -------
    LinearBlocks

    Raises
    ------
    UserError
        If a derivative is not finite there.
    """
    layout = graph.layout
    states = tuple(v.name for v in layout.states)
    discretes = tuple(v.name for v in layout.discretes)
    inputs = tuple(v.name for v in layout.inputs)
    function = function or jacobians(graph)
    rates, outputs, *sampled = (m.full() for m in function.call(point.arguments(graph)))
    half = _half_between_samples(graph, point)
    if half:  # rates act over the time between samples, which its middle stands for
        rates = function.call(replace(point, time=point.time - half).arguments(graph))[0].full()
    updates = _updates(graph, point, sampled)
    columns = (*states, *discretes, *inputs)
    signals = dict(zip(columns, np.eye(len(columns)), strict=True))
    signals |= {f"der({name})": row for name, row in zip(states, rates, strict=True)}
    for update in updates:
        names = (f"next({discretes[place]})" for place in update.rows)
        signals |= zip(names, update.matrix, strict=True)
    signals |= {v.name: row for v, row in zip(layout.outputs, outputs, strict=True)}
    blocks = LinearBlocks(states, discretes, inputs, rates, updates, signals)
    check_finite(blocks, graph.name, point)
    return blocks


def _half_between_samples(graph: Graph, point: OperatingPoint) -> float:
    """Return half the period, s, of the register of a delay, which laws read at its age; else 0."""
    periods = [
        point.seconds(clock.period)
        for clock, members in graph.layout.sampled
        if any(member.is_memory for member in members)
    ]
    return 0.5 * min((period for period in periods if period != ONCE), default=0.0)


def check_finite(blocks: LinearBlocks, model: str, point: OperatingPoint) -> None:
    """Raise UserError if a derivative of a signal is not finite."""
    for name, row in blocks.signals.items():
        for column, derivative in zip(blocks.columns, row, strict=True):
            if not np.isfinite(derivative):
                raise UserError(
                    f"{model}: {name} has no finite derivative with respect to {column}"
                    f" {point.words}"
                )


def _updates(
    graph: Graph, point: OperatingPoint, matrices: Sequence[Array]
) -> tuple[SampledUpdate, ...]:
    """Return the updates of all clocks, from a matrix of all discrete states for each clock.

    What is sampled once, at the start, is constant behind it.
    """
    layout = graph.layout
    place_of = {discrete.name: k for k, discrete in enumerate(layout.discretes)}
    updates = []
    for (clock, members), matrix in zip(layout.sampled, matrices, strict=True):
        period = point.seconds(clock.period)
        if period == ONCE:
            continue
        shift = sum(point.seconds(name) for name in clock.shift)
        rows = tuple(place_of[member.name] for member in members)
        updates.append(SampledUpdate(str(clock.period), period, shift, rows, matrix[list(rows)]))
    return tuple(updates)
