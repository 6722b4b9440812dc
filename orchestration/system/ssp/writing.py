"""Writing of systems as SSP files; the same system gives the same bytes.

A system with an FMU of FMI 3.0 is of SSP 2.0, any other of SSP 1.0. A connection of all elements
of two arrays is one of the arrays; a single element, for which SSP has no word, stands by its name.
"""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

import numpy as np

from fmus.kit import UserError, files, units
from fmus.kit.build import archive, define_units, to_ssv
from orchestration.fmu import DeclaredVariable, Model, Signal
from orchestration.system.checking import check, interface, variable
from orchestration.system.model import Member, Port, System
from orchestration.system.ssp.arrays import Wire, declared, variable_of, wires
from orchestration.system.ssp.vocabulary import (
    CONNECTORS,
    DESCRIPTION,
    ENDINGS,
    FMU,
    MASTER,
    NAMESPACES,
    OUTSIDE,
    PARAMETER_SET,
    PARAMETERS,
    SSD,
    STEP,
    TYPES,
    tag,
)


def write(system: System, path: Path, connectors: bool = False) -> None:
    """Write a system with its FMUs and parameters.

    Parameters
    ----------
    system : System
    path : Path
        An ``.ssp`` archive, replaced whole or not at all; or an ``.ssd`` description, with
        ``resources/`` beside it.
    connectors : bool
        Whether the inputs and outputs of the system are connectors of it, as SSP has them. libcosim
        and Ecos load no file with connections to these. Without them, inputs and outputs are in an
        annotation that only this program reads, and other tools see inputs of members that are not
        connected, and set them in their own way.

    Raises
    ------
    UserError
        If the system does not pass its check, or a file cannot be written; for a bare description
        also if another file is in the place of one of its resources.
    """
    if path.suffix not in ENDINGS:
        raise UserError(
            f"{path}: a system is written as {' or '.join(ENDINGS)}, not"
            f" {path.suffix or 'without an ending'}"
        )
    check(system)
    places, resources = _collect_resources(system)
    description = _describe(system, places, connectors)
    if path.suffix == ".ssp":
        files.write(path, archive.pack(resources | {DESCRIPTION: description}))
        return
    for name, contents in resources.items():
        place = path.parent / name
        if place.exists() and place.read_bytes() != contents:
            raise UserError(f"{place} is there with other contents and will not be overwritten")
    for name, contents in resources.items():
        files.write(path.parent / name, contents)
    files.write(path, description)


@dataclass(frozen=True)
class _Places:
    """The paths in the package of a member's FMU, and of its parameters if it has any."""

    fmu: str
    parameters: str | None


def _collect_resources(system: System) -> tuple[dict[str, _Places], dict[str, bytes]]:
    """Return the paths by member, and the contents of all files but the description.

    Equal files of one name are stored once.
    """
    resources: dict[str, bytes] = {}
    places = {}
    for member in system.members:
        fmu = _store(resources, member.fmu.stem, ".fmu", member.fmu.read_bytes())
        parameters = None
        if member.parameters:
            parameters = _store(resources, member.name, ".ssv", _write_parameters(member))
        places[member.name] = _Places(fmu, parameters)
    return places, resources


def _store(resources: dict[str, bytes], name: str, ending: str, contents: bytes) -> str:
    """Add a file, and return its path, which is the same as its URI.

    Some tools do not distinguish the two.
    """
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
    path = f"resources/{plain}{ending}"
    number = 1
    # some file systems do not distinguish upper and lower case
    used = {other.casefold(): other for other in resources}
    while True:
        other = used.get(path.casefold())
        if other is None or (other == path and resources[other] == contents):
            break
        number += 1
        path = f"resources/{plain}_{number}{ending}"
    resources[path] = contents
    return path


def _write_parameters(member: Member) -> bytes:
    signals = {name: _with_known_unit(variable(member, name)) for name in member.parameters}
    return to_ssv(PARAMETER_SET, member.parameters, signals)


def _with_known_unit(signal: Signal) -> Signal:
    """Return a signal without its unit if that cannot be defined, for an FMU may name any."""
    try:
        units.base_unit(signal.unit)
    except UserError:
        return replace(signal, unit="")
    return signal


def _describe(system: System, places: Mapping[str, _Places], connectors: bool) -> bytes:
    """Describe a system as an SSD, UTF-8 XML."""
    for prefix, namespace in NAMESPACES.items():
        register_namespace(prefix, namespace)
    models = {member.name: interface(member) for member in system.members}
    members = {member.name: member for member in system.members}
    version = "2.0" if any(map(declared, system.members)) else "1.0"
    root = Element(tag("ssd:SystemStructureDescription"), version=version, name=system.name)
    top = SubElement(root, tag("ssd:System"), name=system.name)
    if system.doc:
        top.set("description", system.doc)
    used_units: set[str] = set()
    outer, outer_wires = _system_connectors(system, models, used_units)
    inner = wires(system.connections, members)
    used = {port for wire in inner for port in (wire.source, wire.target)}
    if connectors:
        used |= {port for ports in system.inputs.values() for port in ports}
        used |= set(system.outputs.values())
        top.extend([outer] if len(outer) else [])
    elements = SubElement(top, tag("ssd:Elements"))
    for member in system.members:
        own = _connectors(member, models[member.name], used, used_units)
        elements.append(_component(member, own, places[member.name]))
    connections = Element(tag("ssd:Connections"))
    connections.extend(map(_wire, inner))
    if connectors:
        connections.extend(outer_wires)
    top.extend([connections] if len(connections) else [])
    annotations = SubElement(top, tag("ssd:Annotations"))
    annotations.append(_master_annotation(system.step))  # OMSimulator reads the first one only
    if len(outer) and not connectors:
        annotation = SubElement(annotations, tag("ssc:Annotation"), type=CONNECTORS)
        # an annotation has one element
        SubElement(annotation, OUTSIDE).extend([outer, outer_wires])
    define_units(root, SSD, used_units)
    _add_experiment(root, system)
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="utf-8") + b"\n"


def _add_experiment(root: Element, system: System) -> None:
    """Add the default experiment, with libcosim's annotation of the communication step."""
    experiment = SubElement(
        root, tag("ssd:DefaultExperiment"), startTime="0.0", stopTime=repr(float(system.stop))
    )
    annotations = SubElement(experiment, tag("ssd:Annotations"))
    annotation = SubElement(annotations, tag("ssc:Annotation"), type=STEP)
    algorithm = SubElement(annotation, tag("osp:Algorithm"))
    SubElement(algorithm, tag("osp:FixedStepAlgorithm"), baseStepSize=repr(float(system.step)))


def _master_annotation(step: float) -> Element:
    """Return the annotation that makes OMSimulator a Jacobi master with a step in s.

    The tolerances are its own defaults; FMUs receive one, and with it ours are never less exact
    than without.
    """
    annotation = Element(tag("ssc:Annotation"), type=MASTER)
    own_annotations = SubElement(annotation, tag("oms:Annotations"))
    simulation = SubElement(own_annotations, tag("oms:SimulationInformation"))
    values = {"stepSize": step, "absoluteTolerance": 1e-4, "relativeTolerance": 1e-4}
    # xs:decimal has no exponent
    texts = {name: np.format_float_positional(value, trim="0") for name, value in values.items()}
    SubElement(simulation, tag("oms:FixedStepMaster"), {"description": "oms-ma"} | texts)
    return annotation


def _system_connectors(
    system: System, models: Mapping[str, Model], used_units: set[str]
) -> tuple[Element, Element]:
    """Return the connectors of the system, and their connections to its members."""
    connectors = Element(tag("ssd:Connectors"))
    wires = Element(tag("ssd:Connections"))
    for name, ports in system.inputs.items():
        signal = None
        if ports:
            signal = models[ports[0].member].inputs[ports[0].variable]
        connectors.append(_connector(name, "input", signal, used_units))
        for port in ports:
            ends = {
                "startConnector": name,
                "endElement": port.member,
                "endConnector": port.variable,
            }
            SubElement(wires, tag("ssd:Connection"), ends)
    for name, port in system.outputs.items():
        signal = models[port.member].outputs[port.variable]
        connectors.append(_connector(name, "output", signal, used_units))
        ends = {"startElement": port.member, "startConnector": port.variable, "endConnector": name}
        SubElement(wires, tag("ssd:Connection"), ends)
    return connectors, wires


def _connectors(
    member: Member, model: Model, used: Container[Port], used_units: set[str]
) -> list[Element]:
    """Describe the outputs of a member, and those inputs that are connected.

    fmpy fails on an input connector without a connection, so the others are omitted; they can be
    set all the same.
    """
    described: dict[str, Element] = {}
    for kind, signals in (("input", model.inputs), ("output", model.outputs)):
        for name, signal in signals.items():
            found = variable_of(member, name)
            whole = name if found is None else found[0]
            is_used = Port(member.name, whole) in used
            if whole not in described and (is_used or kind == "output"):
                described[whole] = _connector(whole, kind, signal, used_units, found and found[1])
            if whole != name and Port(member.name, name) in used:
                described[name] = _connector(name, kind, signal, used_units)
    return list(described.values())


def _component(member: Member, connectors: Sequence[Element], places: _Places) -> Element:
    """Describe a member."""
    component = Element(
        tag("ssd:Component"),
        name=member.name,
        type=FMU,
        source=places.fmu,
        implementation="CoSimulation",
    )
    if connectors:
        SubElement(component, tag("ssd:Connectors")).extend(connectors)
    if places.parameters is not None:
        bindings = SubElement(component, tag("ssd:ParameterBindings"))
        SubElement(bindings, tag("ssd:ParameterBinding"), type=PARAMETERS, source=places.parameters)
    return component


def _connector(
    name: str,
    kind: str,
    signal: Signal | None,
    used_units: set[str],
    variable: DeclaredVariable | None = None,
) -> Element:
    """Describe a connector.

    Parameters
    ----------
    name, kind : str
    signal : Signal, optional
        Type and unit, of an array those of an element.
    used_units : set of str
        Its unit is added.
    variable : DeclaredVariable, optional
        The variable of FMI 3.0, with its own type.
    """
    connector = Element(tag("ssd:Connector"), name=name, kind=kind)
    if signal is None:
        return connector
    type_name = signal.type.capitalize()
    if variable is not None and variable.kind != "Enumeration":
        type_name = variable.kind
    node = SubElement(connector, tag(f"ssc:{type_name}"))
    unit = _with_known_unit(signal).unit
    if TYPES[type_name] == ("real",) and unit:
        node.set("unit", unit)
        used_units.add(unit)
    for size in variable.shape if variable is not None else ():
        SubElement(connector, tag("ssc:Dimension"), size=str(size))
    return connector


def _wire(own: Wire) -> Element:
    """Return the element of a connection."""
    connection = own.connection
    wire = Element(
        tag("ssd:Connection"),
        {
            "startElement": own.source.member,
            "startConnector": own.source.variable,
            "endElement": own.target.member,
            "endConnector": own.target.variable,
        },
    )
    if not connection.passes_on:
        wire.set("suppressUnitConversion", "true")  # the factor includes the conversion
        values = {
            "factor": repr(float(connection.factor)),
            "offset": repr(float(connection.offset)),
        }
        SubElement(wire, tag("ssc:LinearTransformation"), values)
    return wire
