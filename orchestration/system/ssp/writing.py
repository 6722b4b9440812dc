"""Writing a system as SSP 1.0; the same system gives the same bytes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

import numpy as np

from fmus.kit import files, units
from fmus.kit.build import archive
from fmus.kit.build.parameters import define_units, to_ssv
from fmus.kit.errors import UserError
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Signal
from orchestration.system.check import check, interface, variable
from orchestration.system.model import Connection, Member, Port, System
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
    tag,
)


def write(system: System, path: Path, connectors: bool = False) -> None:
    """Write a system with its FMUs and parameters.

    Parameters
    ----------
    system : System
    path : Path
        An ``.ssp`` archive, replaced whole or not at all; or an ``.ssd`` description, with ``resources/`` beside it.
    connectors : bool
        Whether the inputs and outputs of the system are connectors of it, as SSP has them. libcosim and Ecos load no
        file with connections to these; without them, inputs and outputs stand in an annotation that only we read,
        and other tools see inputs of members that nothing is connected to and that they set in their own way.

    Raises
    ------
    UserError
        If the system does not pass :func:`.check.check`, or a file cannot be written; for a bare description also if
        another file is in the place of one of its resources.
    """
    if path.suffix not in ENDINGS:
        raise UserError(
            f"{path}: a system is written as {' or '.join(ENDINGS)}, not {path.suffix or 'without an ending'}"
        )
    check(system)
    places, resources = _resources(system)
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
    """Where in ``resources/`` a member's FMU is, and its parameters if it has any."""

    fmu: str
    parameters: str | None


def _resources(system: System) -> tuple[dict[str, _Places], dict[str, bytes]]:
    """Places by member, and all files but the description; equal files of one name are one."""
    files: dict[str, bytes] = {}
    places = {}
    for member in system.members:
        fmu = _store(files, member.fmu.stem, ".fmu", member.fmu.read_bytes())
        given = (
            _store(files, member.name, ".ssv", _parameters(member)) if member.parameters else None
        )
        places[member.name] = _Places(fmu, given)
    return places, files


def _store(files: dict[str, bytes], name: str, ending: str, contents: bytes) -> str:
    """Add a file under a name that is the same as URI and as path, for tools that do not tell these apart."""
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
    place, number = f"resources/{plain}{ending}", 1
    taken = {other.casefold(): other for other in files}  # some file systems know no case
    while (other := taken.get(place.casefold())) is not None and (other, files[other]) != (
        place,
        contents,
    ):
        number += 1
        place = f"resources/{plain}_{number}{ending}"
    files[place] = contents
    return place


def _parameters(member: Member) -> bytes:
    return to_ssv(
        PARAMETER_SET,
        member.parameters,
        {name: _told(variable(member, name)) for name in member.parameters},
    )


def _told(signal: Signal) -> Signal:
    """Signal without its unit if that cannot be defined: an FMU may name its units as it likes."""
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
    root = Element(tag("ssd:SystemStructureDescription"), version="1.0", name=system.name)
    top = SubElement(root, tag("ssd:System"), name=system.name)
    if system.doc:
        top.set("description", system.doc)
    used: set[str] = set()
    outer, outer_wires = _outside(system, models, used)
    fed = {connection.target for connection in system.connections}
    if connectors:
        fed |= {port for ports in system.inputs.values() for port in ports}
        top.extend([outer] if len(outer) else [])
    elements = SubElement(top, tag("ssd:Elements"))
    for member in system.members:
        inputs = [name for name in models[member.name].inputs if Port(member.name, name) in fed]
        elements.append(_component(member, models[member.name], inputs, places[member.name], used))
    wires = Element(tag("ssd:Connections"))
    wires.extend(_wire(connection) for connection in system.connections)
    if connectors:
        wires.extend(outer_wires)
    top.extend([wires] if len(wires) else [])
    annotations = SubElement(top, tag("ssd:Annotations"))
    annotations.append(_master(system.step))  # OMSimulator looks at the first one only
    if len(outer) and not connectors:
        annotation = SubElement(annotations, tag("ssc:Annotation"), type=CONNECTORS)
        SubElement(annotation, OUTSIDE).extend(
            [outer, outer_wires]
        )  # an annotation has one element
    define_units(root, SSD, used)
    experiment = SubElement(
        root, tag("ssd:DefaultExperiment"), startTime="0.0", stopTime=repr(float(system.stop))
    )
    annotation = SubElement(
        SubElement(experiment, tag("ssd:Annotations")), tag("ssc:Annotation"), type=STEP
    )
    algorithm = SubElement(annotation, tag("osp:Algorithm"))
    SubElement(algorithm, tag("osp:FixedStepAlgorithm"), baseStepSize=repr(float(system.step)))
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="utf-8") + b"\n"


def _master(step: float) -> Element:
    """Annotation that makes OMSimulator a Jacobi master with a communication step in s.

    The tolerances are its own defaults; FMUs are handed one, and ours are never less exact than they are without.
    """
    annotation = Element(tag("ssc:Annotation"), type=MASTER)
    simulation = SubElement(
        SubElement(annotation, tag("oms:Annotations")), tag("oms:SimulationInformation")
    )
    values = {"stepSize": step, "absoluteTolerance": 1e-4, "relativeTolerance": 1e-4}
    written = {
        name: np.format_float_positional(value, trim="0") for name, value in values.items()
    }  # xs:decimal
    SubElement(simulation, tag("oms:FixedStepMaster"), {"description": "oms-ma"} | written)
    return annotation


def _outside(
    system: System, models: Mapping[str, Model], used: set[str]
) -> tuple[Element, Element]:
    """Connectors of the system, and their connections to its members."""
    connectors, wires = Element(tag("ssd:Connectors")), Element(tag("ssd:Connections"))
    for name, ports in system.inputs.items():
        connectors.append(
            _connector(
                name,
                "input",
                models[ports[0].member].inputs[ports[0].variable] if ports else None,
                used,
            )
        )
        for port in ports:
            ends = {
                "startConnector": name,
                "endElement": port.member,
                "endConnector": port.variable,
            }
            SubElement(wires, tag("ssd:Connection"), ends)
    for name, port in system.outputs.items():
        connectors.append(
            _connector(name, "output", models[port.member].outputs[port.variable], used)
        )
        ends = {"startElement": port.member, "startConnector": port.variable, "endConnector": name}
        SubElement(wires, tag("ssd:Connection"), ends)
    return connectors, wires


def _component(
    member: Member, model: Model, inputs: Sequence[str], places: _Places, used: set[str]
) -> Element:
    """Describe a member with its outputs, and those inputs that something is connected to.

    fmpy fails on an input connector without a connection, so the others are omitted; they can be set all the same.
    """
    component = Element(
        tag("ssd:Component"),
        name=member.name,
        type=FMU,
        source=places.fmu,
        implementation="CoSimulation",
    )
    if inputs or model.outputs:
        connectors = SubElement(component, tag("ssd:Connectors"))
        connectors.extend(_connector(name, "input", model.inputs[name], used) for name in inputs)
        connectors.extend(
            _connector(name, "output", signal, used) for name, signal in model.outputs.items()
        )
    if places.parameters is not None:
        bindings = SubElement(component, tag("ssd:ParameterBindings"))
        SubElement(bindings, tag("ssd:ParameterBinding"), type=PARAMETERS, source=places.parameters)
    return component


def _connector(name: str, kind: str, signal: Signal | None, used: set[str]) -> Element:
    connector = Element(tag("ssd:Connector"), name=name, kind=kind)
    if signal is not None:
        node = SubElement(connector, tag(f"ssc:{signal.type.capitalize()}"))
        if signal.type == "real" and (unit := _told(signal).unit):
            node.set("unit", unit)
            used.add(unit)
    return connector


def _wire(connection: Connection) -> Element:
    source, target = connection.source, connection.target
    wire = Element(
        tag("ssd:Connection"),
        {
            "startElement": source.member,
            "startConnector": source.variable,
            "endElement": target.member,
            "endConnector": target.variable,
        },
    )
    if not connection.passes_on:
        wire.set("suppressUnitConversion", "true")  # the factor is all that is done
        values = {
            "factor": repr(float(connection.factor)),
            "offset": repr(float(connection.offset)),
        }
        SubElement(wire, tag("ssc:LinearTransformation"), values)
    return wire
