"""The archive of an FMU: opened within bounds, its model description read, and unpacked."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from fmus.kit.storage import scratch
from orchestration.fmu.bounded import FILE, TEXT, UNREADABLE, check_size, open_zip, parse_xml

_DESCRIPTION = "modelDescription.xml"
_VARIABLES = "ModelVariables"
_CHUNK = 2**20  # bytes that are read at once


class Archive:
    """The opened archive of an FMU; a context manager.

    Parameters
    ----------
    path : Path

    Raises
    ------
    UserError
        If the file is missing, no zip archive, no FMU, not of FMI 2.0, or beyond the bounds.

    Attributes
    ----------
    path : Path
    names : list of str
        Its files, without folders.
    description : Element
        Root of ``modelDescription.xml``.
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
        version = root.get("fmiVersion")
        if version != "2.0":
            raise UserError(
                f"{self.path}: FMI version {version or 'not stated'}; this program knows FMI 2.0"
            )
        return root

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *error: Any) -> None:
        self._zip.close()

    @property
    def platforms(self) -> list[str]:
        """Names of the folders in ``binaries/`` that are not empty."""
        paths = [name.split("/") for name in self.names]
        return sorted({parts[1] for parts in paths if parts[0] == "binaries" and len(parts) > 2})

    def read(self, name: str) -> bytes | None:
        """Return the contents of a file; None if it is damaged, or too large to be read at once."""
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
        """Return the elements ``CoSimulation`` and ``ModelExchange``, as far as they exist."""
        return [
            element
            for element in self.description
            if element.tag in ("CoSimulation", "ModelExchange")
        ]


def read_description(path: Path) -> Any:
    """Read the model description of an FMU that is to be run.

    Parameters
    ----------
    path : Path

    Returns
    -------
    fmpy.model_description.ModelDescription

    Raises
    ------
    UserError
        If the file is missing, no zip, no FMU, not FMI 2.0 for co-simulation, or an element is
        missing.
    """
    import fmpy

    with Archive(path) as archive:  # the outer form only: `ppy check` judges what is in it
        if not archive.interfaces():
            raise UserError(
                f"{path}: {_DESCRIPTION} has neither an element CoSimulation nor ModelExchange"
            )
        if archive.description.find(_VARIABLES) is None:
            raise UserError(f"{path}: {_DESCRIPTION} has no element {_VARIABLES}")
    try:
        description = fmpy.read_model_description(str(path), validate=False)
    except Exception as error:
        raise UserError(f"{path}: {_DESCRIPTION} cannot be read ({first_line(error)})") from error
    if description.coSimulation is None:
        raise UserError(f"{path}: an FMU for model exchange only; this program runs co-simulation")
    return description


def unpack(path: Path) -> str:
    """Unzip an FMU, without sources and documentation, into a new folder of `scratch`.

    Returns
    -------
    str
        The folder, which the caller must remove.

    Raises
    ------
    UserError
        If it has no binary for this machine, or cannot be unzipped.
    """
    import fmpy

    with Archive(path) as archive:
        if fmpy.platform not in archive.platforms:
            available = ", ".join(archive.platforms) or "none"
            raise UserError(f"{path}: no binary for {fmpy.platform}; it has {available}")
    folder = scratch.make("fmu")
    try:
        fmpy.extract(str(path), str(folder), include=lambda name: _is_needed(name, fmpy.platform))
    except BaseException as error:
        scratch.remove(folder)
        if not isinstance(error, Exception):
            raise
        if isinstance(error, OSError) and error.errno in scratch.NO_ROOM:
            raise scratch.no_room(folder.parent, error) from error
        raise UserError(f"{path}: cannot be loaded ({first_line(error)})") from error
    return str(folder)


def _is_needed(name: str, platform: str) -> bool:
    """Return whether an entry is needed to run the FMU: making files takes longer than loading."""
    top, _, inside = name.partition("/")
    if top == "binaries":
        return inside.startswith(f"{platform}/")
    return top not in ("sources", "documentation")


def first_line(error: Exception) -> str:
    """Return the first line of the text of an error, or its type if it has no text."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
