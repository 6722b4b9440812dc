"""Checks of ``terminalsAndIcons/terminalsAndIcons.xml``: schema, variables and icons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from orchestration.fmu.archive import Archive, parse_xml
from orchestration.fmu.check.finding import Finding, listed

_FOLDER = "terminalsAndIcons"
_FILE = f"{_FOLDER}/terminalsAndIcons.xml"
_REFERENCES = ("variableName", "inStreamVariableName", "outStreamVariableName")


def check_terminals(archive: Archive) -> Iterator[Finding]:
    """Check the terminals and icons of an FMU of FMI 3.0.

    Yields
    ------
    Finding
    """
    contents = archive.read(_FILE) if archive.version == 3 and _FILE in archive.names else None
    if contents is None:
        return
    try:
        root = parse_xml(contents, str(archive.path), _FILE)
    except UserError as error:
        yield Finding("terminals", str(error).removeprefix(f"{archive.path}: "))
        return
    for problem in _schema_problems(contents):
        yield Finding("terminals", f"{_FILE}: {problem}")
    yield from _check_references(archive, root)
    icons = {node.get("iconBaseName", "") for node in root.iter("TerminalGraphicalRepresentation")}
    absent = [name for name in sorted(icons) if f"{_FOLDER}/{name}.png" not in archive.names]
    if absent:
        yield Finding("terminals", f"{_FILE}: no picture (.png) of {listed(absent)}")


def _schema_problems(contents: bytes) -> list[str]:
    import fmpy
    from lxml import etree

    folder = Path(fmpy.__file__).parent / "schema" / "fmi3"
    schema = etree.XMLSchema(file=str(folder / "fmi3TerminalsAndIcons.xsd"))
    schema.validate(etree.fromstring(contents))
    return [f"{entry.message} (line {entry.line})" for entry in schema.error_log]


def _check_references(archive: Archive, root: Element) -> Iterator[Finding]:
    """Check that variables of terminals exist, and that names of terminals are unique."""
    description = archive.description
    declared = [*description.iterfind("ModelVariables/*"), *description.iter("Alias")]
    variables = {node.get("name") for node in declared}
    unknown: dict[str, None] = {}
    for node in root.iter():
        for attribute in _REFERENCES:
            name = node.get(attribute)
            if name is not None and name not in variables:
                unknown[name] = None
    if unknown:
        yield Finding(
            "terminals", f"{_FILE}: there are no variables {listed(unknown)}", list(unknown)
        )
    for parent in root.iter():
        counts = Counter(node.get("name", "") for node in parent.iterfind("Terminal"))
        repeated = [name for name, count in counts.items() if count > 1]
        if repeated:
            yield Finding("terminals", f"{_FILE}: several terminals are called {listed(repeated)}")
