"""Reading a system from SSP 1.0, anybody's; what this program cannot do is refused, not passed over."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

from fmus.kit import units
from fmus.kit.errors import UserError
from orchestration.fmu.bounded import parse_xml
from orchestration.fmu.signal import Value
from orchestration.system.check import conversion, interface, variable
from orchestration.system.model import Connection, Member, Port, System
from orchestration.system.ssp.connectors import check_connectors, check_declared, variables_of
from orchestration.system.ssp.grammar import check_elements, local
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.vocabulary import CONNECTORS, FMU, NAMESPACES, OUTSIDE, STEP, tag

_TYPES = {
    tag(f"ssv:{kind.capitalize()}"): kind for kind in ("real", "integer", "boolean", "string")
}
_BOOLEANS = {"true": 1.0, "1": 1.0, "false": 0.0, "0": 0.0}


def read(path: Path, folder: Path) -> System:
    """Read a system.

    Parameters
    ----------
    path : Path
        An ``.ssp`` archive, or an ``.ssd`` description with its files beside it.
    folder : Path
        Into it the FMUs of an archive are unpacked.

    Returns
    -------
    System
        With ``cls`` of no member set: an FMU does not tell it.

    Raises
    ------
    UserError
        If it cannot be read, is not safe to unpack, declares connectors that the FMUs do not have, or holds what this
        program cannot do: nested systems, models other than FMUs, signal dictionaries, parameter mappings,
        transformations that are not linear.
    """
    with Package(path) as package:
        root = _parse(package, package.description)
        if root.tag != tag("ssd:SystemStructureDescription"):
            raise UserError(
                f"{path}: {package.description} is a {local(root)}, not a SystemStructureDescription"
            )
        if not (version := root.get("version", "")).startswith("1."):
            raise UserError(
                f"{path}: SSP version {version or 'not stated'}; this program knows SSP 1.0"
            )
        tops = root.findall("ssd:System", NAMESPACES)
        if len(tops) != 1:
            raise UserError(
                f"{path}: {'more than one' if tops else 'no'} System in {package.description}"
            )
        reader = _Reader(package, folder)
        reader.check_elements(root)
        return reader.system(root, tops[0])


def _parse(package: Package, name: str) -> Element:
    return parse_xml(package.text(name), str(package.path), name)


class _Reader:
    """Reads a system from a package."""

    def __init__(self, package: Package, folder: Path):
        self._package = package
        self._folder = folder

    def _wrong(self, what: str) -> UserError:
        return UserError(f"{self._package.path}: {what}")

    def _get(self, element: Element, attribute: str) -> str:
        if (value := element.get(attribute)) is None:
            raise self._wrong(f"a {local(element)} has no attribute {attribute!r}")
        return value

    def _number(self, element: Element, attribute: str, default: str) -> float:
        text = element.get(attribute, default)
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self._wrong(f"{attribute} {text!r} of a {local(element)} is not a finite number")
        return value

    def check_elements(self, element: Element) -> None:
        """Refuse what is not understood; see `grammar`."""
        try:
            check_elements(element)
        except UserError as error:
            raise self._wrong(str(error)) from error

    def system(self, root: Element, top: Element) -> System:
        listed = [self._member(element) for element in top.findall("ssd:Elements/*", NAMESPACES)]
        members = {member.name: member for member in listed}
        if len(members) != len(listed):
            raise self._wrong("two members have one name")
        for name, value in self._bindings(top, "system"):
            owner, dot, parameter = name.partition(".")
            if not dot or owner not in members:
                raise self._wrong(
                    f"parameter {name!r} of the system is not of the form member.parameter"
                )
            member = members[owner]
            given = {parameter: self._value(member, parameter, value)}
            members[owner] = replace(member, parameters={**member.parameters, **given})
        annotations = top.findall("ssd:Annotations/ssc:Annotation", NAMESPACES)
        outside = [
            part for a in annotations if a.get("type") == CONNECTORS for part in a.findall(OUTSIDE)
        ]
        for part in outside:
            self.check_elements(part)
        own = [top, *outside]
        connectors = [
            node
            for part in own
            for node in part.findall("ssd:Connectors/ssd:Connector", NAMESPACES)
        ]
        wires = [
            node
            for part in own
            for node in part.findall("ssd:Connections/ssd:Connection", NAMESPACES)
        ]
        for connector in connectors:
            if (kind := self._get(connector, "kind")) not in ("input", "output"):
                raise self._wrong(
                    f"connector {connector.get('name')!r} of the system is {kind}; known: input, output"
                )
        inputs: dict[str, list[Port]] = {
            self._get(c, "name"): [] for c in connectors if c.get("kind") == "input"
        }
        outputs: dict[str, Port] = {}
        names = {self._get(c, "name") for c in connectors if c.get("kind") == "output"}
        connections = [
            c for wire in wires if (c := self._connection(wire, members, inputs, names, outputs))
        ]
        if lonely := names - set(outputs):
            raise self._wrong(f"system output {min(lonely)} is connected with nothing")
        for connector in connectors:
            name = self._get(connector, "name")
            for port in inputs[name] if connector.get("kind") == "input" else (outputs[name],):
                self._check_outer(connector, members[port.member], port)
        experiment = root.find("ssd:DefaultExperiment", NAMESPACES)
        return System(
            self._get(top, "name"),
            tuple(members.values()),
            tuple(connections),
            {name: tuple(ports) for name, ports in inputs.items()},
            {
                self._get(c, "name"): outputs[self._get(c, "name")]
                for c in connectors
                if c.get("kind") == "output"
            },
            top.get("description", ""),
            **({} if experiment is None else self._experiment(experiment)),
        )

    def _check_outer(self, connector: Element, member: Member, port: Port) -> None:
        """Hold what a connector of the system says of itself against what it is connected with, if that is there."""
        if (variable := variables_of(member).get(port.variable)) is None:
            return
        try:
            check_declared(
                connector,
                variable,
                f"connector {connector.get('name')!r} of the system, that is {port},",
            )
        except UserError as error:
            raise self._wrong(str(error)) from error

    def _experiment(self, experiment: Element) -> dict[str, float]:
        times = {}
        if "stopTime" in experiment.attrib:
            times["stop"] = self._number(experiment, "stopTime", "") - self._number(
                experiment, "startTime", "0"
            )
        for annotation in experiment.findall("ssd:Annotations/ssc:Annotation", NAMESPACES):
            algorithm = annotation.find("osp:Algorithm/osp:FixedStepAlgorithm", NAMESPACES)
            if annotation.get("type") == STEP and algorithm is not None:
                times["step"] = self._number(algorithm, "baseStepSize", "")
        return times

    # --- members ----------------------------------------------------------------------------------------------------

    def _member(self, element: Element) -> Member:
        name = self._get(element, "name")
        if element.tag == tag("ssd:System"):
            raise self._wrong(
                f"{name} is a system within the system; this program runs one level of members"
            )
        if element.tag != tag("ssd:Component"):
            raise self._wrong(
                f"{name} is a {local(element)}; this program runs components that are FMUs"
            )
        if (kind := element.get("type", FMU)) != FMU:
            raise self._wrong(f"member {name} is of type {kind}; this program runs FMUs")
        if element.get("implementation", "any") == "ModelExchange":
            raise self._wrong(
                f"member {name} is to be run by model exchange; this program runs co-simulation"
            )
        try:
            member = Member(name, self._package.fmu(self._get(element, "source"), self._folder))
            check_connectors(element, member)
        except UserError as error:
            text = str(error).removeprefix(f"{self._package.path}: ")
            raise self._wrong(f"member {name}: {text}") from error
        given = {
            key: self._value(member, key, value)
            for key, value in self._bindings(element, f"member {name}")
        }
        return replace(member, parameters=given)

    def _bindings(self, element: Element, where: str) -> Iterator[tuple[str, Element]]:
        """Names and values of all parameters bound to an element."""
        for binding in element.findall("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES):
            if binding.find("ssd:ParameterMapping", NAMESPACES) is not None:
                raise self._wrong(f"{where}: parameter mappings are not known to this program")
            if binding.get("sourceBase", "SSD") != "SSD":
                raise self._wrong(
                    f"{where}: parameters inside of an FMU are not known to this program"
                )
            sets = binding.findall("ssd:ParameterValues/ssv:ParameterSet", NAMESPACES)
            if (source := binding.get("source")) is not None:
                sets.append(_parse(self._package, source))
                self.check_elements(sets[-1])
                if sets[-1].tag != tag("ssv:ParameterSet"):
                    raise self._wrong(
                        f"{where}: {source} is a {local(sets[-1])}, not a ParameterSet"
                    )
            for parameters in sets:
                for parameter in parameters.findall("ssv:Parameters/ssv:Parameter", NAMESPACES):
                    name = binding.get("prefix", "") + self._get(parameter, "name")
                    if len(parameter) == 0 or parameter[0].tag not in _TYPES:
                        kind = local(parameter[0]) if len(parameter) else "nothing"
                        known = "known are Real, Integer, Boolean and String"
                        raise self._wrong(f"{where}: parameter {name} is {kind}; {known}")
                    yield name, parameter[0]

    def _value(self, member: Member, name: str, element: Element) -> Value:
        """Value of a parameter in the FMU's unit."""
        try:
            signal = variable(member, name)
        except UserError as error:
            raise self._wrong(str(error)) from error
        where, kind, text = (
            f"member {member.name}: {name}",
            _TYPES[element.tag],
            element.get("value", ""),
        )
        if kind != signal.type:
            raise self._wrong(f"{where}: given as {kind}, but the FMU has it as {signal.type}")
        if kind == "string":
            return text
        if kind == "boolean":
            if text not in _BOOLEANS:
                raise self._wrong(f"{where}: {text!r} is neither true nor false")
            return _BOOLEANS[text]
        try:
            value = float(text)
            return float(units.convert(value, element.get("unit", signal.unit), signal.unit, where))
        except UserError as error:
            raise self._wrong(str(error) if where in str(error) else f"{where}: {error}") from error
        except ValueError as error:
            raise self._wrong(f"{where}: {text!r} is not a number") from error

    # --- connections ------------------------------------------------------------------------------------------------

    def _connection(
        self,
        wire: Element,
        members: dict[str, Member],
        inputs: dict[str, list[Port]],
        names: set[str],
        outputs: dict[str, Port],
    ) -> Connection | None:
        """Connection between members; None of one to a connector of the system, which is noted there."""
        ends = [
            (wire.get(f"{end}Element"), self._get(wire, f"{end}Connector"))
            for end in ("start", "end")
        ]
        where = " -> ".join(
            connector if element is None else f"{element}.{connector}"
            for element, connector in ends
        )
        (start, source), (end, target) = ends
        for element in (start, end):
            if element is not None and element not in members:
                raise self._wrong(f"connection {where}: there is no member named {element!r}")
        factor, offset = self._transformation(wire)
        if start is not None and end is not None:
            connection = Connection(Port(start, source), Port(end, target), factor, offset)
            if wire.get("suppressUnitConversion", "false") not in ("true", "1"):
                self._check_conversion(connection, members, where)
            return connection
        if (factor, offset) != (1.0, 0.0):
            raise self._wrong(
                f"connection {where}: a transformation at a connector of the system is not known"
            )
        if start is None and end is not None and source in inputs:
            inputs[source].append(Port(end, target))
        elif start is not None and end is None and target in names and target not in outputs:
            outputs[target] = Port(start, source)
        elif target in outputs:
            raise self._wrong(
                f"connection {where}: system output {target} has two sources, {outputs[target]} is one"
            )
        else:
            raise self._wrong(
                f"connection {where}: leads from no input of the system, nor to an output of it"
            )
        return None

    def _transformation(self, wire: Element) -> tuple[float, float]:
        linear = wire.find("ssc:LinearTransformation", NAMESPACES)
        if linear is None:
            return 1.0, 0.0
        return self._number(linear, "factor", "1"), self._number(linear, "offset", "0")

    def _check_conversion(
        self, connection: Connection, members: dict[str, Member], where: str
    ) -> None:
        """Refuse a factor where tools differ: in SSP it may follow a conversion of units, in others not."""
        if connection.passes_on:
            return
        gives = interface(members[connection.source.member]).outputs.get(connection.source.variable)
        takes = interface(members[connection.target.member]).inputs.get(connection.target.variable)
        if gives and takes and conversion(gives.unit, takes.unit) not in (None, (1.0, 0.0)):
            raise self._wrong(
                f"connection {where}: from {gives.unit!r} to {takes.unit!r}, by a factor that may come on top of the "
                'conversion or be all of it; say suppressUnitConversion="true" if it is all'
            )
