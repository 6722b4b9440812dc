"""A component as a Modelica model: its variables, the connectors of its ports and its laws."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from fmus.kit.component import Component
from fmus.kit.declare import summary
from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import Clock, Layout
from fmus.kit.modelica.annotations import annotation
from fmus.kit.modelica.connectors import port_equations
from fmus.kit.modelica.declarations import declarations, declared_identifiers
from fmus.kit.modelica.equations import Definition, EquationSet, define
from fmus.kit.modelica.expressions import ExpressionNode, apply, constant, symbol
from fmus.kit.modelica.names import (
    class_name,
    comment,
    identifier,
    indented,
    modification,
    real,
    string,
    wrapped,
)
from fmus.kit.modelica.registers import Register, registers
from fmus.kit.symbolic import (
    Graph,
    carry_out,
    recorded_intermediates,
    trace_with_laws,
    units_of_laws,
)
from fmus.kit.units import to_modelica


@uninterrupted()
def trace_model(cls: type[Component]) -> TracedModel:
    """Trace the laws of a component, of which a Modelica model is written.

    Parameters
    ----------
    cls : type[Component]
        A component with laws, possibly with effects stacked on it.

    Returns
    -------
    TracedModel
    """
    with recorded_intermediates() as intermediates:
        graph, laws = trace_with_laws(cls)
    return TracedModel(cls, graph, laws, intermediates)


@dataclass(frozen=True)
class TracedModel:
    """A component with its graph, from which the model is written.

    Attributes
    ----------
    cls : type[Component]
    graph : Graph
    laws : Mapping of str to casadi.SX
        Value of each law.
    intermediates : sequence of tuple
        Names and expressions of intermediate values of laws.
    """

    cls: type[Component]
    graph: Graph
    laws: Mapping[str, ca.SX]
    intermediates: Sequence[tuple[str, ca.SX]]

    @property
    def layout(self) -> Layout:
        """Variables of the component."""
        return self.graph.layout

    @cached_property
    def registers(self) -> list[Register]:
        """Shift registers, which are arrays."""
        return registers(self.graph)

    @cached_property
    def texts(self) -> dict[str, str]:
        """Text of each variable by its name."""
        texts = {v.name: identifier(v.name) for v in self.layout.variables}
        for register in self.registers:
            texts |= register.elements
        return texts

    @cached_property
    def units(self) -> dict[str, str]:
        """Unit of each law that has one."""
        layout = self.layout
        laws = [s.rate for s in layout.states] + [d.update for d in layout.discretes]
        return units_of_laws(self.cls, [*laws, *(o.name for o in layout.outputs)])

    @uninterrupted()
    def text(self) -> str:
        """Write the class, without the ``within`` clause.

        Raises
        ------
        UserError
            If a law calls a function that Modelica does not have.
        """
        taken = declared_identifiers(self.cls)
        for register in self.registers:
            taken |= {register.array, f"{register.name}_start"}
        numbers = range(1, self.graph.indicators.numel() + 1)
        events = [identifier(f"event_{k}", taken) for k in numbers]
        taken.update(events)
        continuous = self._continuous(taken, events)
        sampled = [self._sampled(k, taken) for k in range(len(self.layout.sampled))]
        protected = [self.auxiliary(a) for a in continuous.auxiliaries]
        for part in sampled:
            protected += [self.auxiliary(a, is_sampled=True) for a in part.auxiliaries]
        protected += [f"Boolean {name};" for name in events]
        name = class_name(self.cls.name)
        lines = [
            f"{'model' if self.cls.ports else 'block'} {name}{comment(summary(self.cls))}",
            *indented(declarations(self.cls, registers=self.registers)),
            *(["protected"] if protected else []),
            *indented(protected),
            "equation",
            *(line for port in self.cls.ports for line in wrapped(port_equations(port))),
            *wrapped(continuous.lines),
        ]
        for (clock, _), part in zip(self.layout.sampled, sampled, strict=True):
            condition = f"  when {_sample_condition(clock)} then"
            lines += [condition, *wrapped(part.lines, "    "), "  end when;"]
        lines += [f"  {annotation(self.cls)}", f"end {name};"]
        return "\n".join(lines) + "\n"

    def auxiliary(self, auxiliary: Definition, is_sampled: bool = False) -> str:
        """Declare an auxiliary variable, which starts at zero if it is sampled."""
        attributes = {"start": "0.0", "fixed": "true"} if is_sampled else {}
        unit = self.units.get(auxiliary.law, "")
        if unit and unit != "1":
            attributes["unit"] = string(to_modelica(unit))
        about = summary(getattr(self.cls, auxiliary.law)) if auxiliary.law else ""
        return f"Real {auxiliary.text}{modification(attributes)}{comment(about)};"

    def _continuous(self, taken: set[str], events: Sequence[str]) -> EquationSet:
        """Write the equations of rates, outputs and events.

        Branches of laws are chosen at every point, without events. So that a solver restarts where
        they switch, the signs of the event indicators are Boolean variables.
        """
        layout = self.layout
        graph = self.graph
        types = {
            **{f"der({identifier(s.name)})": "real" for s in layout.states},
            **{identifier(o.name): o.type for o in layout.outputs},
            **dict.fromkeys(events, "boolean"),
        }
        right = ca.vertcat(graph.rates, graph.outputs, graph.indicators > 0.0)
        return self.equations(types, right, self.texts, taken, literal=True)

    def _sampled(self, group: int, taken: set[str]) -> EquationSet:
        """Write the equations of one clock.

        They use inputs and discrete states from before the instant, but the new values of discrete
        states whose clocks are declared earlier.
        """
        layout = self.layout
        before = {d.name for _, members in layout.sampled[:group] for d in members}
        texts = dict(self.texts)
        for v in (*layout.inputs, *layout.discretes):
            if v.name not in before:
                texts[v.name] = f"pre({texts[v.name]})"
        shifted = {state for register in self.registers for state in register.states[1:]}
        members = {d.name for d in layout.sampled[group][1]} - shifted
        places = [k for k, d in enumerate(layout.discretes) if d.name in members]
        types = {self.texts[d.name]: d.type for d in layout.discretes if d.name in members}
        part = self.equations(types, self.graph.updates[group][places], texts, taken)
        for register in self.registers:
            part.lines[:] = map(register.shifted, part.lines)
        return part

    def equations(
        self,
        types: Mapping[str, str],
        right: ca.SX,
        texts: Mapping[str, str],
        taken: set[str],
        literal: bool = False,
        operation: Callable[[int, list[ExpressionNode]], ExpressionNode] = apply,
    ) -> EquationSet:
        """Write equations, with auxiliary variables for laws and common subexpressions.

        Parameters
        ----------
        types : Mapping of str to str
            Type by left-hand side, in the order of the equations.
        right : casadi.SX
            Column of the right-hand sides, in the symbols of the graph.
        texts : Mapping of str to str
            Text of each variable by its name.
        taken : set of str
            Names in use; the names of auxiliary variables are added.
        literal : bool
            Whether relations within a Real are evaluated at every point, without events.
        operation : callable
            Returns the expression of an operation of CasADi.

        Returns
        -------
        EquationSet
        """
        layout = self.layout
        arguments = [[symbol("time")]]
        for group in layout.arguments:
            arguments.append([symbol(texts[v.name], v.type == "boolean") for v in group])
        laws = ca.vertcat(ca.SX(0, 1), *self.laws.values())
        intermediates = ca.vertcat(ca.SX(0, 1), *(value for _, value in self.intermediates))
        columns = ca.cse([ca.densify(column) for column in (right, laws, intermediates)])
        function = ca.Function("laws", self.graph.arguments, columns)
        nodes, of_laws, others = carry_out(function, arguments, constant, operation)
        targets = [
            Definition(text, type, node)
            for (text, type), node in zip(types.items(), nodes, strict=True)
        ]
        terms = zip((name for name, _ in self.intermediates), others, strict=True)
        names = _first_names(zip(self.laws, of_laws, strict=True))
        return define(targets, names, _first_names(terms), taken, literal)


def _first_names(pairs: Iterable[tuple[str, ExpressionNode]]) -> dict[ExpressionNode, str]:
    """Return the first name of each expression that is no leaf."""
    names: dict[ExpressionNode, str] = {}
    for name, node in pairs:
        if not node.is_leaf:
            names.setdefault(node, name)
    return names


def _sample_condition(clock: Clock) -> str:
    """Write the condition that is true at the instants of a clock."""
    period = identifier(clock.period) if isinstance(clock.period, str) else real(clock.period)
    shift = " + ".join(map(identifier, clock.shift)) or "0.0"
    return f"sample({shift}, {period})"
