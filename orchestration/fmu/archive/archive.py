"""Archives of FMUs: opening within bounds, reading the model description, and unpacking."""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from fmus.kit.storage import cache, scratch
from orchestration.fmu.archive.bounded import (
    FILE,
    TEXT,
    UNREADABLE,
    check_size,
    open_zip,
    parse_xml,
)
from orchestration.fmu.archive.default_experiment import experiment_faults
from orchestration.fmu.archive.unit_definitions import spell_units
from orchestration.fmu.wrapping import (
    DeclaredVariable,
    Translation,
    add_solver,
    log_calls,
    solved,
    translate,
    wrap,
)

_DESCRIPTION = "modelDescription.xml"
_SYSTEM = "SystemStructure.ssd"
_VARIABLES = "ModelVariables"
_CHUNK = 2**20  # bytes read at once


class Archive:
    """The opened archive of an FMU; a context manager.

    Parameters
    ----------
    path : Path

    Raises
    ------
    UserError
        If the file is missing, no zip archive, no FMU of FMI 2.0 or 3.0, or beyond the bounds of
        `orchestration.fmu.archive.bounded`.

    Attributes
    ----------
    path : Path
    names : list of str
        Names of its files, without folders.
    description : Element
        Root of ``modelDescription.xml``.
    version : {2, 3}
        Major version of FMI.
    """

    def __init__(self, path: Path):
        self.path = path
        if not path.is_file():
            reason = "a folder, not an FMU file" if path.is_dir() else "no such file"
            raise UserError(f"{path}: {reason}")
        self._zip = open_zip(
            path, str(path), "not an FMU (an FMU is a zip archive; this is none, or it is cut off)"
        )
        try:
            self.names = [name for name in self._zip.namelist() if not name.endswith("/")]
            self.description = self._read_description()
        except UserError:
            self._zip.close()
            raise

    def _read_description(self) -> Element:
        if _SYSTEM in self.names:
            raise UserError(f"{self.path}: a system (SSP), where an FMU is needed")
        if _DESCRIPTION not in self.names:
            raise UserError(
                f"{self.path}: a zip archive but not an FMU ({_DESCRIPTION} is not in it)"
            )
        check_size(str(self.path), _DESCRIPTION, self._zip.getinfo(_DESCRIPTION).file_size, TEXT)
        try:
            contents = self._zip.read(_DESCRIPTION)
        except UNREADABLE as error:
            raise UserError(f"{self.path}: {_DESCRIPTION} cannot be read ({error})") from error
        root = parse_xml(contents, str(self.path), _DESCRIPTION)
        if root.tag != "fmiModelDescription":
            raise UserError(
                f"{self.path}: {_DESCRIPTION} is a {root.tag!r}, expected 'fmiModelDescription'"
            )
        version = root.get("fmiVersion", "")
        if version != "2.0" and not re.fullmatch(r"3\.0(\.\d+)?", version):
            raise UserError(
                f"{self.path}: FMI version {version[:40] or 'not stated'}; this program knows FMI"
                " 2.0 and 3.0"
            )
        self.version = int(version[0])
        return root

    @cached_property
    def _translation(self) -> Translation:
        return translate(self.description, str(self.path))

    @property
    def as_fmi2(self) -> Element:
        """The model description, translated to FMI 2.0 if need be; UserError if it is invalid."""
        return self.description if self.version == 2 else self._translation.root

    @property
    def declared(self) -> dict[str, DeclaredVariable]:
        """Variables of FMI 3.0 by name; empty for an FMU of FMI 2.0."""
        return {} if self.version == 2 else self._translation.declared

    @property
    def host_platform(self) -> str:
        """Name of the folder in ``binaries/`` for this machine."""
        import fmpy

        return str(fmpy.platform if self.version == 2 else fmpy.platform_tuple)

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *error: Any) -> None:
        self._zip.close()

    @property
    def platforms(self) -> list[str]:
        """Names of the folders in ``binaries/`` that contain files, sorted."""
        paths = [name.split("/") for name in self.names]
        return sorted({parts[1] for parts in paths if parts[0] == "binaries" and len(parts) > 2})

    def read(self, name: str) -> bytes | None:
        """Return the contents of a file; None if it is damaged or larger than `FILE`."""
        try:
            return self._zip.read(name) if self._zip.getinfo(name).file_size <= FILE else None
        except UNREADABLE:
            return None

    def is_intact(self, name: str) -> bool:
        """Return whether a file can be unpacked."""
        try:
            with self._zip.open(name) as file:
                while file.read(_CHUNK):
                    pass
        except UNREADABLE:
            return False
        return True

    def entries(self) -> list[zipfile.ZipInfo]:
        """Return all files and folders in the archive."""
        return self._zip.infolist()

    def interfaces(self) -> list[Element]:
        """Return the existing elements among ``CoSimulation`` and ``ModelExchange``.

        Without them that of scheduled execution, which is run as co-simulation.
        """
        found = [node for node in self.description if node.tag in ("CoSimulation", "ModelExchange")]
        return found or self.description.findall("ScheduledExecution")

    @property
    def implementation(self) -> str:
        """The name of the element of the interface by which it is run."""
        tags = [node.tag for node in self.interfaces()]
        return "CoSimulation" if "CoSimulation" in tags or not tags else tags[0]

    @property
    def idle_clocks(self) -> list[str]:
        """Names of input clocks that never tick here, because nothing triggers them."""
        return [
            node.get("name", "")
            for node in self.description.iterfind(f"{_VARIABLES}/Clock")
            if (node.get("causality"), node.get("intervalVariability")) == ("input", "triggered")
        ]

    def check_interfaces(self) -> None:
        """Raise UserError if an element is missing that a run needs, or one is not supported."""
        where = f"{self.path}: {_DESCRIPTION}"
        token = "guid" if self.description.get("fmiVersion") == "2.0" else "instantiationToken"
        if not self.description.get(token):
            raise UserError(f"{where} has no attribute {token}")
        if not self.interfaces():
            raise UserError(f"{where} has neither an element CoSimulation nor ModelExchange")
        for interface in self.interfaces():
            identifier = interface.get("modelIdentifier")
            if not identifier:
                raise UserError(f"{where}: {interface.tag} has no attribute modelIdentifier")
            # a library is loaded by this name; other tools have dashes and points in it
            if set(identifier) & set("/\\:") or not identifier.isprintable():
                raise UserError(f"{where}: modelIdentifier {identifier!r} is no name of a library")
        for fault in experiment_faults(self.description):
            raise UserError(f"{where}: {fault}")
        variables = self.description.find(_VARIABLES)
        if variables is None:
            raise UserError(f"{where} has no element {_VARIABLES}")


def read_description(path: Path) -> Any:
    """Read the model description of an FMU, also of one for model exchange alone; see `solved`.

    Parameters
    ----------
    path : Path

    Returns
    -------
    fmpy.model_description.ModelDescription

    Raises
    ------
    UserError
        If the file is missing, no zip archive, no FMU of FMI 2.0 or 3.0, or an element is missing.
    """
    import fmpy

    with Archive(path) as archive:  # without validation, which is the task of `ppy check`
        archive.check_interfaces()
        source = str(path) if archive.version == 2 else _packed(archive.as_fmi2)
        interface = archive.description.find("CoSimulation")
        root = archive.as_fmi2
    try:
        description = fmpy.read_model_description(source, validate=False)
    except Exception as error:
        raise UserError(f"{path}: {_DESCRIPTION} cannot be read ({first_line(error)})") from error
    if description.coSimulation is None:
        description.coSimulation = solved(description.modelExchange)
    spell_units(description, root)
    if interface is not None:  # FMI 2.0 has no place for it
        description.coSimulation.fixedInternalStepSize = interface.get("fixedInternalStepSize")
    return description


def for_model_exchange(path: Path) -> Path:
    """Return a copy of an FMU that has its interface for model exchange alone, in the cache.

    Raises
    ------
    UserError
        If it has none.
    """

    def copied() -> bytes:
        packed = io.BytesIO()
        with zipfile.ZipFile(path) as source, zipfile.ZipFile(packed, "w") as target:
            for entry in source.infolist():
                contents = root if entry.filename == _DESCRIPTION else source.read(entry)
                target.writestr(entry, contents, zipfile.ZIP_DEFLATED)
        return packed.getvalue()

    with Archive(path) as archive:
        description = archive.description
    if description.find("ModelExchange") is None:
        raise UserError(f"{path}: it has no model exchange; {_DESCRIPTION} lacks ModelExchange")
    for interface in description.findall("CoSimulation"):
        description.remove(interface)
    root = ElementTree.tostring(description)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return cache.cached_file(f"model_exchange_{digest}/{path.name}", copied)


def _packed(description: Element) -> io.BytesIO:
    """Return an archive in memory that contains a model description only."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr(_DESCRIPTION, ElementTree.tostring(description))
    packed.seek(0)
    return packed


def unpack(path: Path, calls: Path | None = None) -> str:
    """Unzip an FMU, without sources and documentation, into a new folder of `scratch`.

    The library of an FMU of FMI 3.0 is wrapped by one of FMI 2.0, and one for model exchange alone
    gets another with a solver.

    Parameters
    ----------
    path : Path
    calls : Path, optional
        File to which the calls of the FMU's own library are appended.

    Returns
    -------
    str
        The folder, which the caller must remove.

    Raises
    ------
    UserError
        If the FMU has no binary for this machine or cannot be unzipped.
    """
    import fmpy

    with Archive(path) as archive:
        platform = archive.host_platform
        if platform not in archive.platforms:
            available = ", ".join(archive.platforms) or "none"
            raise UserError(f"{path}: no binary for {platform}; it has {available}")
    folder = scratch.make("fmu")
    try:
        fmpy.extract(str(path), str(folder), include=lambda name: _is_needed(name, platform))
        if calls is not None:
            binaries = folder / "binaries" / platform
            names = {node.get("modelIdentifier", "") for node in archive.interfaces()}
            libraries = [binaries / f"{name}{fmpy.sharedLibraryExtension}" for name in names]
            log_calls(filter(Path.is_file, libraries), archive.version, calls, str(path))
        if archive.version == 3:
            wrap(folder, archive.description, str(path))
        if archive.as_fmi2.find("CoSimulation") is None:
            add_solver(folder, archive.as_fmi2, str(path))
    except BaseException as error:
        scratch.remove(folder)
        if not isinstance(error, Exception) or isinstance(error, UserError):
            raise
        if isinstance(error, OSError) and error.errno in scratch.NO_ROOM:
            raise scratch.no_room(folder.parent, error) from error
        raise UserError(f"{path}: cannot be loaded ({first_line(error)})") from error
    return str(folder)


def _is_needed(name: str, platform: str) -> bool:
    """Return whether an entry is needed at run time; unpacking all takes longer than loading."""
    top, _, inside = name.partition("/")
    if top == "binaries":
        return inside.startswith(f"{platform}/")
    return top not in ("sources", "documentation")


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, or the name of its type without a text."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
