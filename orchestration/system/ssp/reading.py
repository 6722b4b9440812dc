"""Reading of systems from SSP files; contents that this program cannot process are refused."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element

from fmus.kit import UserError, units
from orchestration.fmu import MOST_ELEMENTS, DeclaredVariable, Value, element_names
from orchestration.fmu.bounded import parse_xml
from orchestration.system.checking import conversion, interface, variable
from orchestration.system.model import Connection, Member, Port, System
from orchestration.system.ssp.arrays import (
    element_at,
    scalars,
    show_shape,
    variable_of,
)
from orchestration.system.ssp.declarations import (
    check_connectors,
    check_shape,
    check_type_and_unit,
)
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.vocabulary import (
    CONNECTORS,
    FMU,
    NAMESPACES,
    OUTSIDE,
    STEP,
    TYPES,
    check_elements,
    check_exchanged,
    check_version,
    local_name,
    tag,
)

_PARAMETER_TYPES = {tag(f"ssv:{name}"): kinds for name, kinds in TYPES.items()}
_OTHER_IMPLEMENTATIONS = {
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
_BOOLEANS = {"true": 1.0, "1": 1.0, "false": 0.0, "0": 0.0}
_IDENTITY = (1.0, 0.0)  # factor and offset
_SIDES = ("start", "end")
# attributes of an end of a connection, and those of the other
_OTHER_SIDE = {
    f"{side}{what}": f"{other}{what}"
    for side, other in (_SIDES, _SIDES[::-1])
    for what in ("Element", "Connector", "Indices")
}
_WHOLE = re.compile(r"[0-9]{1,18}")


def read(path: Path, folder: Path) -> System:
    """Read a system.

    Parameters
    ----------
    path : Path
        An ``.ssp`` archive, or an ``.ssd`` description with its files beside it.
    folder : Path
        The FMUs of an archive are unpacked into it.

    Returns
    -------
    System
        With ``cls`` of no member set, for it is not known of an FMU.

    Raises
    ------
    UserError
        If it cannot be read, is not safe to unpack, declares connectors that the FMUs do not have,
        or contains what this program cannot process: nested systems, models other than FMUs, signal
        dictionaries, parameter mappings, transformations that are not linear.
    """
    with Package(path) as package:
        root = _parse(package, package.description)
        if root.tag != tag("ssd:SystemStructureDescription"):
            raise UserError(
                f"{path}: {package.description} is a {local_name(root)}, not a"
                " SystemStructureDescription"
            )
        check_version(root, f"{path}: {package.description}")
        systems = root.findall("ssd:System", NAMESPACES)
        if len(systems) != 1:
            raise UserError(
                f"{path}: {'more than one' if systems else 'no'} System in {package.description}"
            )
        reader = _SspReader(package, folder)
        reader.check_elements(root)
        return reader.read_system(root, systems[0])


def _parse(package: Package, name: str) -> Element:
    return parse_xml(package.text(name), str(package.path), name)


def _show_wire(wire: Element) -> str:
    """Return the ends of a connection as they are written, for a message."""
    ends = []
    for side in _SIDES:
        names = [wire.get(f"{side}Element"), wire.get(f"{side}Connector")]
        ends.append(".".join(name for name in names if name is not None))
    return " -> ".join(ends)


def _find_all(parts: Sequence[Element], path: str) -> list[Element]:
    return [node for part in parts for node in part.findall(path, NAMESPACES)]


@dataclass
class _SystemConnectors:
    """The connectors of the system, and the ports of members to which they are connected.

    Attributes
    ----------
    declared : dict of str to DeclaredVariable
        By name; of an array with its elements, each of which is an input or an output here.
    inputs : dict of str to list of Port
    outputs : dict of str to Port or None
        None until the connection is read.
    """

    declared: dict[str, DeclaredVariable] = field(default_factory=dict)
    inputs: dict[str, list[Port]] = field(default_factory=dict)
    outputs: dict[str, Port | None] = field(default_factory=dict)


class _SspReader:
    """A reader of a system from the files of a package."""

    def __init__(self, package: Package, folder: Path):
        self._package = package
        self._folder = folder

    def _error(self, message: str) -> UserError:
        return UserError(f"{self._package.path}: {message}")

    def _get(self, element: Element, attribute: str) -> str:
        value = element.get(attribute)
        if value is None:
            raise self._error(f"a {local_name(element)} has no attribute {attribute!r}")
        return value

    def _number(self, element: Element, attribute: str, default: str) -> float:
        text = element.get(attribute, default)
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self._error(
                f"{attribute} {text!r} of a {local_name(element)} is not a finite number"
            )
        return value

    def check_elements(self, element: Element) -> None:
        """Refuse unknown elements; see `vocabulary`."""
        try:
            check_elements(element)
        except UserError as error:
            raise self._error(str(error)) from error

    def _check_exchanged(self, element: Element, where: str) -> None:
        try:
            check_exchanged(element, where)
        except UserError as error:
            raise self._error(str(error)) from error

    def read_system(self, root: Element, top: Element) -> System:
        """Read the system in the element `top`."""
        members = self._read_members(top)
        parts = [top, *self._annotated_parts(top)]
        declared = _find_all(parts, "ssd:Connectors/ssd:Connector")
        connectors = self._read_system_connectors(declared)
        connections = []
        for wire in _find_all(parts, "ssd:Connections/ssd:Connection"):
            turned = _turned(wire, members, connectors)
            connections += self._read_connection(turned, members, connectors)
        outputs = {name: port for name, port in connectors.outputs.items() if port is not None}
        unconnected = connectors.outputs.keys() - outputs.keys()
        if unconnected:
            raise self._error(f"system output {min(unconnected)} is connected with nothing")
        for connector in declared:
            self._check_system_connector(connector, members, connectors)
        experiment = root.find("ssd:DefaultExperiment", NAMESPACES)
        return System(
            self._get(top, "name"),
            tuple(members.values()),
            tuple(connections),
            {name: tuple(ports) for name, ports in connectors.inputs.items()},
            outputs,
            top.get("description", ""),
            **({} if experiment is None else self._read_experiment(experiment)),
        )

    def _annotated_parts(self, top: Element) -> list[Element]:
        """Return the elements of our annotations with connectors of the system."""
        annotations = top.findall("ssd:Annotations/ssc:Annotation", NAMESPACES)
        ours = [annotation for annotation in annotations if annotation.get("type") == CONNECTORS]
        parts = [part for annotation in ours for part in annotation.findall(OUTSIDE)]
        for part in parts:
            self.check_elements(part)
        return parts

    def _read_experiment(self, experiment: Element) -> dict[str, float]:
        """Read duration and communication step as keyword arguments of a `System`."""
        times = {}
        if "stopTime" in experiment.attrib:
            stop = self._number(experiment, "stopTime", "")
            times["stop"] = stop - self._number(experiment, "startTime", "0")
        for annotation in experiment.findall("ssd:Annotations/ssc:Annotation", NAMESPACES):
            algorithm = annotation.find("osp:Algorithm/osp:FixedStepAlgorithm", NAMESPACES)
            if annotation.get("type") == STEP and algorithm is not None:
                times["step"] = self._number(algorithm, "baseStepSize", "")
        return times

    # --- members

    def _read_members(self, top: Element) -> dict[str, Member]:
        """Read the members, with the parameters that are bound to them or to the system."""
        listed = [
            self._read_member(element) for element in top.findall("ssd:Elements/*", NAMESPACES)
        ]
        members = {member.name: member for member in listed}
        if len(members) != len(listed):
            raise self._error("two members have one name")
        for name, value in self._read_bindings(top, "system"):
            owner, dot, parameter = name.partition(".")
            if not dot or owner not in members:
                raise self._error(
                    f"parameter {name!r} of the system is not of the form member.parameter"
                )
            member = members[owner]
            parameters = {**member.parameters, **self._values(member, parameter, value)}
            members[owner] = replace(member, parameters=parameters)
        return members

    def _read_member(self, element: Element) -> Member:
        name = self._get(element, "name")
        if element.tag == tag("ssd:System"):
            raise self._error(
                f"{name} is a system within the system; this program runs one level of members"
            )
        if element.tag != tag("ssd:Component"):
            raise self._error(
                f"{name} is a {local_name(element)}; this program runs components that are FMUs"
            )
        kind = element.get("type", FMU)
        if kind != FMU:
            raise self._error(f"member {name} is of type {kind}; this program runs FMUs")
        other = _OTHER_IMPLEMENTATIONS.get(element.get("implementation", "any"))
        if other is not None:
            raise self._error(
                f"member {name} is to be run by {other}; this program runs co-simulation"
            )
        try:
            member = Member(name, self._package.fmu(self._get(element, "source"), self._folder))
            check_connectors(element, member)
        except UserError as error:
            text = str(error).removeprefix(f"{self._package.path}: ")
            raise self._error(f"member {name}: {text}") from error
        parameters: dict[str, Value] = {}
        for key, value in self._read_bindings(element, f"member {name}"):
            parameters |= self._values(member, key, value)
        return replace(member, parameters=parameters)

    def _read_bindings(self, element: Element, where: str) -> Iterator[tuple[str, Element]]:
        """Yield names and values of all parameters that are bound to an element."""
        for binding in element.findall("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES):
            if binding.find("ssd:ParameterMapping", NAMESPACES) is not None:
                raise self._error(f"{where}: parameter mappings are not known to this program")
            if binding.get("sourceBase", "SSD") != "SSD":
                raise self._error(
                    f"{where}: parameters inside of an FMU are not known to this program"
                )
            for parameter in self._read_parameters(binding, where):
                name = binding.get("prefix", "") + self._get(parameter, "name")
                if len(parameter) == 0 or parameter[0].tag not in _PARAMETER_TYPES:
                    kind = local_name(parameter[0]) if len(parameter) else "nothing"
                    known = ", ".join(TYPES)
                    raise self._error(f"{where}: parameter {name} is {kind}; known are {known}")
                yield name, parameter

    def _read_parameters(self, binding: Element, where: str) -> list[Element]:
        """Return the parameters in a binding, and in the file that it refers to."""
        sets = binding.findall("ssd:ParameterValues/ssv:ParameterSet", NAMESPACES)
        source = binding.get("source")
        if source is not None:
            parameter_set = _parse(self._package, source)
            self.check_elements(parameter_set)
            if parameter_set.tag != tag("ssv:ParameterSet"):
                raise self._error(
                    f"{where}: {source} is a {local_name(parameter_set)}, not a ParameterSet"
                )
            sets.append(parameter_set)
        for each in sets:
            check_version(each, f"{self._package.path}: {where}: {source or 'a ParameterSet'}")
        return _find_all(sets, "ssv:Parameters/ssv:Parameter")

    def _values(self, member: Member, name: str, parameter: Element) -> dict[str, Value]:
        """Return the value of a parameter, of an array those of all elements in row-major order."""
        element = parameter[0]
        names = variable_of(member, name).elements
        texts = [node.get("value", "") for node in element.iterfind("ssv:Value", NAMESPACES)]
        is_array = len(names) > 1
        if not texts:
            text = element.get("value", "")
            texts = text.split() if is_array else [text]
        try:
            check_shape(parameter, name, member, f"member {member.name}: {name}")
        except UserError as error:
            raise self._error(str(error)) from error
        if len(texts) != len(names):
            raise self._error(
                f"member {member.name}: {name}: has {len(texts)} values; expected {len(names)}"
            )
        return {
            each: self._value(member, each, element, text)
            for each, text in zip(names, texts, strict=True)
        }

    def _value(self, member: Member, name: str, element: Element, text: str) -> Value:
        """Return the value of a scalar parameter in the FMU's unit."""
        try:
            signal = variable(member, name)
        except UserError as error:
            raise self._error(str(error)) from error
        where = f"member {member.name}: {name}"
        kinds = _PARAMETER_TYPES[element.tag]
        if signal.type not in kinds:
            raise self._error(f"{where}: given as {kinds[0]}, but the FMU has it as {signal.type}")
        if signal.type == "string":
            return text
        if element.tag == tag("ssv:Enumeration"):
            return self._item(member, name, text)
        if signal.type == "boolean":
            if text not in _BOOLEANS:
                raise self._error(f"{where}: {text!r} is neither true nor false")
            return _BOOLEANS[text]
        try:
            value = float(text)
            return float(units.convert(value, element.get("unit", signal.unit), signal.unit, where))
        except UserError as error:
            raise self._error(str(error) if where in str(error) else f"{where}: {error}") from error
        except ValueError as error:
            raise self._error(f"{where}: {text!r} is not a number") from error

    def _item(self, member: Member, name: str, text: str) -> float:
        """Return the number of an item of an enumeration, given its name."""
        enumeration = scalars(member)[name].declaredType
        listed = enumeration.items if enumeration is not None else None
        items = {item.name: float(item.value) for item in listed or ()}
        if text not in items:
            raise self._error(
                f"member {member.name}: {name}: {text!r} is no item of its enumeration; items are"
                f" {', '.join(items) or 'none'}"
            )
        return items[text]

    # --- connections

    def _read_system_connectors(self, declared: Sequence[Element]) -> _SystemConnectors:
        """Read the connectors of the system, which are not connected yet."""
        found = _SystemConnectors()
        for connector in declared:
            name = self._get(connector, "name")
            kind = self._get(connector, "kind")
            where = f"connector {name!r} of the system"
            if kind not in ("input", "output"):
                raise self._error(f"{where} is {kind}; known: input, output")
            self._check_exchanged(connector, where)
            if name in found.declared:
                raise self._error(f"two connectors of the system are named {name!r}")
            shape = self._read_shape(connector, where)
            elements = tuple(element_names(name, shape))
            found.declared[name] = DeclaredVariable("", shape, elements)
            if kind == "input":
                found.inputs |= {element: [] for element in elements}
            else:
                found.outputs |= dict.fromkeys(elements)
        return found

    def _read_shape(self, connector: Element, where: str) -> tuple[int, ...]:
        """Read the size of a connector of the system, which no FMU knows."""
        texts = [node.get("size", "") for node in connector.iterfind("ssc:Dimension", NAMESPACES)]
        for text in texts:
            if _WHOLE.fullmatch(text) is None:
                raise self._error(
                    f"{where} is an array with a dimension of size"
                    f" {repr(text[:40]) if text else 'not stated'}; known are whole numbers"
                )
        shape = tuple(map(int, texts))
        if math.prod(shape) > MOST_ELEMENTS:
            raise self._error(
                f"{where} has {show_shape(shape)}; at most {MOST_ELEMENTS:,} are taken"
            )
        return shape

    def _check_system_connector(
        self, connector: Element, members: Mapping[str, Member], connectors: _SystemConnectors
    ) -> None:
        """Compare type and unit of a connector with those of the ports that it is connected to."""
        for element in connectors.declared[self._get(connector, "name")].elements:
            output = connectors.outputs.get(element)
            ports = connectors.inputs.get(element, [] if output is None else [output])
            for port in ports:
                scalar = scalars(members[port.member]).get(port.variable)
                if scalar is None:
                    continue
                where = f"connector {element!r} of the system, that is {port},"
                try:
                    check_type_and_unit(connector, scalar, where)
                except UserError as error:
                    raise self._error(str(error)) from error

    def _read_connection(
        self, wire: Element, members: Mapping[str, Member], connectors: _SystemConnectors
    ) -> list[Connection]:
        """Read a connection of members, of arrays one for each element.

        One to a connector of the system is noted there.
        """
        start, end = (self._read_end(wire, side, members, connectors) for side in _SIDES)
        where = f"connection {_show_wire(wire)}"
        if start.shape != end.shape:
            raise self._error(f"{where}: from {show_shape(start.shape)} to {show_shape(end.shape)}")
        transformation = self._read_transformation(wire)
        pairs = zip(start.elements, end.elements, strict=True)
        source = wire.get("startElement")
        target = wire.get("endElement")
        if source is None or target is None:
            if transformation != _IDENTITY:
                raise self._error(
                    f"{where}: a transformation at a connector of the system is not known"
                )
            for a, b in pairs:
                self._join(Port(source or "", a), Port(target or "", b), connectors, where)
            return []
        connections = [
            Connection(Port(source, a), Port(target, b), *transformation) for a, b in pairs
        ]
        if wire.get("suppressUnitConversion", "false") not in ("true", "1"):
            for connection in connections:
                self._refuse_ambiguous_factor(connection, members, where)
        return connections

    def _read_end(
        self,
        wire: Element,
        side: str,
        members: Mapping[str, Member],
        connectors: _SystemConnectors,
    ) -> DeclaredVariable:
        """Return what is at an end of a connection: a whole variable, or an element as a scalar."""
        where = f"connection {_show_wire(wire)}"
        owner = wire.get(f"{side}Element")
        name = self._get(wire, f"{side}Connector")
        if owner is not None and owner not in members:
            raise self._error(f"{where}: there is no member named {owner!r}")
        if owner is not None:
            found = variable_of(members[owner], name)
        else:
            found = connectors.declared.get(name, DeclaredVariable("", (), (name,)))
        indices = wire.get(f"{side}Indices", "").split()
        if not indices:
            return found
        if not all(map(_WHOLE.fullmatch, indices)):
            raise self._error(
                f"{where}: {side}Indices {' '.join(indices)[:40]!r} are no whole numbers"
            )
        try:
            element = element_at(found, tuple(map(int, indices)))
        except UserError as error:
            raise self._error(f"{where}: {name}: {error}") from error
        return DeclaredVariable(found.kind, (), (element,))

    def _join(self, source: Port, target: Port, connectors: _SystemConnectors, where: str) -> None:
        """Note a connection to a connector of the system, whose port has no member."""
        if not source.member and target.member and source.variable in connectors.inputs:
            connectors.inputs[source.variable].append(target)
            return
        if target.member or not source.member or target.variable not in connectors.outputs:
            raise self._error(f"{where}: leads from no input of the system, nor to an output of it")
        other = connectors.outputs[target.variable]
        if other is not None:
            raise self._error(
                f"{where}: system output {target.variable} has two sources, {other} is one"
            )
        connectors.outputs[target.variable] = source

    def _read_transformation(self, wire: Element) -> tuple[float, float]:
        """Read the factor and the offset of a connection."""
        linear = wire.find("ssc:LinearTransformation", NAMESPACES)
        if linear is None:
            return _IDENTITY
        return self._number(linear, "factor", "1"), self._number(linear, "offset", "0")

    def _refuse_ambiguous_factor(
        self, connection: Connection, members: Mapping[str, Member], where: str
    ) -> None:
        """Raise an error if a connection has a factor and its ends have different units.

        In SSP the factor comes on top of the conversion of units, in some tools it is all of it.
        """
        if connection.passes_on:  # without a factor
            return
        source = connection.source
        target = connection.target
        output = interface(members[source.member]).outputs.get(source.variable)
        input_ = interface(members[target.member]).inputs.get(target.variable)
        if output is None or input_ is None:  # refused when the system is checked
            return
        converts = conversion(output.unit, input_.unit) not in (None, _IDENTITY)
        if converts:
            raise self._error(
                f"{where}: from {output.unit!r} to {input_.unit!r}, by a factor that may"
                ' come on top of the conversion or be all of it; say suppressUnitConversion="true"'
                " if it is all"
            )


# --- the direction of connections


def _turned(wire: Element, members: Mapping[str, Member], connectors: _SystemConnectors) -> Element:
    """Return a connection that starts at its source.

    The names of its ends do not tell its direction in SSP, their connectors do.
    """
    start, end = (_receives(wire, side, members, connectors) for side in _SIDES)
    if end or not start:
        return wire
    turned = Element(wire.tag, {_OTHER_SIDE.get(key, key): wire.attrib[key] for key in wire.attrib})
    turned.extend(wire)
    return turned


def _receives(
    wire: Element, side: str, members: Mapping[str, Member], connectors: _SystemConnectors
) -> bool:
    """Return whether what is at an end is an input of a member or an output of the system."""
    owner = wire.get(f"{side}Element")
    name = wire.get(f"{side}Connector", "")
    if owner is None:
        elements = connectors.declared[name].elements if name in connectors.declared else ()
        return any(element in connectors.outputs for element in elements[:1])
    if owner not in members:
        return False
    known = scalars(members[owner])
    elements = variable_of(members[owner], name).elements[:1]
    return any(each in known and known[each].causality == "input" for each in elements)
