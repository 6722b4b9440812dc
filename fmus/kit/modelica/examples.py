"""Modelica models of example systems: components on pins, flanges and signals, with sources.

A connection between variables of two ports connects their first connectors. The second connector of
a port, such as the fixed end of an actuator, is connected to the reference of its domain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from fmus.kit import registry
from fmus.kit.component import Component
from fmus.kit.declare import Declaration
from fmus.kit.errors import find
from fmus.kit.modelica.connectors import SIGNALS, reference_name, source_class
from fmus.kit.modelica.declarations import declaration, literal
from fmus.kit.modelica.graphics import placement, positions
from fmus.kit.modelica.model import trace_model
from fmus.kit.modelica.names import (
    PACKAGE,
    class_name,
    comment,
    identifier,
    indented,
    modification,
    real,
    wrapped,
)
from fmus.kit.ports import PowerPort

EXAMPLES = "Examples"  # name of their package
_INTERVALS = 500  # of the results of an example


def example_classes(classes: Sequence[type[Component]]) -> dict[str, str]:
    """Write the examples whose components a package has.

    Parameters
    ----------
    classes : sequence of type[Component]
        Components of the package.

    Returns
    -------
    dict of str to str
        Text of each class by its name, without the ``within`` clause: examples, and those of their
        members that are components of the package with effects.

    Raises
    ------
    UserError
        If a component, an effect, a member or a variable of an example is not known, or an input
        has no value.
    """
    texts: dict[str, str] = {}
    for example in registry.examples():
        declared = example.system.members
        if all(registry.component(d.component) in classes for d in declared.values()):
            members = {name: registry.member_class(d) for name, d in declared.items()}
            for cls in members.values():
                if cls not in classes:
                    texts[class_name(cls.name)] = trace_model(cls).text()
            texts[class_name(example.system.name)] = _Model(example, members).text()
    return texts


class _End(NamedTuple):
    """An end of a connection: a variable of a member.

    Attributes
    ----------
    member : str
    variable : Declaration
    port : PowerPort or None
        Port of the variable; None for a signal.
    """

    member: str
    variable: Declaration
    port: PowerPort | None

    @property
    def signal(self) -> str:
        """Reference to the variable."""
        return f"{identifier(self.member)}.{identifier(self.variable.name)}"

    @property
    def text(self) -> str:
        """Reference to the first connector of the port, or to the signal."""
        if not self.port:
            return self.signal
        return f"{identifier(self.member)}.{identifier(self.port.connectors[0])}"

    @property
    def is_flow(self) -> bool:
        """True if the variable is the flow of its port."""
        return self.port is not None and self.port.flow == self.variable.name


@dataclass(frozen=True)
class _Model:
    """An example with the classes of its members, from which the model is written."""

    example: registry.Example
    members: Mapping[str, type[Component]]

    @cached_property
    def inputs(self) -> dict[str, list[_End]]:
        """The inputs of members by the input of the system that they have."""
        declared = self.example.system.inputs
        return {name: [self._end(target) for target in ends] for name, ends in declared.items()}

    @cached_property
    def wires(self) -> list[tuple[_End, _End]]:
        """The connections of the system, from an output to an input."""
        wires = [wire.split(" -> ") for wire in self.example.system.connections]
        return [(self._end(output), self._end(input)) for output, input in wires]

    @cached_property
    def driven(self) -> list[tuple[str, _End]]:
        """The variables of ports that a source sets, each with the signal of the source."""
        inputs = [(identifier(name), end) for name, ends in self.inputs.items() for end in ends]
        signals = [(output.text, input) for output, input in self.wires if not output.port]
        return [(signal, end) for signal, end in (*inputs, *signals) if end.port]

    @cached_property
    def domains(self) -> dict[str, list[str]]:
        """The second connectors of ports by domain."""
        domains: dict[str, list[str]] = {}
        for member, cls in self.members.items():
            for port in cls.ports:
                for name in port.connectors[1:]:
                    end = f"{identifier(member)}.{identifier(name)}"
                    domains.setdefault(port.domain, []).append(end)
        return domains

    def text(self) -> str:
        """Write the class."""
        system = self.example.system
        name = class_name(system.name)
        times = f"StopTime={real(system.stop)}, Interval={real(system.stop / _INTERVALS)}"
        tolerance = real(min(cls.tolerance for cls in self.members.values()))
        lines = [f"model {name}{comment(system.summary.rstrip('.'))}", *indented(self._inputs())]
        lines += [*_row(self._members(), 40), *_row(self._sources(), -40)]
        lines += [
            "equation",
            *indented(self._connections()),
            f"  annotation(experiment({times}, Tolerance={tolerance}));",
            f"end {name};",
        ]
        return "\n".join(lines) + "\n"

    def _inputs(self) -> Iterator[str]:
        """Declare the inputs of the system as parameters."""
        for name, ends in self.inputs.items():
            v = ends[0].variable
            system = self.example.system.name
            constant = find(name, self.example.inputs, f"{system}: the example sets no input")
            value = literal(constant, v.type)
            yield declaration(f"parameter {SIGNALS[v.type]}", v, {}, value=value, name=name)

    def _members(self) -> Iterator[str]:
        """Declare the members with their values; inputs that nothing else sets are constant."""
        given = {
            (end.member, end.variable.name): identifier(name)
            for name, ends in self.inputs.items()
            for end in ends
        }
        connected = {(end.member, end.variable.name) for _, end in self.wires}
        for member, declared in self.example.system.members.items():
            cls = self.members[member]
            at_ports = {name for port in cls.ports for name in port.variables}
            modifiers = {
                identifier(p.name): literal(float(declared.values[p.name]), p.type)
                for p in cls.layout.parameters
                if p.name in declared.values
            }
            for v in cls.layout.inputs:
                if v.name not in at_ports and (member, v.name) not in connected:
                    constant = literal(float(declared.values.get(v.name, v.start)), v.type)
                    modifiers[identifier(v.name)] = given.get((member, v.name), constant)
            package = f"{PACKAGE}.{EXAMPLES}" if declared.effects else PACKAGE
            yield f"{package}.{class_name(cls.name)} {identifier(member)}{modification(modifiers)}"

    def _sources(self) -> Iterator[str]:
        """Declare the sources at ports, and references."""
        for signal, end in self.driven:
            assert end.port
            sign = "-" if end.is_flow and end.port.delivers else ""
            kind = source_class(end.port.domain, end.is_flow)
            yield f"{kind} {_source_name(end)}(value={sign}{signal})"
        for domain in self.domains:
            yield f"{source_class(domain, is_flow=False)} {reference_name(domain)}(value=0.0)"

    def _connections(self) -> list[str]:
        """Write the connections of members, sources and references, each once."""
        pairs = dict.fromkeys(
            tuple(sorted((output.text, input.text)))
            if output.port and input.port
            else (output.signal, input.signal)
            for output, input in self.wires
            if output.port or not input.port
        )
        lines = [f"connect({', '.join(pair)});" for pair in pairs]
        lines += [f"connect({_source_name(end)}.c, {end.text});" for _, end in self.driven]
        for domain, connectors in self.domains.items():
            lines += [f"connect({reference_name(domain)}.c, {each});" for each in connectors]
        return lines

    def _end(self, text: str) -> _End:
        """Return the end of a text ``member.variable``."""
        system = self.example.system.name
        member, name = text.split(".")
        cls = find(member, self.members, f"{system}: no member")
        variables = {v.name: v for v in cls.layout.variables}
        variable = find(name, variables, f"{system}: {member} has no variable")
        port = next((port for port in cls.ports if name in port.variables), None)
        return _End(member, variable, port)


def _source_name(end: _End) -> str:
    return f"{end.member}_{end.variable.name}_source"


def _row(components: Iterable[str], y: int) -> list[str]:
    """Return the lines of declarations of components in a row of the diagram."""
    declared = list(components)
    size = 60 // max(len(declared), 3)
    places = [placement(x, y, size) for x in positions(len(declared))]
    return wrapped(f"{text}{place};" for text, place in zip(declared, places, strict=True))
