"""Reading of untrusted archives and XML within bounds that are checked before reading."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

from fmus.kit import UserError

ENTRIES = 20_000  # files and folders in an archive
UNPACKED = 2**30  # bytes that an archive may unpack to; ours are below a megabyte
FILE = 2**28  # bytes of a file that is read at once
TEXT = 2**26  # bytes of an XML file
ELEMENTS = 1_000_000  # of an XML file
DEPTH = 100  # of elements in an XML file
# errors of zipfile for damaged, encrypted or unsupported members
UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    NotImplementedError,
    RuntimeError,
    OSError,
    ValueError,
)


def open_zip(path: Path, label: str, otherwise: str) -> zipfile.ZipFile:
    """Open a zip archive.

    Parameters
    ----------
    path : Path
    label : str
        Name of the archive in messages.
    otherwise : str
        Message for a file that is no zip archive.

    Returns
    -------
    zipfile.ZipFile

    Raises
    ------
    UserError
        If the file is no zip archive, or has more than `ENTRIES` entries or `UNPACKED` bytes.
    """
    try:
        opened = zipfile.ZipFile(path)
    except UNREADABLE as error:
        raise UserError(f"{label}: {otherwise}") from error
    entries = opened.infolist()
    total = sum(entry.file_size for entry in entries)
    if len(entries) <= ENTRIES and total <= UNPACKED:
        return opened
    opened.close()
    if len(entries) > ENTRIES:
        raise UserError(f"{label}: has {len(entries):,} entries; at most {ENTRIES:,} are read")
    raise UserError(f"{label}: unpacks to {total:.3g} bytes; at most {UNPACKED:.3g} are unpacked")


def check_size(label: str, name: str, size: int, most: int = FILE) -> None:
    """Raise UserError if a file is too large to be read at once.

    Parameters
    ----------
    label, name : str
        Names of the archive and the file in messages.
    size, most : int
        Size of the file and the largest size allowed, in bytes.

    Raises
    ------
    UserError
    """
    if size > most:
        raise UserError(f"{label}: {name} has {size} bytes; at most {most} are read")


def parse_xml(contents: bytes, label: str, name: str) -> ElementTree.Element:
    """Parse an XML file within bounds of size, number of elements and depth.

    Parameters
    ----------
    contents : bytes
    label, name : str
        Names of the archive and the file in messages.

    Returns
    -------
    xml.etree.ElementTree.Element
        The root element.

    Raises
    ------
    UserError
        If the XML is not well-formed, declares a document type, or is beyond a bound.
    """
    where = f"{label}: {name}"
    check_size(label, name, len(contents), TEXT)
    parser = ElementTree.XMLParser(target=_BoundedBuilder(where))
    try:
        parser.feed(contents)
        root: ElementTree.Element = parser.close()
    except UserError:
        raise
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise UserError(f"{where} cannot be read: it is not well-formed XML ({error})") from error
    return root


class _BoundedBuilder(ElementTree.TreeBuilder):
    """A builder of XML trees that raises UserError for a tree that is too deep or too large."""

    def __init__(self, where: str):
        super().__init__()
        self._where = where
        self._depth = 0
        self._count = 0

    def start(self, tag: str, attributes: dict[str, str], /) -> ElementTree.Element:
        self._depth += 1
        self._count += 1
        if self._depth > DEPTH:
            raise UserError(f"{self._where} nests elements more than {DEPTH} deep")
        if self._count > ELEMENTS:
            raise UserError(f"{self._where} has more than {ELEMENTS:,} elements")
        return super().start(tag, attributes)

    def end(self, tag: str, /) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag)

    def doctype(self, name: str, public: str | None, system: str | None) -> NoReturn:
        """Raise UserError: entities can grow without bound, and neither FMI nor SSP uses them."""
        raise UserError(f"{self._where} has a document type declaration; it is not read")
