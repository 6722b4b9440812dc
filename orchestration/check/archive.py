"""The archive of an FMU: opening it, and what must be in it besides binaries."""

from __future__ import annotations

import re
import uuid
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from types import TracebackType
from xml.etree import ElementTree

from fmus.kit.errors import UserError

from .finding import Finding, listed

_DESCRIPTION = "modelDescription.xml"
# What zipfile raises on damaged, encrypted or strangely compressed members.
_UNREADABLE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError, ValueError)


class Archive:
    """An opened FMU; a context manager.

    Parameters
    ----------
    path : Path

    Raises
    ------
    UserError
        If the file is missing, no zip archive, no FMU, or not of FMI 2.0.

    Attributes
    ----------
    path : Path
    names : list of str
        Files in it, folders left out.
    description : xml.etree.ElementTree.Element
        Root of ``modelDescription.xml``.
    """

    def __init__(self, path: Path):
        self.path = path
        if not path.is_file():
            raise UserError(f"{path}: no such file")
        try:
            self._zip = zipfile.ZipFile(path)
        except _UNREADABLE as error:
            raise UserError(f"{path}: not an FMU (an FMU is a zip archive; this is none, or it is cut off)") from error
        try:
            self.names = [name for name in self._zip.namelist() if not name.endswith("/")]
            self.description = self._read_description()
        except UserError:
            self._zip.close()
            raise

    def _read_description(self) -> ElementTree.Element:
        if _DESCRIPTION not in self.names:
            raise UserError(f"{self.path}: a zip archive but not an FMU ({_DESCRIPTION} is not in it)")
        try:
            root = ElementTree.fromstring(self._zip.read(_DESCRIPTION))
        except (ElementTree.ParseError, LookupError, *_UNREADABLE) as error:
            raise UserError(f"{self.path}: {_DESCRIPTION} cannot be read ({error})") from error
        version = root.get("fmiVersion", "")
        if root.tag != "fmiModelDescription":
            raise UserError(f"{self.path}: {_DESCRIPTION} is a {root.tag!r}, expected 'fmiModelDescription'")
        if version != "2.0":
            raise UserError(f"{self.path}: FMI version {version or '(none)'}; this check knows FMI 2.0")
        return root

    def __enter__(self) -> Archive:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._zip.close()

    def read(self, name: str) -> bytes | None:
        """Contents of a file; None if it is damaged (which `check_archive` reports)."""
        try:
            return self._zip.read(name)
        except _UNREADABLE:
            return None

    def entries(self) -> list[zipfile.ZipInfo]:
        """Everything in the archive, folders too."""
        return self._zip.infolist()

    def interfaces(self) -> list[ElementTree.Element]:
        """Elements ``CoSimulation`` and ``ModelExchange``, those that are there."""
        return [element for element in self.description if element.tag in ("CoSimulation", "ModelExchange")]


def check_archive(archive: Archive) -> Iterator[Finding]:
    """Check paths, integrity, identity, documentation, licences and sources.

    Yields
    ------
    Finding
    """
    yield from _form(archive)
    yield from _identity(archive)
    yield from _documents(archive)
    yield from _sources(archive)


def _form(archive: Archive) -> Iterator[Finding]:
    seen: set[str] = set()
    for entry in archive.entries():
        name = entry.orig_filename
        parts = PurePosixPath(name).parts
        if name.startswith("/") or ".." in parts or re.match(r"[A-Za-z]:", name):
            yield Finding(10, "error", f"{name!r} leads out of the folder the FMU is unzipped to")
        if name in seen:
            yield Finding(10, "error", f"{name!r} is twice in the archive")
        seen.add(name)
        if name.endswith("/"):
            continue
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            yield Finding(10, "warning", f"{name!r} is compressed by a method many hosts lack; deflate is for all")
        if archive.read(entry.filename) is None:
            yield Finding(10, "error", f"{name!r} is damaged, encrypted or cannot be unpacked")


def _identity(archive: Archive) -> Iterator[Finding]:
    guid = archive.description.get("guid", "")
    if not guid.strip():
        yield Finding(3, "error", "the GUID is empty")
    elif not re.fullmatch(r"\{?[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}\}?", guid):
        yield Finding(3, "note", f"the GUID {guid!r} has not the form of a UUID")
    elif (version := uuid.UUID(guid).version) in (1, 4, 6, 7):
        origin = "at random" if version == 4 else "from the clock"
        yield Finding(3, "warning", f"the GUID {guid} is made {origin}, not from the contents: no two builds agree")
    if made := archive.description.get("generationDateAndTime"):
        yield Finding(3, "warning", f"generationDateAndTime is {made}: no two builds are the same bytes")
    times = sorted({entry.date_time for entry in archive.entries()})
    if len(times) > 1:
        first, last = ("{:04}-{:02}-{:02} {:02}:{:02}:{:02}".format(*time) for time in (times[0], times[-1]))
        yield Finding(3, "warning", f"files carry times from {first} to {last}: no two builds are the same bytes")


def _documents(archive: Archive) -> Iterator[Finding]:
    names = set(archive.names)
    if not names & {"documentation/index.html", "documentation/_main.html"}:
        yield Finding(10, "warning", "no documentation (documentation/index.html)")
    if "model.png" not in names:
        yield Finding(10, "note", "no icon (model.png)")
    if not any(name.startswith("documentation/licenses/") for name in names):
        yield Finding(10, "warning", "no licence (documentation/licenses/)")
    if not any(name.startswith("extra/org.fmi-standard.fmi-ls-ref/") for name in names):
        yield Finding(10, "note", "no reference result (extra/org.fmi-standard.fmi-ls-ref/)")
    told = names & {"documentation/externalDependencies.txt", "documentation/externalDependencies.html"}
    needed = any(element.get("needsExecutionTool") in ("true", "1") for element in archive.interfaces())
    if needed and not told:
        yield Finding(
            10, "warning", "needsExecutionTool is true, but documentation/externalDependencies.txt does not say which"
        )
    if told and not needed:
        yield Finding(10, "warning", f"needsExecutionTool is false, but there is {sorted(told)[0]}")


def _sources(archive: Archive) -> Iterator[Finding]:
    for element in archive.interfaces():
        files = [node.get("name", "") for node in element.iterfind("SourceFiles/File")]
        if absent := [name for name in files if f"sources/{name}" not in archive.names]:
            yield Finding(10, "error", f"{element.tag}: source files listed but not in sources/: {listed(absent)}")
    if any(name.startswith("sources/") and name.endswith((".c", ".cpp")) for name in archive.names) and not any(
        element.find("SourceFiles") is not None for element in archive.interfaces()
    ):
        yield Finding(10, "warning", "there are sources/, but SourceFiles lists none: nobody can compile them")
