"""Checks of the archive of an FMU: paths, integrity, identity, documentation and sources."""

from __future__ import annotations

import datetime
import re
import stat
import uuid
import zipfile
from collections.abc import Iterator
from pathlib import PurePosixPath

from orchestration.fmu.archive import Archive
from orchestration.fmu.check.build_description import check_build_description, has_sources
from orchestration.fmu.check.finding import Finding, listed
from orchestration.fmu.check.standards import STANDARDS


def check_archive(archive: Archive) -> Iterator[Finding]:
    """Check paths, integrity, identity, documentation, licence and sources of an FMU.

    Yields
    ------
    Finding
    """
    yield from _check_entries(archive)
    yield from _check_identity(archive)
    yield from _check_documents(archive)
    yield from _check_sources(archive)


def _check_entries(archive: Archive) -> Iterator[Finding]:
    """Check paths, compression, permissions and integrity of all entries."""
    seen: set[str] = set()
    for entry in archive.entries():
        name = entry.orig_filename
        parts = PurePosixPath(name).parts
        if name.startswith("/") or ".." in parts or re.match(r"[A-Za-z]:", name):
            yield Finding(
                "path-outside", f"{name!r} leads out of the folder the FMU is unzipped to"
            )
        if name in seen:
            yield Finding("duplicate-entry", f"{name!r} is twice in the archive")
        seen.add(name)
        if name.endswith("/"):
            continue
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            yield Finding(
                "compression",
                f"{name!r} is compressed by a method that many hosts lack; use deflate",
            )
        mode = entry.external_attr >> 16
        if stat.S_ISLNK(mode):
            yield Finding("symbolic-link", f"{name!r} is a symbolic link: it may lead anywhere")
        if mode & (stat.S_ISUID | stat.S_ISGID):
            yield Finding("setuid", f"{name!r} would run with the rights of its owner (setuid)")
        if not archive.is_intact(entry.filename):
            yield Finding("damaged-entry", f"{name!r} is damaged, encrypted or cannot be unpacked")


def _check_identity(archive: Archive) -> Iterator[Finding]:
    """Check that the GUID and all times depend on the contents alone."""
    attribute = STANDARDS[archive.version].token
    word = attribute.replace("guid", "GUID")
    guid = archive.description.get(attribute, "")
    if not guid.strip():
        yield Finding("no-guid", f"the {word} is empty")
    elif not re.fullmatch(r"\{?[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}\}?", guid):
        yield Finding("guid-form", f"the {word} {guid!r} has not the form of a UUID")
    elif uuid.UUID(guid).version in (1, 4, 6, 7):
        origin = "at random" if uuid.UUID(guid).version == 4 else "from the clock"
        yield Finding(
            "guid-not-from-contents",
            f"the {word} {guid} is made {origin}, not from the contents: no two builds agree",
        )
    times = sorted({entry.date_time for entry in archive.entries()})
    generation = archive.description.get("generationDateAndTime", "")
    if generation and _is_same_day(generation, times[-1]):
        yield Finding(
            "generation-date",
            f"generationDateAndTime is {generation}, when the archive was packed: no two builds are"
            " the same bytes",
        )
    if len(times) > 1:
        first = _format_time(times[0])
        last = _format_time(times[-1])
        yield Finding(
            "entry-times",
            f"files carry times from {first} to {last}: no two builds are the same bytes",
        )


def _format_time(time: tuple[int, ...]) -> str:
    return "{:04}-{:02}-{:02} {:02}:{:02}:{:02}".format(*time)


def _is_same_day(date: str, newest_entry: tuple[int, ...]) -> bool:
    """Return whether two dates are at most a day apart, the most by which time zones differ."""
    try:
        day = datetime.date.fromisoformat(date.strip()[:10])
        return abs((day - datetime.date(*newest_entry[:3])).days) <= 1
    except ValueError:
        return False


def _check_documents(archive: Archive) -> Iterator[Finding]:
    """Check documentation, icon, licence, reference result and external dependencies."""
    names = set(archive.names)
    if not names & {"documentation/index.html", "documentation/_main.html"}:
        yield Finding("no-documentation", "no documentation (documentation/index.html)")
    icons = STANDARDS[archive.version].icons
    if not names & icons:
        yield Finding("no-icon", f"no icon ({sorted(icons)[0]})")
    if not any(name.startswith("documentation/licenses/") for name in names):
        yield Finding("no-licence", "no licence (documentation/licenses/)")
    references = [name for name in names if name.startswith("extra/org.fmi-standard.fmi-ls-ref/")]
    if all(name.endswith("/fmi-ls-manifest.xml") for name in references):  # also if there are none
        yield Finding(
            "no-reference-result", "no reference result (extra/org.fmi-standard.fmi-ls-ref/)"
        )
    documents = names & {
        "documentation/externalDependencies.txt",
        "documentation/externalDependencies.html",
    }
    needs_tool = any(
        element.get("needsExecutionTool") in ("true", "1") for element in archive.interfaces()
    )
    if needs_tool and not documents:
        yield Finding(
            "no-external-dependencies",
            "needsExecutionTool is true, but there is no documentation/externalDependencies.txt"
            " that names the tool",
        )
    if documents and not needs_tool:
        yield Finding(
            "external-dependencies",
            f"needsExecutionTool is false, but there is {sorted(documents)[0]}",
        )


def _check_sources(archive: Archive) -> Iterator[Finding]:
    """Check that the listed source files exist, and that existing ones are listed."""
    if archive.version == 3:
        yield from check_build_description(archive)
        return
    for element in archive.interfaces():
        files = [node.get("name", "") for node in element.iterfind("SourceFiles/File")]
        absent = [name for name in files if f"sources/{name}" not in archive.names]
        if absent:
            yield Finding(
                "missing-source",
                f"{element.tag}: source files listed but not in sources/: {listed(absent)}",
            )
    lists_sources = any(element.find("SourceFiles") is not None for element in archive.interfaces())
    if has_sources(archive) and not lists_sources:
        yield Finding(
            "unlisted-sources",
            "there are sources/, but SourceFiles lists none: nobody can compile them",
        )
