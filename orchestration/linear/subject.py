"""What is linearised by its equations: a component, or a system of components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np

from fmus.kit import Component
from fmus.kit.declare import Declaration
from fmus.kit.errors import UserError, suggestion
from fmus.kit.record import CompiledModel
from fmus.kit.symbolic import Graph, trace
from orchestration.linear.blocks import LinearBlocks, blocks_of, jacobians
from orchestration.linear.discretisation import assemble
from orchestration.linear.model import LinearModel
from orchestration.linear.operating_point import OperatingPoint, with_outputs
from orchestration.master.reference import fuse
from orchestration.reporting import option
from orchestration.system import Connection, System

_BY_LAWS = "Jacobians of the laws"


@dataclass(frozen=True)
class LinearSubject:
    """The equations that are linearised.

    Attributes
    ----------
    name : str
    graph : Graph
    outputs : dict of str to str
        The signal that each output is: itself of a component, ``member.variable`` of a system.
    system : System, optional
    cls : type[Component], optional
        The class of a component.
    """

    name: str
    graph: Graph
    outputs: dict[str, str]
    system: System | None = None
    cls: type[Component] | None = None
    _opened: dict[tuple[tuple[Connection, ...], bool], tuple[Graph, ca.Function]] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs that are real numbers."""
        return _real(self.graph.layout.inputs)

    @property
    def units(self) -> dict[str, str]:
        """Units of all signals by name."""
        units = {v.name: v.unit for v in self.graph.layout.variables}
        units |= dict(self.graph.layout.derivatives)
        units |= {f"next({v.name})": v.unit for v in self.graph.layout.discretes}
        for member in self.system.members if self.system else ():
            declared = member.cls.layout.inputs if member.cls else ()
            units |= {f"{member.name}.{v.name}": v.unit for v in declared}
        return units | {name: units[signal] for name, signal in self.outputs.items()}

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
            Inputs, and states that are prescribed: their own laws do not count then. All inputs
            unless given.
        outputs : sequence of str
            Outputs, states, ``der(state)`` and ``next(state)``. All outputs unless given.
        step : float
            Communication step, s, over which inputs are held, connected ones included; 0 of a
            continuous exchange.

        Returns
        -------
        LinearModel

        Raises
        ------
        UserError
            If there is no signal of a name, a derivative is not finite, or the clocks have no
            common hyper-period.
        """
        chosen_inputs = list(inputs or self.inputs)
        chosen_outputs = list(outputs or self.outputs)
        named = self._named(self._blocks(point, (), step)).prescribing(chosen_inputs)
        blocks = named.between(chosen_inputs, chosen_outputs)
        return LinearModel(
            self.name,
            assemble(blocks, chosen_outputs, step),
            tuple(chosen_inputs),
            tuple(chosen_outputs),
            self.units,
            self._complete(point),
            _BY_LAWS,
            notes=_notes(point),
        )

    def _complete(self, point: OperatingPoint) -> OperatingPoint:
        """Return an operating point with outputs, by the names of the system, too."""
        point = with_outputs(self.graph, point)
        named = {name: point.values[signal] for name, signal in self.outputs.items()}
        return replace(point, outputs=named | point.outputs)

    def _named(self, blocks: LinearBlocks) -> LinearBlocks:
        """Return blocks whose signals have the names of the system's outputs, too."""
        known = blocks.signals
        added = {name: known[signal] for name, signal in self.outputs.items() if name not in known}
        return replace(blocks, signals=known | added)

    def _blocks(
        self, point: OperatingPoint, cut_ones: Sequence[Connection], step: float
    ) -> LinearBlocks:
        """Return the blocks without some connections, the others held over a step if any."""
        if self.system is None or not (step or cut_ones):
            return blocks_of(*self._part((), False, point))
        values = self._complete(point).values
        connections = self.system.connections
        received = {str(c.target): c.factor * values[str(c.source)] + c.offset for c in connections}
        at = replace(point, inputs=point.inputs | received)
        blocks = blocks_of(*self._part(tuple(cut_ones), step > 0.0, at))
        kept = [c for c in connections if c not in cut_ones]
        return blocks.exchanging(kept, step) if step else blocks

    def _part(
        self, cut_ones: tuple[Connection, ...], apart: bool, point: OperatingPoint
    ) -> tuple[Graph, OperatingPoint, ca.Function]:
        """Return a graph without some or all connections, a point, and its Jacobians, made once."""
        key = (cut_ones, apart)
        if key not in self._opened:
            graph = self.graph
            if self.system and (cut_ones or apart):
                gone = self.system.connections if apart else cut_ones
                kept = tuple(c for c in self.system.connections if c not in gone)
                graph = fuse(replace(self.system, connections=kept))
            self._opened[key] = graph, jacobians(graph)
        graph, function = self._opened[key]
        return graph, point, function

    @cached_property
    def compiled(self) -> CompiledModel:
        """The equations compiled for this machine, to simulate up to operating points."""
        return CompiledModel(self.graph)

    def loop(self, point: OperatingPoint, cut: str, step: float = 0.0) -> LinearModel:
        """Return the loop transfer function of the loop that is cut at a signal.

        It is what comes back to the cut for what is fed behind it, with its sign changed: where the
        loop closes by negative feedback, one plus it has the poles of the closed loop as zeros.

        Parameters
        ----------
        point : OperatingPoint
        cut : str
            A state, or of a system a connected input or an output that is connected.
        step : float
            As in `linearise`.

        Returns
        -------
        LinearModel

        Raises
        ------
        UserError
            If there is no such signal, or nothing is connected to it.
        """
        fed_name = f"cut({cut})"
        cut_ones = self._connections(cut)
        if cut_ones:
            blocks = self._blocks(point, cut_ones, step)
            fed = {str(c.target): c.factor for c in cut_ones}
            back = str(cut_ones[0].source)
        else:
            self._check_state(cut)
            blocks = self._blocks(point, (), step).cut_at(cut)
            fed = {fed_name: 1.0}
            back = cut
        kept = blocks.between(list(fed), [back])
        matrices = assemble(kept, [back], step)
        factors = np.array(list(fed.values()))[:, None]
        turned = replace(matrices, B=matrices.B @ factors, C=-matrices.C, D=-matrices.D @ factors)
        notes = _notes(point)
        if matrices.period and any(kept.rates[:, -len(fed) :].ravel()):
            notes += (
                f"{cut} is read between samples, too: behind the cut it is held for"
                f" {matrices.period:g} s, which is another loop than the closed one; cut at a"
                " signal that is only sampled",
            )
        if not matrices.states and not matrices.D.any():
            notes += (f"nothing comes back to the cut: no loop goes through {cut} here",)
        units = self.units | {fed_name: self.units.get(cut, self.units.get(back, ""))}
        return LinearModel(
            self.name,
            turned,
            (fed_name,),
            (back,),
            units,
            self._complete(point),
            _BY_LAWS,
            loop=cut,
            notes=notes,
        )

    def _connections(self, cut: str) -> list[Connection]:
        """Return the connections to an input or from an output."""
        connections = self.system.connections if self.system else ()
        return [c for c in connections if cut in (str(c.source), str(c.target))]

    def _check_state(self, cut: str) -> None:
        layout = self.graph.layout
        if cut in [v.name for v in (*layout.states, *layout.discretes)]:
            return
        connections = self.system.connections if self.system else ()
        known = [*(str(c.target) for c in connections), *(v.name for v in layout.variables)]
        advice = f"; connections are {', '.join(map(_arrow, connections))}" if connections else ""
        raise UserError(
            f"{self.name}: {option('cut', cut)}: no state and no connection of this name"
            f"{suggestion(cut, known)}{advice}"
        )


def _arrow(connection: Connection) -> str:
    return f"{connection.source} -> {connection.target}"


def _notes(point: OperatingPoint) -> tuple[str, ...]:
    lines = [
        f"{name} is not determined by the equilibrium; it stays at {point.values[name]:.6g}"
        for name in point.undetermined
    ]
    lines += [f"{name} drifts by {rate:.6g} per second" for name, rate in point.drift.items()]
    return tuple(lines)


def _real(variables: Sequence[Declaration]) -> list[str]:
    return [v.name for v in variables if v.type == "real"]


def subject_of(model: type[Component] | System, name: str = "") -> LinearSubject:
    """Return what is linearised of a component or of a system of components.

    Parameters
    ----------
    model : type[Component] or System
    name : str
        For messages and results; its own unless given.

    Raises
    ------
    UserError
        If a component has no laws, or a system cannot be fused.
    """
    if isinstance(model, System):
        for member in model.members:
            if member.cls is not None:
                _check_laws(member.cls, f"system {model.name}: {member.name}")
        graph = fuse(model)
        outputs = {alias: str(port) for alias, port in model.outputs.items()}
        return LinearSubject(name or model.name, graph, outputs, model)
    _check_laws(model, name or model.name)
    graph = trace(model)
    outputs = {n: n for n in _real(model.layout.measurable)}
    return LinearSubject(name or model.name, graph, outputs, cls=model)


def _check_laws(cls: type[Component], name: str) -> None:
    if cls.engine is not None:
        raise UserError(
            f"{name} is computed by an engine, such as a rig at the end of a cable, and has no laws"
            " to linearise"
        )
