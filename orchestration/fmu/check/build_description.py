"""Checks of ``sources/buildDescription.xml``, the build description of sources of FMI 3.0."""

from __future__ import annotations

from collections.abc import Iterator

from fmus.kit import UserError
from orchestration.fmu.archive import Archive, parse_xml
from orchestration.fmu.check.finding import Finding, listed

_FILE = "sources/buildDescription.xml"


def has_sources(archive: Archive) -> bool:
    """Return whether an FMU contains source files in C or C++."""
    return any(
        name.startswith("sources/") and name.endswith((".c", ".cpp")) for name in archive.names
    )


def check_build_description(archive: Archive) -> Iterator[Finding]:
    """Check that the listed source files exist, and that every interface has a build.

    The schema of the file is checked with that of the model description.

    Yields
    ------
    Finding
    """
    if _FILE not in archive.names:
        if has_sources(archive):
            yield Finding(
                "unlisted-sources", f"there are sources/, but no {_FILE}: nobody can compile them"
            )
        return
    contents = archive.read(_FILE)
    if contents is None:
        return
    try:
        root = parse_xml(contents, str(archive.path), _FILE)
    except UserError as error:
        yield Finding("build-description", str(error).removeprefix(f"{archive.path}: "))
        return
    files = dict.fromkeys(node.get("name", "") for node in root.iter("SourceFile"))
    absent = [name for name in files if f"sources/{name}" not in archive.names]
    if absent:
        yield Finding(
            "missing-source", f"{_FILE}: files listed but not in sources/: {listed(absent)}"
        )
    builds = {node.get("modelIdentifier", "") for node in root.iterfind("BuildConfiguration")}
    missing = {node.get("modelIdentifier", "") for node in archive.interfaces()} - builds
    if missing:
        yield Finding("build-description", f"{_FILE}: nothing builds {listed(sorted(missing))}")
