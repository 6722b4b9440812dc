"""The files of a system: an untrusted archive, or a description in a folder."""

from __future__ import annotations

import stat
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from fmus.kit import UserError, files
from orchestration.fmu.archive import TEXT, UNREADABLE, check_size, open_zip, parse_xml
from orchestration.system.ssp.vocabulary import (
    DESCRIPTION,
    NAMESPACES,
    check_elements,
    check_version,
    local_name,
    tag,
)


class Package:
    """Context manager of the files of a system.

    Messages of its methods name a file of the system, and not the system.

    Parameters
    ----------
    path : Path
        An ``.ssp`` archive, or an ``.ssd`` description in the folder of the files.

    Raises
    ------
    UserError
        If it cannot be opened, is no SSP, or would write outside its folder or fill the disk.
    """

    def __init__(self, path: Path):
        self.path = path
        self._zip: zipfile.ZipFile | None = None
        if not path.is_file():
            reason = "a folder, not a system" if path.is_dir() else "no such file"
            raise UserError(f"{path}: {reason}")
        if path.suffix.lower() == ".ssd":
            self.description = path.name
            return
        self.description = DESCRIPTION
        self._zip = _open_safely(path, str(path))
        if DESCRIPTION not in self._zip.namelist():
            self._zip.close()
            raise UserError(f"{path}: a zip archive but no SSP ({DESCRIPTION} is not in it)")

    def __enter__(self) -> Package:
        return self

    def __exit__(self, *error: Any) -> None:
        if self._zip is not None:
            self._zip.close()

    def document(self, source: str, root: str) -> Element:
        """Return the root element of an XML file, whose elements are known.

        Parameters
        ----------
        source : str
            URI of the file.
        root : str
            Name of the root element, with the prefix of its namespace.

        Raises
        ------
        UserError
            If it is missing, damaged, too large, of another kind or version of SSP, or has an
            unknown element.
        """
        name = self._relative_path(source)
        check_size(str(self.path), name, self._size(name), TEXT)
        element = parse_xml(self._read(name), str(self.path), source)
        if element.tag != tag(root):
            raise UserError(f"{source} is a {local_name(element)}, not a {root.partition(':')[2]}")
        check_version(element, source)
        check_elements(element)
        return element

    def documents(self, owner: Element, path: str) -> list[Element]:
        """Return the documents in an element, and the one in the file that it names as its source.

        Parameters
        ----------
        owner : Element
        path : str
            Path of the documents in it; the last name is that of the root element of the file.

        Raises
        ------
        UserError
            As `document`.
        """
        found = owner.findall(path, NAMESPACES)
        for element in found:
            check_version(element, f"a {local_name(element)}")
        source = owner.get("source")
        if source is not None:
            found.append(self.document(source, path.rpartition("/")[2]))
        return found

    def _size(self, name: str) -> int:
        """Return the size of a file in bytes; 0 if it is missing."""
        if self._zip is not None:
            return self._zip.getinfo(name).file_size if name in self._zip.namelist() else 0
        file = self.path.parent / name
        return file.stat().st_size if files.is_file(file) else 0

    def _read(self, name: str) -> bytes:
        try:
            if self._zip is None:
                return (self.path.parent / name).read_bytes()
            return self._zip.read(name)
        except (KeyError, FileNotFoundError) as error:
            raise UserError(f"{name} is missing") from error
        except UNREADABLE as error:
            raise UserError(f"{name} cannot be read ({error})") from error

    def fmu(self, source: str, folder: Path) -> Path:
        """Return the path of an FMU file; one in an archive is extracted into a folder first.

        Parameters
        ----------
        source : str
            Its URI in the description.
        folder : Path

        Raises
        ------
        UserError
            If it is missing, damaged, or would write outside its own folder or fill the disk.
        """
        name = self._relative_path(source)
        path = self.path.parent / name
        if self._zip is not None:
            path = folder / name
            files.write(path, self._read(name))
        elif not files.is_file(path):
            raise UserError(f"{name} is missing")
        _open_safely(path, name).close()
        return path

    def _relative_path(self, source: str) -> str:
        """Return the path of a file, given its URI, which must not lead out of the folder."""
        name = unquote(source)
        if _leads_out(name) or "://" in name:
            raise UserError(f"{name!r} leads out of the folder of the system")
        return str(PurePosixPath(name))


def _open_safely(path: Path, label: str) -> zipfile.ZipFile:
    """Open a zip archive that can be unpacked safely.

    Raises
    ------
    UserError
        If it cannot be read, or an entry leads out of its folder or is a symbolic link.
    """
    opened = open_zip(path, label, "not a zip archive, or one that is cut off")
    try:
        for entry in opened.infolist():
            if _leads_out(entry.filename):
                raise UserError(
                    f"{label}: {entry.filename!r} leads out of the archive; it is not opened"
                )
            if stat.S_ISLNK(entry.external_attr >> 16):
                raise UserError(f"{label}: {entry.filename!r} is a symbolic link; it is not opened")
    except UserError:
        opened.close()
        raise
    return opened


def _leads_out(name: str) -> bool:
    """Return whether a path is empty, absolute on any platform, has ``..``, or names a drive."""
    has_special = any(character in name for character in "\\:\0")
    return not name or has_special or name.startswith("/") or ".." in name.split("/")
