"""Writing of systems as SSP files; the same system gives the same bytes.

A system with an FMU of FMI 3.0 is written as SSP 2.0, any other as SSP 1.0. Arrays that are wholly
connected have one connection; connections of single elements have indices.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from fmus.kit import UserError, files
from fmus.kit.build import archive, serialized
from orchestration.fmu import Archive
from orchestration.system.checking import check, interface
from orchestration.system.model import Member, System
from orchestration.system.ssp.arrays import End, Wire, declared, end_of, variable_of, wires
from orchestration.system.ssp.connectors import Definitions, connector, type_of
from orchestration.system.ssp.parameters import write_parameters
from orchestration.system.ssp.vocabulary import (
    CONNECTORS,
    DESCRIPTION,
    ENDINGS,
    FMU,
    LINEAR,
    MASTER,
    OUTSIDE,
    PARAMETERS,
    STEP,
    node,
)


def write(system: System, path: Path, connectors: bool = False) -> None:
    """Write a system with its FMUs and parameters.

    Parameters
    ----------
    system : System
    path : Path
        An ``.ssp`` archive, replaced whole or not at all; or an ``.ssd`` description, written with
        the folder ``resources/`` next to it.
    connectors : bool
        Whether inputs and outputs of the system are written as connectors of the system. libcosim
        and Ecos load no file with connections to these. If False, they are in an annotation that
        only this program reads; other tools see inputs of members without a connection.

    Raises
    ------
    UserError
        If the system does not pass its check, or a file cannot be written; for a description also
        if a different file with the name of one of its resources exists.
    """
    if path.suffix not in ENDINGS:
        raise UserError(
            f"{path}: a system is written as {' or '.join(ENDINGS)}, not"
            f" {path.suffix or 'without an ending'}"
        )
    check(system)
    resources: dict[str, bytes] = {}  # contents by path
    description = _describe(system, resources, connectors)
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


def _store(resources: dict[str, bytes], name: str, ending: str, contents: bytes) -> str:
    """Add a file to the resources, and return its path; equal files of one name are stored once.

    The path has only characters that are the same in a URI, as some tools do not distinguish paths
    and URIs. It has a number if other contents have that path.
    """
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
    suffixes = chain([""], (f"_{number}" for number in count(2)))
    paths = (f"resources/{plain}{suffix}{ending}" for suffix in suffixes)
    # some file systems do not distinguish upper and lower case
    taken = {other.casefold() for other in resources}
    free = (p for p in paths if resources.get(p) == contents or p.casefold() not in taken)
    path = next(free)
    resources[path] = contents
    return path


def _describe(system: System, resources: dict[str, bytes], connectors: bool) -> bytes:
    """Return the description of a system, an SSD in UTF-8; add the other files to `resources`."""
    version = "2.0" if any(map(declared, system.members)) else "1.0"
    definitions = Definitions()
    root = node(
        "ssd:SystemStructureDescription",
        _system_element(system, resources, connectors, definitions),
        version=version,
        name=system.name,
    )
    definitions.append_to(root)
    root.append(_experiment(system))
    return serialized(root)


def _system_element(
    system: System, resources: dict[str, bytes], connectors: bool, definitions: Definitions
) -> Element:
    """Return the element ``System``; `connectors` as in `write`, others as in `_describe`."""
    members = {member.name: member for member in system.members}
    system_connectors = _connectors_of_system(system, members, definitions)
    outer = _wires_of_system(system, members)
    inner = wires(system.connections, members)
    written = [*inner, *outer] if connectors else inner
    ends = {end for wire in written for end in (wire.source, wire.target)}
    components = [
        _component(member, _connectors_of(member, ends, definitions), resources)
        for member in system.members
    ]
    annotations = [_master_annotation(system.step)]  # OMSimulator reads the first one only
    if system_connectors and not connectors:
        annotations.append(_outside_annotation(system_connectors, outer))
    top = node(
        "ssd:System",
        *_group("ssd:Connectors", system_connectors if connectors else []),
        *_group("ssd:Elements", components),
        *_group("ssd:Connections", map(_connection, written)),
        *_group("ssd:Annotations", annotations),
        name=system.name,
    )
    if system.doc:
        top.set("description", system.doc)
    return top


def _group(name: str, children: Iterable[Element]) -> list[Element]:
    """Return the element of a group in a list, which is empty without children.

    SSP allows no empty groups.
    """
    listed = list(children)
    return [node(name, *listed)] if listed else []


def _component(
    member: Member, connectors: Sequence[Element], resources: dict[str, bytes]
) -> Element:
    """Return the element of a member with its connectors; add its FMU and its parameters."""
    fmu = _store(resources, member.fmu.stem, ".fmu", member.fmu.read_bytes())
    bindings = []
    if member.parameters:
        source = _store(resources, member.name, ".ssv", write_parameters(member))
        bindings = [node("ssd:ParameterBinding", type=PARAMETERS, source=source)]
    with Archive(member.fmu) as fmu_archive:
        implementation = fmu_archive.implementation
    return node(
        "ssd:Component",
        *_group("ssd:Connectors", connectors),
        *_group("ssd:ParameterBindings", bindings),
        name=member.name,
        type=FMU,
        source=fmu,
        implementation=implementation,
    )


def _connectors_of(member: Member, ends: Container[End], definitions: Definitions) -> list[Element]:
    """Describe the outputs of a member, and its connected inputs.

    Other inputs are omitted, as fmpy fails on an input connector without a connection; tools can
    set them without a connector.
    """
    model = interface(member)
    described: dict[str, Element] = {}

    def describe(kind: str, element: str) -> None:
        """Describe the connector of a signal, unless another element of its array has it."""
        name = end_of(member, element).connector
        if name not in described:
            type_element = type_of(member, element, definitions)
            shape = variable_of(member, name).shape
            described[name] = connector(name, kind, type_element, shape)

    for element in model.inputs:
        end = end_of(member, element)
        whole = End(member.name, end.connector)  # a wire of the whole array
        if end in ends or whole in ends:
            describe("input", element)
    for element in model.outputs:
        describe("output", element)
    return list(described.values())


def _connectors_of_system(
    system: System, members: Mapping[str, Member], definitions: Definitions
) -> list[Element]:
    """Describe the connectors of the system: scalars, with the types of their first ports."""
    inputs = [("input", name, ports) for name, ports in system.inputs.items()]
    outputs = [("output", name, (port,)) for name, port in system.outputs.items()]
    return [
        connector(
            name,
            kind,
            type_of(members[ports[0].member], ports[0].variable, definitions) if ports else None,
        )
        for kind, name, ports in (*inputs, *outputs)
    ]


def _wires_of_system(system: System, members: Mapping[str, Member]) -> list[Wire]:
    """Return the connections of the connectors of the system to its members."""
    inputs = [
        Wire(End("", name), end_of(members[port.member], port.variable))
        for name, port in system.fed_ports
    ]
    outputs = [
        Wire(end_of(members[port.member], port.variable), End("", name))
        for name, port in system.outputs.items()
    ]
    return inputs + outputs


def _connection(wire: Wire) -> Element:
    """Return the element of a connection."""
    element = node("ssd:Connection")
    for side, end in (("start", wire.source), ("end", wire.target)):
        if end.member:
            element.set(f"{side}Element", end.member)
        element.set(f"{side}Connector", end.connector)
        if end.indices:
            element.set(f"{side}Indices", " ".join(map(str, end.indices)))
    factor, offset, table = wire.change
    if table:  # enumerations are mapped by their values, too
        kind = "Boolean" if wire.is_boolean else "Integer"
        entries = [
            node("ssc:MapEntry", source=f"{value:.0f}", target=f"{received:.0f}")
            for value, received in table
        ]
        element.append(node(f"ssc:{kind}MappingTransformation", *entries))
    elif not wire.passes_on:
        element.set("suppressUnitConversion", "true")  # the factor includes the conversion
        element.append(node(LINEAR, factor=repr(float(factor)), offset=repr(float(offset))))
    return element


def _outside_annotation(connectors: Sequence[Element], outer: Sequence[Wire]) -> Element:
    """Return our annotation with the connectors of the system, and their connections."""
    outside = Element(OUTSIDE)  # an annotation has one element
    outside.extend(_group("ssd:Connectors", connectors))
    outside.extend(_group("ssd:Connections", map(_connection, outer)))
    return node("ssc:Annotation", outside, type=CONNECTORS)


def _master_annotation(step: float) -> Element:
    """Return the annotation that makes OMSimulator run as a Jacobi master with a fixed step.

    Parameters
    ----------
    step : float
        Communication step, s.
    """
    # The tolerances are OMSimulator's defaults. It passes one to the FMUs, of which ours take the
    # smaller of it and their own.
    values = {"stepSize": step, "absoluteTolerance": 1e-4, "relativeTolerance": 1e-4}
    # xs:decimal has no exponent
    texts = {name: np.format_float_positional(value, trim="0") for name, value in values.items()}
    master = node("oms:FixedStepMaster", description="oms-ma", **texts)
    information = node("oms:SimulationInformation", master)
    return node("ssc:Annotation", node("oms:Annotations", information), type=MASTER)


def _experiment(system: System) -> Element:
    """Describe the default experiment, with libcosim's annotation of the communication step."""
    step = node("osp:FixedStepAlgorithm", baseStepSize=repr(float(system.step)))
    annotation = node("ssc:Annotation", node("osp:Algorithm", step), type=STEP)
    return node(
        "ssd:DefaultExperiment",
        node("ssd:Annotations", annotation),
        startTime=repr(float(system.start)),
        stopTime=repr(float(system.stop)),
    )
