"""Linearisation of models about operating points, and of components and systems by equations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from fmus.kit import Component
from fmus.kit.declare import Declaration
from fmus.kit.errors import UserError, suggestion
from fmus.kit.record import CompiledModel
from fmus.kit.symbolic import Graph, trace
from orchestration.linear.blocks import LinearBlocks, blocks_of, jacobians
from orchestration.linear.discretisation import Matrices, assemble
from orchestration.linear.model import LinearModel
from orchestration.linear.operating_point import OperatingPoint, rest_notes, with_outputs
from orchestration.master.reference import fuse
from orchestration.reporting import option
from orchestration.system import Connection, System

_SAME = 1e-9  # relative difference of periods due to rounding


@dataclass(frozen=True)
class LinearSubject(ABC):
    """A model that can be linearised, cut or not.

    Attributes
    ----------
    name : str
    outputs : Mapping of str to str
        Signal of the blocks by output: the same name for a component, ``member.variable`` for a
        system.
    system : System, optional
    inputs : sequence of str
        Names of the inputs that are real numbers.
    units : Mapping of str to str
        Units of all signals.
    nominal : Mapping of str to float
        Magnitudes of continuous states.
    method : str
        Origin of the derivatives.
    """

    name: str
    outputs: Mapping[str, str]
    system: System | None
    inputs: Sequence[str]
    units: dict[str, str]
    nominal: Mapping[str, float]
    method: str

    @property
    def connections(self) -> tuple[Connection, ...]:
        """Connections of a system."""
        return self.system.connections if self.system else ()

    def complete(self, point: OperatingPoint) -> OperatingPoint:
        """Return an operating point with outputs and rates, also by their names in the system."""
        return point

    @abstractmethod
    def blocks(
        self, point: OperatingPoint, cuts: Sequence[Connection], step: float
    ) -> LinearBlocks:
        """Return the blocks about an operating point, without some connections.

        Parameters
        ----------
        point : OperatingPoint
        cuts : sequence of Connection
            Connections to remove; their targets become inputs.
        step : float
            Communication step of all other connections, s; 0 for a continuous exchange.
        """

    def linearise(
        self,
        point: OperatingPoint,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        step: float = 0.0,
    ) -> LinearModel:
        """Linearise about an operating point.

        Parameters
        ----------
        point : OperatingPoint
        inputs : sequence of str
            Inputs, and states to prescribe, whose laws are removed. All inputs if empty.
        outputs : sequence of str
            Outputs, states, ``der(state)`` and ``next(state)``. All outputs if empty.
        step : float
            Communication step, s, over which all inputs are constant, including connected ones; 0
            for a continuous exchange.

        Returns
        -------
        LinearModel

        Raises
        ------
        UserError
            If there is no input, no signal of a name, a derivative is not finite, or the clocks
            have no common hyper-period.
        """
        sources = tuple(inputs or self.inputs)
        targets = tuple(outputs or self.outputs)
        if not sources:
            raise UserError(
                f"{self.name}: has no real input; a linear model goes from inputs to outputs"
            )
        blocks = self._with_output_names(self.blocks(point, (), step)).prescribing(sources)
        path = blocks.between(sources, targets)
        return self._model(point, path, assemble(path, targets, step), sources, targets)

    def _with_output_names(self, blocks: LinearBlocks) -> LinearBlocks:
        """Return blocks whose signals also have their names as outputs of the system."""
        signals = dict(blocks.signals)
        for name, signal in self.outputs.items():
            signals.setdefault(name, signals[signal])
        return replace(blocks, signals=signals)

    def loop(self, point: OperatingPoint, cut: str, step: float = 0.0) -> LinearModel:
        """Return the loop transfer function L of a loop that is cut at a signal.

        L is the response of the signal before the cut to the signal behind it, with the opposite
        sign. With negative feedback the zeros of 1 + L are the poles of the closed loop.

        Parameters
        ----------
        point : OperatingPoint
        cut : str
            A state, or a connected input or output of a system.
        step : float
            Communication step, s, see `linearise`.

        Returns
        -------
        LinearModel

        Raises
        ------
        UserError
            If there is no such signal, or nothing is connected to it.
        """
        input = f"cut({cut})"
        cuts = [c for c in self.connections if cut in (str(c.source), str(c.target))]
        blocks = self.blocks(point, cuts, step)
        factors = {str(c.target): c.factor for c in cuts} or {input: 1.0}
        output = str(cuts[0].source) if cuts else cut
        if not cuts:
            self._check_state(blocks, cut)
            blocks = blocks.cut_at(cut)
        path = blocks.between(list(factors), [output])
        matrices = assemble(path, [output], step)
        # one input feeds all inputs behind the cut, each by its factor
        column = np.array(list(factors.values()))[:, None]
        loop = replace(matrices, B=matrices.B @ column, C=-matrices.C, D=-matrices.D @ column)
        model = self._model(point, path, loop, (input,), (output,))
        behind = model.point.values[output]
        if cut != output:
            behind = cuts[0].factor * behind + cuts[0].offset
        return replace(
            model,
            point=replace(model.point, inputs=model.point.inputs | {input: behind}),
            units=self.units | {input: self.units.get(cut, self.units.get(output, ""))},
            loop=cut,
            notes=(*model.notes, *_loop_notes(cut, path, loop, len(factors), step)),
        )

    def _model(
        self,
        point: OperatingPoint,
        path: LinearBlocks,
        matrices: Matrices,
        inputs: tuple[str, ...],
        outputs: tuple[str, ...],
    ) -> LinearModel:
        """Return the linear model of matrices about an operating point, with its notes."""
        there = self.complete(point)
        by_states = path.rates[:, : len(path.states)]
        notes = _notes(point)
        if not point.trimmed:
            notes += rest_notes(there, by_states, path.states, self.nominal, self.units)
        return LinearModel(
            self.name, matrices, inputs, outputs, self.units, there, self.method, notes=notes
        )

    def _check_state(self, blocks: LinearBlocks, cut: str) -> None:
        """Raise if there is no state of a name, or it is one of a realisation, without a unit."""
        if cut in (*blocks.states, *blocks.discretes) and cut in self.units:
            return
        known = [*(str(c.target) for c in self.connections), *self.units]
        listed = ", ".join(map(str, self.connections))
        advice = f"; connections are {listed}" if listed else ""
        raise UserError(
            f"{self.name}: {option('cut', cut)}: no state and no connection of this name"
            f"{suggestion(cut, known)}{advice}"
        )


@dataclass(frozen=True)
class Equations(LinearSubject):
    """Equations of a component or a system, for linearisation.

    Attributes
    ----------
    graph : Graph
    cls : type[Component], optional
        The class of a component.
    """

    graph: Graph
    cls: type[Component] | None = None

    def complete(self, point: OperatingPoint) -> OperatingPoint:
        """Return an operating point with outputs and rates, also by their names in the system."""
        computed = with_outputs(self.graph, point)
        named = {name: computed.values[signal] for name, signal in self.outputs.items()}
        return replace(computed, outputs=named | computed.outputs)

    def blocks(
        self, point: OperatingPoint, cuts: Sequence[Connection], step: float
    ) -> LinearBlocks:
        """Return the blocks about an operating point, without some connections."""
        if self.system is None or not (step or cuts):
            return blocks_of(self.graph, point, self._jacobians)
        # connected inputs are variables of a graph without connections
        values = self.complete(point).values
        inputs = {
            str(c.target): c.factor * values[str(c.source)] + c.offset for c in self.connections
        }
        blocks = self._apart.blocks(replace(point, inputs=point.inputs | inputs), (), 0.0)
        return blocks.connected([c for c in self.connections if c not in cuts], step)

    @cached_property
    def _jacobians(self) -> ca.Function:
        """Jacobians of the equations, for several operating points."""
        return jacobians(self.graph)

    @cached_property
    def _apart(self) -> Equations:
        """Equations of the members of a system without their connections."""
        assert self.system is not None
        graph = fuse(replace(self.system, connections=()))
        return replace(self, graph=graph, outputs={}, system=None)

    @cached_property
    def compiled(self) -> CompiledModel:
        """Compiled equations, for simulations up to operating points."""
        return CompiledModel(self.graph)


def _notes(point: OperatingPoint) -> tuple[str, ...]:
    """Return notes on undetermined and drifting states of an equilibrium, and on ranges."""
    lines = [
        f"{name} is not determined by the equilibrium; it stays at {point.values[name]:.6g}"
        for name in point.undetermined
    ]
    lines += [f"{name} drifts by {rate:.6g} per second" for name, rate in point.drift.items()]
    lines += [
        f"{name} is outside its range, {low:.6g} to {high:.6g}"
        for name, (low, high) in point.outside.items()
    ]
    return tuple(lines)


def real_names(variables: Sequence[Declaration]) -> list[str]:
    """Return the names of variables that are real numbers."""
    return [v.name for v in variables if v.type == "real"]


def _loop_notes(
    cut: str, path: LinearBlocks, loop: Matrices, count: int, step: float
) -> Iterator[str]:
    """Yield remarks on a loop that is cut at a signal, and whose path has that many inputs."""
    # what reads the inputs all the time does so once in a communication step, if there is one
    laws = [(step, path.rates), *((u.period, u.matrix) for u in path.updates)]
    faster = [matrix for period, matrix in laws if period < loop.period * (1.0 - _SAME)]
    if any(matrix[:, -count:].any() for matrix in faster):
        yield (
            f"{cut} also acts between samples, but behind the cut it is constant for"
            f" {loop.period:g} s, which is another loop than the closed one; cut at a"
            " signal that is only sampled"
        )
    if not loop.states and not loop.D.any():
        yield f"nothing comes back to the cut: no loop goes through {cut} here"


def subject_of(model: type[Component] | System, name: str = "") -> Equations:
    """Return the equations of a component or a system of components, for linearisation.

    Parameters
    ----------
    model : type[Component] or System
    name : str
        Name for messages and results; that of the model if empty.

    Returns
    -------
    Equations

    Raises
    ------
    UserError
        If a component has no laws, or a system cannot be fused.
    """
    if isinstance(model, System):
        for member in model.members:
            if member.cls is not None:
                _check_laws(member.cls, f"system {model.name}: {member.name}")
        outputs = {alias: str(port) for alias, port in model.outputs.items()}
        system, graph = model, fuse(model)
    else:
        _check_laws(model, name or model.name)
        outputs = {n: n for n in real_names(model.layout.measurable)}
        system, graph = None, trace(model)
    layout = graph.layout
    units = {v.name: v.unit for v in layout.variables} | dict(layout.derivatives)
    units |= {f"next({v.name})": v.unit for v in layout.discretes}
    for member in system.members if system else ():
        declared = member.cls.layout.inputs if member.cls else ()
        units |= {f"{member.name}.{v.name}": v.unit for v in declared}
    return Equations(
        name or model.name,
        outputs,
        system,
        inputs=real_names(layout.inputs),
        units=units | {alias: units[signal] for alias, signal in outputs.items()},
        nominal={v.name: v.nominal for v in layout.states},
        method="Jacobians of the laws",
        graph=graph,
        cls=None if isinstance(model, System) else model,
    )


def _check_laws(cls: type[Component], name: str) -> None:
    """Raise if a component has an engine in place of laws."""
    if cls.engine is not None:
        raise UserError(
            f"{name} is computed by an engine, such as a rig at the end of a cable, and has no laws"
            " to linearise"
        )
