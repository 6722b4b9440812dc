"""Reading of systems from SSP files; unknown contents raise an error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from orchestration.system.model import System
from orchestration.system.ssp.connections import read_connections
from orchestration.system.ssp.flattening import Structure
from orchestration.system.ssp.members import read_members
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.vocabulary import (
    CONNECTORS,
    NAMESPACES,
    OUTSIDE,
    STEP,
    attribute,
    check_elements,
    enumerations,
    number,
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
        root = package.document(name, "ssd:SystemStructureDescription")
        systems = root.findall("ssd:System", NAMESPACES)
        if len(systems) != 1:
            raise UserError(f"{'more than one' if systems else 'no'} System in {name}")
        return _read_system(root, systems[0], package, folder)


@contextmanager
def _path_in_errors(path: Path) -> Iterator[None]:
    """Begin the message of a UserError with the path of the system, once."""
    prefix = f"{path}: "
    try:
        yield
    except UserError as error:
        raise UserError(prefix + str(error).replace(prefix, "")) from error


def _read_system(root: Element, top: Element, package: Package, folder: Path) -> System:
    """Read the system in the element `top`."""
    structure = Structure(package, enumerations(root, "ssd"))
    for part in (top, *_annotated_parts(top)):
        structure.add(part)
    members = read_members(structure, package, folder)
    connections, connectors = read_connections(structure, members)
    return System(
        attribute(top, "name"),
        tuple(members.values()),
        tuple(connections),
        {name: tuple(one.ports) for name, one in connectors.items() if one.kind == "input"},
        {name: one.ports[0] for name, one in connectors.items() if one.kind == "output"},
        top.get("description", ""),
        **_read_experiment(root),
    )


def _annotated_parts(top: Element) -> list[Element]:
    """Return the elements of our annotations with connectors of the system."""
    annotation = f"ssd:Annotations/ssc:Annotation[@type='{CONNECTORS}']"
    parts = top.findall(f"{annotation}/{OUTSIDE}", NAMESPACES)
    for part in parts:
        check_elements(part)
    return parts


def _read_experiment(root: Element) -> dict[str, float]:
    """Read start, stop and communication step as keyword arguments of a `System`."""
    times: dict[str, float] = {}
    for experiment in root.iterfind("ssd:DefaultExperiment", NAMESPACES):
        times["start"] = number(experiment, "startTime", "0")
        times["stop"] = number(experiment, "stopTime", repr(times["start"] + 1.0))
        annotation = f"ssd:Annotations/ssc:Annotation[@type='{STEP}']"
        algorithm = f"{annotation}/osp:Algorithm/osp:FixedStepAlgorithm"
        for element in experiment.iterfind(algorithm, NAMESPACES):
            times["step"] = number(element, "baseStepSize", "")
    return times
