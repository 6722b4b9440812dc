"""Archives and XML from anybody, read within bounds: what is beyond them is refused before it takes time or memory."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

from fmus.kit.errors import UserError

ENTRIES = 20_000  # files and folders in an archive
UNPACKED = 2**30  # bytes that an archive may unpack to; ours are below a megabyte
FILE = 2**28  # bytes of one file that is read at once
TEXT = 2**26  # bytes of an XML file
ELEMENTS, DEPTH = 1_000_000, 100  # of an XML file
# what zipfile raises on damaged, encrypted or strangely compressed members
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
        What it is called.
    otherwise : str
        What is said of a file that is none.

    Raises
    ------
    UserError
        If it is none, or beyond a bound.
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
    """Refuse a file that is too large to be read at once.

    Raises
    ------
    UserError
        If it is.
    """
    if size > most:
        raise UserError(f"{label}: {name} has {size} bytes; at most {most} are read")


def parse_xml(contents: bytes, label: str, name: str) -> ElementTree.Element:
    """Parse XML.

    Parameters
    ----------
    contents : bytes
    label, name : str
        What the archive and the file are called.

    Raises
    ------
    UserError
        If it is not well-formed, declares a document type, or is beyond a bound.
    """
    where = f"{label}: {name}"
    check_size(label, name, len(contents), TEXT)
    parser = ElementTree.XMLParser(target=_Builder(where))
    try:
        parser.feed(contents)
        root: ElementTree.Element = parser.close()
    except UserError:
        raise
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise UserError(f"{where} cannot be read: it is not well-formed XML ({error})") from error
    return root


class _Builder(ElementTree.TreeBuilder):
    """Builds a tree, as long as it is not too deep or large."""

    def __init__(self, where: str):
        super().__init__()
        self._where, self._depth, self._count = where, 0, 0

    def start(self, tag: str, attributes: dict[str, str], /) -> ElementTree.Element:
        self._depth, self._count = self._depth + 1, self._count + 1
        if self._depth > DEPTH:
            raise UserError(f"{self._where} has elements in elements, more than {DEPTH} deep")
        if self._count > ELEMENTS:
            raise UserError(f"{self._where} has more than {ELEMENTS:,} elements")
        return super().start(tag, attributes)

    def end(self, tag: str, /) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag)

    def doctype(self, name: str, public: str | None, system: str | None) -> NoReturn:
        """Refuse entities: they can be made to grow without bound, and neither FMI nor SSP has a use for them."""
        raise UserError(f"{self._where} has a document type declaration; it is not read")
