"""Reading of systems from SSP files; unknown contents raise an error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from orchestration.fmu.archive import parse_xml
from orchestration.system.model import System
from orchestration.system.ssp.connections import read_connections
from orchestration.system.ssp.flattening import flatten
from orchestration.system.ssp.junctions import take
from orchestration.system.ssp.members import read_members
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.vocabulary import (
    CONNECTORS,
    NAMESPACES,
    OUTSIDE,
    STEP,
    attribute,
    check_elements,
    check_version,
    local_name,
    number,
    tag,
)


def read(path: Path, folder: Path) -> System:
    """Read a system.

    Parameters
    ----------
    path : Path
        An ``.ssp`` archive, or an ``.ssd`` description in the folder of its files.
    folder : Path
        Folder into which the FMUs of an archive are unpacked.

    Returns
    -------
    System
        Its members have no ``cls``, which an FMU does not give.

    Raises
    ------
    UserError
        If it cannot be read, is not safe to unpack, declares connectors that the FMUs do not have,
        or contains models other than FMUs.
    """
    with Package(path) as package, _path_in_errors(path):
        name = package.description
        root = parse_xml(package.text(name), str(path), name)
        if root.tag != tag("ssd:SystemStructureDescription"):
            raise UserError(f"{name} is a {local_name(root)}, not a SystemStructureDescription")
        check_version(root, name)
        systems = root.findall("ssd:System", NAMESPACES)
        if len(systems) != 1:
            raise UserError(f"{'more than one' if systems else 'no'} System in {name}")
        check_elements(root)
        return _read_system(root, systems[0], package, folder)


@contextmanager
def _path_in_errors(path: Path) -> Iterator[None]:
    """Put the path of the system before the message of a UserError, unless it is there."""
    try:
        yield
    except UserError as error:
        if str(error).startswith(f"{path}: "):
            raise
        raise UserError(f"{path}: {error}") from error


def _read_system(root: Element, top: Element, package: Package, folder: Path) -> System:
    """Read the system in the element `top`."""
    aliases = flatten(top)
    junctions = take(top, package)
    members = read_members(top, package, folder, aliases)
    parts = [top, *_annotated_parts(top)]
    connections, connectors = read_connections(parts, members, junctions)
    experiment = root.find("ssd:DefaultExperiment", NAMESPACES)
    return System(
        attribute(top, "name"),
        tuple(members.values()),
        tuple(connections),
        {name: tuple(ports) for name, ports in connectors.inputs.items()},
        connectors.connected_outputs(),
        top.get("description", ""),
        **({} if experiment is None else _read_experiment(experiment)),
    )


def _annotated_parts(top: Element) -> list[Element]:
    """Return the elements of our annotations with connectors of the system."""
    annotations = top.findall("ssd:Annotations/ssc:Annotation", NAMESPACES)
    ours = [annotation for annotation in annotations if annotation.get("type") == CONNECTORS]
    parts = [part for annotation in ours for part in annotation.findall(OUTSIDE)]
    for part in parts:
        check_elements(part)
    return parts


def _read_experiment(experiment: Element) -> dict[str, float]:
    """Read start, stop and communication step as keyword arguments of a `System`."""
    times = {"start": number(experiment, "startTime", "0")}
    times["stop"] = number(experiment, "stopTime", repr(times["start"] + 1.0))
    for annotation in experiment.findall("ssd:Annotations/ssc:Annotation", NAMESPACES):
        algorithm = annotation.find("osp:Algorithm/osp:FixedStepAlgorithm", NAMESPACES)
        if annotation.get("type") == STEP and algorithm is not None:
            times["step"] = number(algorithm, "baseStepSize", "")
    return times
